"""States, setpoints and autopilot parameters of many vehicles, as arrays."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from flight_model.arrays import Array
from flight_model.autopilot import AutopilotModel, FlightState
from flight_model.slot import Triple

Indices = npt.NDArray[np.intp]


class Row:
    """One quantity of many vehicles, (N,): a row of the table of a `Columns`; a slice gives several rows."""

    def __init__(self, index: int | slice) -> None:
        """Be the row at `index`."""
        self._index = index

    def __get__(self, columns: Columns, owner: type[Columns] | None = None) -> Array:
        """Return the row itself, not a copy."""
        return columns.table[self._index]


class Columns:
    """Quantities of many vehicles: a table (R, N) with a row for each quantity and a column for each vehicle."""

    __slots__ = ("table",)

    def __init__(self, *rows: Array) -> None:
        """Build the table from its rows, (N,) each."""
        self.table: Array = np.array(rows)

    @classmethod
    def of(cls, table: Array) -> Self:
        """Return columns that share this table; it is not copied."""
        made = cls.__new__(cls)
        made.table = table
        return made

    def take(self, which: Indices) -> Self:
        """Return the columns of the vehicles at `which`, repeated as often as named."""
        return self.of(self.table[:, which])

    def fill(self, which: Indices, source: Self) -> None:
        """Put the columns of `source` in the place of those at `which`."""
        self.table[:, which] = source.table


class FlightStates(Columns):
    """Position and motion of vehicles: north, east and up from the scenario's origin.

    Airspeed and heading are relative to the air; ground velocity is airspeed along the heading, plus the wind
    (and whatever else carries the vehicle), equation (7) with errata item 17.
    """

    __slots__ = ()

    north_m = Row(0)
    east_m = Row(1)
    height_m = Row(2)
    climb_mps = Row(3)
    airspeed_mps = Row(4)
    heading_rad = Row(5)
    wind_north_mps = Row(6)
    wind_east_mps = Row(7)
    place_m = Row(slice(0, 3))
    """North, east and height, (3, N)."""
    level_m = Row(slice(0, 2))
    """North and east, (2, N)."""
    wind_mps = Row(slice(6, 8))
    """Wind to the north and east, (2, N)."""
    air_motion = Row(slice(4, 6))
    """Airspeed and heading, (2, N)."""

    def __init__(
        self,
        north_m: Array,
        east_m: Array,
        height_m: Array,
        climb_mps: Array,
        airspeed_mps: Array,
        heading_rad: Array,
        wind_north_mps: Array,
        wind_east_mps: Array,
    ) -> None:
        """Build the states from (N,) each."""
        super().__init__(north_m, east_m, height_m, climb_mps, airspeed_mps, heading_rad, wind_north_mps, wind_east_mps)

    @classmethod
    def from_each(cls, states: Iterable[FlightState]) -> FlightStates:
        """Return the states of vehicles, one after another."""
        return cls.of(np.array([state.values() for state in states]).T)

    @property
    def ground_mps(self) -> Array:
        """Velocity over ground, north and east, (2, N)."""
        return self.airspeed_mps * np.array((np.cos(self.heading_rad), np.sin(self.heading_rad))) + self.wind_mps

    def places_after(self, seconds: Array) -> Array:
        """Return where vehicles are after flying straight on for (N,) seconds: (N, 3) north, east, height in m."""
        velocity_mps = np.array((*self.ground_mps, self.climb_mps))
        return (self.place_m + seconds * velocity_mps).T

    def turned(self, turn_rps: Array, over_s: Array) -> FlightStates:
        """Return these states, reached by flying straight, as if the vehicles had turned at a constant rate instead.

        Args:
            turn_rps: (N,) to the right.
            over_s: (N,) how long they have turned.
        """
        if not turn_rps.any():
            return self
        state, half = FlightStates.of(self.table.copy()), turn_rps * over_s / 2
        way_m, chord = self.airspeed_mps * over_s, np.sinc(half / np.pi)
        state.north_m[:] += way_m * (chord * np.cos(self.heading_rad + half) - np.cos(self.heading_rad))
        state.east_m[:] += way_m * (chord * np.sin(self.heading_rad + half) - np.sin(self.heading_rad))
        state.heading_rad[:] += 2 * half
        return state


class Setpoints(Columns):
    """Setpoints of vehicles; NaN where none was sent."""

    __slots__ = ()

    speed_mps = Row(0)
    heading_rad = Row(1)
    height_m = Row(2)
    air_motion = Row(slice(0, 2))
    """Speed and heading, (2, N)."""

    def __init__(self, speed_mps: Array, heading_rad: Array, height_m: Array) -> None:
        """Build the setpoints from (N,) each."""
        super().__init__(speed_mps, heading_rad, height_m)

    @classmethod
    def from_each(cls, setpoints: Iterable[Triple]) -> Setpoints:
        """Return the setpoints of vehicles, one after another."""
        return cls.of(np.array(list(setpoints)).T)


class AutopilotModels(Columns):
    """The autopilot of equation (7) and its limits."""

    __slots__ = ()

    tau_v_s = Row(0)
    tau_psi_s = Row(1)
    tau_ha_s = Row(2)
    tau_hb_s = Row(3)
    speed_min_mps = Row(4)
    speed_max_mps = Row(5)
    accel_max_mps2 = Row(6)
    turn_rate_max_rps = Row(7)
    climb_max_mps = Row(8)
    air_lags_s = Row(slice(0, 2))
    """Of airspeed and heading, (2, N)."""
    air_rates_max = Row(slice(6, 8))
    """Of airspeed and heading, (2, N)."""

    @classmethod
    def from_each(cls, models: Iterable[AutopilotModel]) -> AutopilotModels:
        """Return the models of vehicles, one after another."""
        return cls.of(np.array([model.values() for model in models]).T)


class Setpoint(NamedTuple):
    """Airspeed, heading (clockwise from north) and height above the scenario's origin."""

    speed_mps: float
    heading_rad: float
    height_m: float

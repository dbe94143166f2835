"""States, setpoints and autopilot parameters of many vehicles as arrays, and the autopilot model (7) on them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from flight_model.arrays import Array, Indices, all_of, within, wrap
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3

_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_NODES = ((_GAUSS + 1) / 2)[:, None]
"""Gauss points of a time interval, as shares of it: speed and heading are evaluated there for the distance flown."""
_SHARES = (_WEIGHTS / 2)[:, None]


class Row:
    """One quantity of many vehicles, (N,): a row of the table of a `Columns`; a slice gives several rows."""

    def __init__(self, index: int | slice) -> None:
        """Take the row's index in the table."""
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
        """Return columns that share this table without a copy."""
        made = cls.__new__(cls)
        made.table = table
        return made

    def select(self, which: Indices) -> Self:
        """Return the columns at `which`, repeated as often as they occur there."""
        return self.of(self.table[:, which])


class FlightStates(Columns):
    """Position and motion of vehicles: north, east and up from the scenario's origin.

    Airspeed and heading are relative to the air; ground velocity is airspeed along the heading, plus the wind
    (and any other drift), equation (7) with errata item 17.
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
    updraught_mps = Row(8)
    """Part of the climb rate that is the air's."""
    position_m = Row(slice(0, 3))
    """North, east and height, (3, N)."""
    level_m = Row(slice(0, 2))
    """North and east, (2, N)."""
    wind_mps = Row(slice(6, 8))
    """Wind to the north and east, (2, N)."""
    air_motion = Row(slice(4, 6))
    """Airspeed and heading, (2, N)."""

    def __init__(  # noqa: PLR0913, PLR0917 - a state's rows
        self,
        north_m: Array,
        east_m: Array,
        height_m: Array,
        climb_mps: Array,
        airspeed_mps: Array,
        heading_rad: Array,
        wind_north_mps: Array,
        wind_east_mps: Array,
        updraught_mps: Array | None = None,
    ) -> None:
        """Build the states from (N,) each; without an updraught it is 0."""
        carried_mps = np.zeros_like(north_m) if updraught_mps is None else updraught_mps
        air = airspeed_mps, heading_rad, wind_north_mps, wind_east_mps, carried_mps
        super().__init__(north_m, east_m, height_m, climb_mps, *air)

    @classmethod
    def from_each(cls, states: Iterable[FlightState]) -> FlightStates:
        """Return the states of vehicles, one after another."""
        return cls.of(np.array([state.values() for state in states]).T)

    @property
    def ground_mps(self) -> Array:
        """Velocity over ground, north and east, (2, N)."""
        return self.airspeed_mps * np.array((np.cos(self.heading_rad), np.sin(self.heading_rad))) + self.wind_mps

    def turned(self, turn_rps: Array, over_s: Array) -> FlightStates:
        """Return these states, predicted for straight flight, corrected for a constant turn rate.

        Args:
            turn_rps: (N,) to the right.
            over_s: (N,) duration of the turn.
        """
        if not turn_rps.any():
            return self
        state, half = FlightStates.of(self.table.copy()), turn_rps * over_s / 2
        distance_m, chord = self.airspeed_mps * over_s, np.sinc(half / np.pi)
        state.north_m[:] += distance_m * (chord * np.cos(self.heading_rad + half) - np.cos(self.heading_rad))
        state.east_m[:] += distance_m * (chord * np.sin(self.heading_rad + half) - np.sin(self.heading_rad))
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
    def from_each(cls, setpoints: Iterable[Vector3]) -> Setpoints:
        """Return the setpoints of vehicles, one after another."""
        return cls.of(np.array(list(setpoints)).T)


class AutopilotModels(Columns):
    """Autopilots of equation (7), with their limits."""

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
    air_taus_s = Row(slice(0, 2))
    """Time constants of airspeed and heading, (2, N)."""
    air_rates_max = Row(slice(6, 8))
    """Rate limits of airspeed and heading, (2, N)."""

    @classmethod
    def from_each(cls, models: Iterable[AutopilotModel]) -> AutopilotModels:
        """Return the models of vehicles, one after another."""
        return cls.of(np.array([model.values() for model in models]).T)

    def remaining(self, error: Array, time_s: Array) -> Array:
        """Return what first-order lags with limited rates leave of errors in speed and heading after `time_s`."""
        return _remaining(error, time_s, self.air_taus_s, self.air_rates_max)


def _remaining(error: Array, time_s: Array, tau_s: Array, rate_max: Array) -> Array:
    """Return what first-order lags with limited rates leave of `error` after `time_s`."""
    size = np.abs(error)
    if all_of(size <= rate_max * tau_s):
        return error * np.exp(-time_s / tau_s)
    limited_s = np.minimum(np.maximum(size / rate_max - tau_s, 0.0), time_s)
    left = (size - rate_max * limited_s) * np.exp((limited_s - time_s) / tau_s)
    return np.copysign(left, error)


def advance(state: FlightStates, setpoints: Array, duration_s: Array, model: AutopilotModels) -> FlightStates:
    """Return the state when setpoints have been held for `duration_s`, by the closed forms of equation (7).

    Speed and heading errors decay exponentially, and linearly while a rate limit holds them. The distance flown is
    their integral by Gauss quadrature. The height follows its two real poles. Wind and updraught are constant.

    Args:
        state: (N,) columns.
        setpoints: (3, N) setpoints of speed, heading and height in m/s, rad and m; NaN means straight on.
        duration_s: in s, (N,).
        model: (N,) columns.
    """
    speed_mps, heading_rad, aim_m = setpoints
    speed_mps = within(speed_mps, model.speed_min_mps, model.speed_max_mps)
    begin = state.air_motion
    error = air_errors(begin, np.array((speed_mps, heading_rad)))
    end = begin + error - model.remaining(error, duration_s)
    along = begin + error - model.remaining(error, (_NODES * duration_s)[:, None])
    steps_m, heading = _SHARES * duration_s * along[:, 0], along[:, 1]
    north_m = state.north_m + np.add.reduce(steps_m * np.cos(heading)) + state.wind_north_mps * duration_s
    east_m = state.east_m + np.add.reduce(steps_m * np.sin(heading)) + state.wind_east_mps * duration_s
    return _moved(state, aim_m, duration_s, model, north_m, east_m, *end, *state.wind_mps)


def advance_hovering(state: FlightStates, setpoints: Array, duration_s: Array, model: AutopilotModels) -> FlightStates:
    """Return the state of multirotors when setpoints of velocity over ground have been held for `duration_s`.

    The arguments are those of `advance`, with speed and heading those of a velocity over ground.
    """
    aim_mps = velocity_aimed_at(state, setpoints[:2], model)
    north_mps, east_mps = velocities(state.ground_mps, aim_mps, duration_s[None], model)[:, 0]
    over = velocities(state.ground_mps, aim_mps, _NODES * duration_s, model)
    north_m, east_m = state.level_m + (_SHARES * duration_s * over).sum(axis=1)
    motion = np.hypot(north_mps, east_mps), np.arctan2(east_mps, north_mps), 0.0 * north_mps, 0.0 * east_mps
    return _moved(state, setpoints[2], duration_s, model, north_m, east_m, *motion)


def velocity_aimed_at(state: FlightStates, motion: Array, model: AutopilotModels) -> Array:
    """Return velocities (2, N) commanded as speed and heading (2, N); NaN: the present one."""
    north_mps, east_mps = state.ground_mps
    own, aim = np.array((np.hypot(north_mps, east_mps), np.arctan2(east_mps, north_mps))), motion.copy()
    missing = np.isnan(aim)
    aim[missing] = own[missing]
    speed_mps, heading_rad = aim
    return within(speed_mps, 0.0, model.speed_max_mps) * np.array((np.cos(heading_rad), np.sin(heading_rad)))


def velocities(begin_mps: Array, aim_mps: Array, time_s: Array, model: AutopilotModels) -> Array:
    """Return velocities over ground (2, S, N) of multirotors that change straight from one velocity to another.

    The change has the time constant and the acceleration limit of the model's speed.

    Args:
        begin_mps: (2, N).
        aim_mps: (2, N).
        time_s: (S, N) or (S, 1) since the beginning.
        model: (N,) columns.
    """
    error = aim_mps - begin_mps
    size = np.hypot(error[0], error[1])
    left = _remaining(size, time_s, model.tau_v_s, model.accel_max_mps2) / np.maximum(size, 1e-9)
    return aim_mps[:, None] - error[:, None] * left


def _moved(state: FlightStates, aim_m: Array, duration_s: Array, model: AutopilotModels, *level: Array) -> FlightStates:
    """Return later states, with `level` as north, east, airspeed, heading, wind north and wind east, (N,) each."""
    height, steps = Height(state.height_m, state.climb_mps), HeightSteps.of(model, duration_s[None])
    offset_m = updraught_offset_m(state, model)
    height = steps.after(0, height, steps.commanded_m(height, aim_m, offset_m) + offset_m)
    return FlightStates.of(np.array((*level[:2], *height, *level[2:], state.updraught_mps)))


def updraught_offset_m(state: FlightStates, model: AutopilotModels) -> Array:
    """Return the steady height error of vehicles from updraughts, (N,)."""
    return (model.tau_ha_s + model.tau_hb_s) * state.updraught_mps


def air_errors(begin: Array, setpoints: Array) -> Array:
    """Return the errors (2, N) from `begin` to setpoints of speed and heading; 0 for NaN."""
    error = setpoints - begin
    error[1] = wrap(error[1])
    error[np.isnan(error)] = 0.0
    return error


class Height(NamedTuple):
    """Height and climb rate, (N,)."""

    height_m: Array
    climb_mps: Array


class HeightSteps(NamedTuple):
    """The transition of heights over K steps of time, by the two poles of equation (7)."""

    slow_s: Array
    """The larger time constant, (N,)."""
    carried_s: Array
    """Height gained per m/s of climb rate until it is levelled off, (N,): the sum of both time constants."""
    climb_max_mps: Array
    slow_left: Array
    """Decay factor of the slow pole over each step, (K, N)."""
    fast_left: Array
    between_s: Array
    """(K, N)."""
    max_m: Array
    """Largest climb in each step by the climb limit, (K, N)."""
    min_m: Array
    """Largest descent likewise, (K, N), negative."""

    @classmethod
    def of(cls, model: AutopilotModels, time_s: Array) -> HeightSteps:
        """Return the steps that take `time_s`, (K, N) or (K, 1), for `model` of (N,) columns.

        With equal time constants, the limit of exprel gives the solution for a double pole.
        """
        slow, fast = np.maximum(model.tau_ha_s, model.tau_hb_s), np.minimum(model.tau_ha_s, model.tau_hb_s)
        slow_left = np.exp(-time_s / slow)
        between_s = time_s * slow_left * _exprel(time_s / slow - time_s / fast)
        max_m = model.climb_max_mps * time_s
        fast_left = np.exp(-time_s / fast)
        return cls(slow, slow + fast, model.climb_max_mps, slow_left, fast_left, between_s, max_m, -max_m)

    def commanded_m(self, height: Height, setpoint_m: Array, offset_m: Array) -> Array:
        """Return height setpoints (N,); NaN is replaced by one that levels off a vehicle raised by `offset_m`."""
        level_m = height.height_m + self.carried_s * height.climb_mps
        return np.where(np.isnan(setpoint_m), level_m - offset_m, setpoint_m)

    def after(self, step: int, height: Height, target_m: Array) -> Height:
        """Return the height after a step; the climb rate is clipped to its limit."""
        error = height.height_m - target_m
        push_mps = height.climb_mps + error / self.slow_s
        left_m = self.slow_left[step] * error + self.between_s[step] * push_mps
        climb_mps = self.fast_left[step] * push_mps - left_m / self.slow_s
        climbed_m, max_mps = within(left_m - error, self.min_m[step], self.max_m[step]), self.climb_max_mps
        return Height(height.height_m + climbed_m, within(climb_mps, -max_mps, max_mps))


def _exprel(value: Array) -> Array:
    """Return (e^x - 1) / x, 1 for 0, as scipy's `exprel`, whose import takes longer than a tick."""
    none = value == 0.0
    return np.where(none, 1.0, np.expm1(value) / np.where(none, 1.0, value))

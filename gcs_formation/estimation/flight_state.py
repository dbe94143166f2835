"""States, setpoints and autopilot parameters of many vehicles, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
import numpy.typing as npt

from gcs_formation.arrays import Array

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Columns:
    """Arrays of one shape (N,), an element a vehicle."""

    def take(self, which: Indices) -> Self:
        """Return the columns of the vehicles at `which`, repeated as often as named."""
        return type(self)(*(getattr(self, field.name)[which] for field in fields(self)))

    @property
    def table(self) -> Array:
        """The arrays as rows of one, (fields, N)."""
        return np.array([getattr(self, field.name) for field in fields(self)])


@dataclass(frozen=True)
class FlightState(Columns):
    """Where vehicles are and how they move: NED from the scenario's origin, height upwards.

    Airspeed and heading are relative to the air; ground velocity is airspeed along the heading, plus the wind
    (and whatever else carries the vehicle), equation (7) with errata item 17.
    """

    north_m: Array
    east_m: Array
    height_m: Array
    climb_mps: Array
    airspeed_mps: Array
    heading_rad: Array
    wind_north_mps: Array
    wind_east_mps: Array


@dataclass(frozen=True)
class Setpoints(Columns):
    """What vehicles are told to fly; NaN where nothing was told."""

    speed_mps: Array
    heading_rad: Array
    height_m: Array


@dataclass(frozen=True)
class AutopilotModel(Columns):
    """The autopilot of equation (7) and its limits."""

    tau_v_s: Array
    tau_psi_s: Array
    tau_ha_s: Array
    tau_hb_s: Array
    speed_min_mps: Array
    speed_max_mps: Array
    accel_max_mps2: Array
    turn_rate_max_rps: Array
    climb_max_mps: Array

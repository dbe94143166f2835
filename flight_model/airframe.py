"""What an aircraft under total-energy control is made of: a row for each parameter, a column for each aircraft."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from flight_model.arrays import Array

GRAVITY_MPS2 = 9.80665
REFERENCE_MPS = 22.0
"""Airspeed at which drag and lift are given."""


@dataclass(frozen=True)
class AirframeParameters:
    """(N,) each, SI; `formation_scenario.vehicles.EnergyAirframe` describes them."""

    thrust_mps2: Array
    drag_mps2: Array
    induced_drag_mps2: Array
    lift_mps2_per_rad: Array
    throttle_slew_per_s: Array
    bank_lag_s: Array
    pitch_lag_s: Array
    rate_lag_s: Array
    bank_max_rad: Array
    heading_gain: Array
    pitch_max_rad: Array
    pitch_min_rad: Array
    throttle_cruise: Array
    airspeed_min_mps: Array
    airspeed_cruise_mps: Array
    airspeed_max_mps: Array
    climb_max_mps: Array
    sink_min_mps: Array
    sink_max_mps: Array
    time_constant_s: Array
    height_lag_s: Array
    throttle_damping: Array
    pitch_damping: Array
    integral_gain: Array
    speed_weight: Array
    bank_to_throttle: Array
    vertical_accel_max_mps2: Array
    speed_filter_radps: Array
    airspeed_lag_s: Array
    dead_time_s: Array

    @classmethod
    def of(cls, aircraft: Sequence[Mapping[str, float]]) -> Self:
        """Return the parameters of N aircraft, each by their names."""
        return cls(**{name: np.array([each[name] for each in aircraft]) for name in NAMES})

    def repeated(self, count: int) -> AirframeParameters:
        """Return one aircraft's parameters for `count` of its kind."""
        return AirframeParameters(**{name: np.repeat(getattr(self, name), count) for name in NAMES})


NAMES = tuple(each.name for each in fields(AirframeParameters))
PHYSICAL = (
    "thrust_mps2", "drag_mps2", "induced_drag_mps2", "lift_mps2_per_rad", "bank_lag_s", "pitch_lag_s", "rate_lag_s",
    "airspeed_lag_s",
)  # fmt: skip
"""What differs from one aircraft of a kind to the next; the rest is set in their autopilots."""

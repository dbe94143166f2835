"""What an aircraft under total-energy control is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final, Self

GRAVITY_MPS2: Final = 9.80665
REFERENCE_MPS: Final = 22.0
"""Airspeed at which drag and lift are given."""


@dataclass(frozen=True)
class AirframeParameters:
    """One aircraft's, SI; `formation_scenario.vehicles.EnergyAirframe` describes them."""

    thrust_mps2: float
    drag_mps2: float
    induced_drag_mps2: float
    lift_mps2_per_rad: float
    throttle_slew_per_s: float
    bank_lag_s: float
    pitch_lag_s: float
    rate_lag_s: float
    bank_max_rad: float
    heading_gain: float
    pitch_max_rad: float
    pitch_min_rad: float
    throttle_cruise: float
    airspeed_min_mps: float
    airspeed_cruise_mps: float
    airspeed_max_mps: float
    climb_max_mps: float
    sink_min_mps: float
    sink_max_mps: float
    time_constant_s: float
    height_lag_s: float
    throttle_damping: float
    pitch_damping: float
    integral_gain: float
    speed_weight: float
    bank_to_throttle: float
    vertical_accel_max_mps2: float
    speed_filter_radps: float
    airspeed_lag_s: float
    dead_time_s: float

    @classmethod
    def of(cls, values: Mapping[str, float]) -> Self:
        """Return the parameters by their names; other names are left out."""
        return cls(**{name: values[name] for name in NAMES})


NAMES = tuple(each.name for each in fields(AirframeParameters))
PHYSICAL = (
    "thrust_mps2", "drag_mps2", "induced_drag_mps2", "lift_mps2_per_rad", "bank_lag_s", "pitch_lag_s", "rate_lag_s",
    "airspeed_lag_s",
)  # fmt: skip
"""What differs from one aircraft of a kind to the next; the rest is set in their autopilots."""

"""One vehicle's motion as telemetry reports it, and what its state estimate says of itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple


class InnovationRatios(NamedTuple):
    """The newest innovations as shares of what the filter accepts, which EKF_STATUS_REPORT calls variances."""

    velocity: float = 0.02
    horizontal: float = 0.02
    height: float = 0.02
    compass: float = 0.01


USUAL = InnovationRatios()


@dataclass
class Estimate:
    """The estimate at one sample."""

    received: Motion | None
    """The motion by the GNSS receiver; None without a fix."""
    pitch_error_rad: float = 0.0
    bank_error_rad: float = 0.0
    unknown: int = 0
    """Bits of EKF_STATUS_FLAGS: which of its estimates are too uncertain to be called good."""
    ratios: InnovationRatios = USUAL


@dataclass
class Motion:
    """NED from the fleet's origin, heights upwards; airspeed and heading are air-relative; headings aren't wrapped."""

    north_m: float
    east_m: float
    height_m: float
    climb_mps: float
    airspeed_mps: float
    heading_rad: float
    velocity_north_mps: float
    velocity_east_mps: float
    velocity_down_mps: float
    drift_north_mps: float
    drift_east_mps: float
    drift_down_mps: float
    turn_rate_radps: float
    airspeed_setpoint_mps: float
    heading_setpoint_rad: float
    height_setpoint_m: float


def with_drift(sensed: Motion) -> Motion:
    """Return a motion with the drift as the vehicle estimates it: ground velocity minus airspeed along the heading."""
    north = sensed.velocity_north_mps - sensed.airspeed_mps * math.cos(sensed.heading_rad)
    east = sensed.velocity_east_mps - sensed.airspeed_mps * math.sin(sensed.heading_rad)
    return replace(sensed, drift_north_mps=north, drift_east_mps=east)

"""What a vehicle's state estimate says of itself, beside the motion, and what its receiver says."""

from __future__ import annotations

from typing import NamedTuple

from sim_vehicles.motion import Motion


class InnovationRatios(NamedTuple):
    """The newest innovations as shares of what the filter accepts, which EKF_STATUS_REPORT calls variances."""

    velocity: float = 0.02
    horizontal: float = 0.02
    height: float = 0.02
    compass: float = 0.01


class Estimate(NamedTuple):
    """The estimate at one sample."""

    received: Motion | None
    """The motion by the GNSS receiver; None without a fix."""
    pitch_error_rad: float = 0.0
    bank_error_rad: float = 0.0
    unknown: int = 0
    """Bits of EKF_STATUS_FLAGS: which of its estimates are too uncertain to be called good."""
    ratios: InnovationRatios = InnovationRatios()

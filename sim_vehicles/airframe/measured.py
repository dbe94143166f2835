"""A vehicle's motion as extensions see it and change it."""

from __future__ import annotations

from collections.abc import Sequence

from formation_scenario.simulated import Measured
from sim_vehicles.airframe.motion import Motion, with_drift


def measured_of(motion: Motion) -> Measured:
    """Return what telemetry has of a motion."""
    return Measured(
        motion.north_m,
        motion.east_m,
        motion.height_m,
        motion.velocity_north_mps,
        motion.velocity_east_mps,
        motion.velocity_down_mps,
        motion.airspeed_mps,
        motion.heading_rad,
    )


def with_measured(motion: Motion, measured: Sequence[float]) -> Motion:
    """Return a motion as it was measured, the numbers in the order of `Measured`."""
    sensed = motion.copy()
    sensed.north_m, sensed.east_m, sensed.height_m = measured[:3]
    sensed.velocity_north_mps, sensed.velocity_east_mps, sensed.velocity_down_mps = measured[3:6]
    sensed.climb_mps = -sensed.velocity_down_mps
    sensed.airspeed_mps, sensed.heading_rad = max(0.0, measured[6]), measured[7]
    return with_drift(sensed)

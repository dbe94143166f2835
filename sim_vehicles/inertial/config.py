"""The configuration of a vehicle that navigates by inertia."""

from __future__ import annotations

from dataclasses import dataclass

from sim_vehicles.inertial.aiding import Aid
from sim_vehicles.inertial.imu import InertialSensors


@dataclass(frozen=True)
class InertialConfig:
    """Sensors, the aid that bounds their drift, and the alignment before the flight."""

    sensors: InertialSensors
    aid: Aid | None = None
    aligned_s: int | None = None
    """Duration of the alignment, at rest, before the vehicle boots, s; None: it starts from its true state."""
    airspeed_mps: float = 0.0
    """Standard deviation of the airspeed as measured."""

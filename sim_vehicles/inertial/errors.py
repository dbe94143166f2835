"""How a vehicle navigates by inertia."""

from __future__ import annotations

from dataclasses import dataclass

from sim_vehicles.inertial.aiding import Aid
from sim_vehicles.inertial.imu import InertialSensors


@dataclass(frozen=True)
class InertialErrors:
    """Its sensors, what aids them, and what it begins with."""

    sensors: InertialSensors
    aid: Aid | None = None
    aligned_s: int | None = None
    """How long it has stood and aligned before it boots; None: it begins with its true state."""

"""What carries vehicles through the air besides the wind: how its velocity goes on in time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from airlink.identity import VehicleId


@dataclass(frozen=True)
class Passing:
    """Something in the air from a mission time until another."""

    at_s: float
    until_s: float
    vehicles: frozenset[VehicleId]

    def acts(self, mission_s: float) -> bool:
        """Whether it's there at a mission time."""
        return self.at_s <= mission_s < self.until_s


@dataclass(frozen=True)
class Disturbance(Passing):
    """A step: a velocity in m/s, north, east and down."""

    velocity_mps: tuple[float, float, float]

    def share(self, age_s: float) -> float:  # noqa: ARG002 - a step has no age
        """Return what part of the velocity is there `age_s` after the beginning."""
        return 1.0


@dataclass(frozen=True)
class Ramp(Disturbance):
    """A velocity that grows in proportion to time until it's whole."""

    duration_s: float

    def share(self, age_s: float) -> float:
        """Return what part of the velocity is there."""
        return min(age_s / self.duration_s, 1.0)


@dataclass(frozen=True)
class Sine(Disturbance):
    """A velocity that swings; `velocity_mps` is the amplitude."""

    period_s: float
    phase_rad: float = 0.0

    def share(self, age_s: float) -> float:
        """Return what part of the amplitude is there."""
        return math.sin(math.tau * age_s / self.period_s + self.phase_rad)


@dataclass(frozen=True)
class Intensity:
    """Of turbulence: rms velocities in m/s and scale lengths in m, each forward, right and down."""

    sigma_mps: tuple[float, float, float]
    length_m: tuple[float, float, float]


@dataclass(frozen=True)
class Turbulence(Passing):
    """Continuous random gusts of Dryden's form."""

    intensity: Intensity | float
    """As given, or the mean wind in m/s at 6 m above ground, from which MIL-F-8785C has those of low altitude."""

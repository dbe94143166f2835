"""Velocities that the air adds to vehicles besides the constant wind, as functions of time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from airlink.identity import VehicleId


@dataclass(frozen=True)
class Passing:
    """A disturbance of some vehicles between two mission times."""

    at_s: float
    until_s: float
    vehicles: frozenset[VehicleId]

    def acts(self, mission_s: float) -> bool:
        """Return whether it acts at a mission time."""
        return self.at_s <= mission_s < self.until_s


@dataclass(frozen=True)
class Disturbance(Passing):
    """A step: a velocity in m/s, north, east and down."""

    velocity_mps: tuple[float, float, float]

    def share(self, age_s: float) -> float:  # noqa: ARG002 - a step has no age
        """Return the share of `velocity_mps` that acts `age_s` after the beginning."""
        return 1.0


@dataclass(frozen=True)
class Ramp(Disturbance):
    """A velocity that grows linearly over `duration_s`, then stays."""

    duration_s: float

    def share(self, age_s: float) -> float:
        """Return the share of `velocity_mps` that acts."""
        return min(age_s / self.duration_s, 1.0)


@dataclass(frozen=True)
class Sine(Disturbance):
    """A sinusoidal velocity; `velocity_mps` is its amplitude."""

    period_s: float
    phase_rad: float = 0.0

    def share(self, age_s: float) -> float:
        """Return the share of the amplitude that acts, -1 to 1."""
        return math.sin(math.tau * age_s / self.period_s + self.phase_rad)


@dataclass(frozen=True)
class Intensity:
    """Intensity of turbulence: rms velocities in m/s and scale lengths in m, each forward, right and down."""

    sigma_mps: tuple[float, float, float]
    length_m: tuple[float, float, float]


@dataclass(frozen=True)
class Turbulence(Passing):
    """Continuous random gusts with Dryden's spectra."""

    intensity: Intensity | float
    """Explicit, or the mean wind in m/s 6 m above ground, from which MIL-F-8785C derives it for low altitude."""

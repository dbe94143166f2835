"""A turn of the leader on the spot: the heading that it is commanded, over time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from airlink.clock import Instant, seconds_between
from flight_model.path_offsets import minimum_jerk
from flight_model.stops.turning import MIN_S, turn_s

NOSE_TAU_S: Final = 0.44
"""Time constant of a multirotor's yaw: as observed in ArduCopter's and PX4's simulators. Tuned: s;
0.2 to 0.8; shown by flights of ArduCopter's and PX4's simulators."""


@dataclass(frozen=True)
class TurnOnSpot:
    """A turn of the heading on the spot, minimum-jerk and at rest at both ends."""

    begin_rad: float
    by_rad: float
    """Clockwise positive."""
    begun: Instant
    duration_s: float

    @classmethod
    def to(
        cls, heading_rad: float, from_rad: float, now: Instant, reach_m: float, speed_mps: float, accel_mps2: float
    ) -> TurnOnSpot:
        """Return the shorter turn, slow enough for slots up to `reach_m` away to follow within these limits."""
        by_rad = math.remainder(heading_rad - from_rad, math.tau)
        return cls(from_rad, by_rad, now, turn_s(by_rad, reach_m, speed_mps, accel_mps2))

    @property
    def goal_rad(self) -> float:
        """The final heading."""
        return self.begin_rad + self.by_rad

    def over(self, at: Instant) -> bool:
        """Whether the turn is complete, also for followers, which face as their slots swing until then."""
        return seconds_between(self.begun, at) >= self.duration_s + MIN_S

    def setpoint(self, at: int, tau_s: float) -> tuple[float, float]:
        """Return the heading setpoint at an instant (ns) by a heading time constant, and its rate, rad/s."""
        elapsed_s = seconds_between(self.begun, Instant(at))
        share, rate, change = minimum_jerk(min(max(elapsed_s / self.duration_s, 0.0), 1.0))
        rate, change = rate * self.by_rad / self.duration_s, change * self.by_rad / self.duration_s**2
        return self.begin_rad + share * self.by_rad + tau_s * rate, rate + tau_s * change

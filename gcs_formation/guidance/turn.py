"""A turn on the spot: the leader of multirotors that stand turns its nose, and its slots with it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from airlink.clock import Instant, seconds_between
from flight_model.displacement import PEAK_CHANGE, PEAK_RATE, minimum_jerk

SHARE = 0.5
"""Of speed and acceleration, that slots use in a turn; the rest is left to the law."""
NOSE_RADPS = 0.5
"""Fastest turn: noses come round at 1 rad/s."""
LEAST_S = 2.0


@dataclass(frozen=True)
class TurnOnSpot:
    """A direction that comes round from one to another, at rest at both ends, with the least jerk."""

    begin_rad: float
    by_rad: float
    """Clockwise positive."""
    begun: Instant
    duration_s: float

    @classmethod
    def to(
        cls, heading_rad: float, from_rad: float, now: Instant, reach_m: float, speed_mps: float, accel_mps2: float
    ) -> TurnOnSpot:
        """Return the shorter way round, no faster than slots up to `reach_m` away can follow within these limits."""
        by_rad = math.remainder(heading_rad - from_rad, math.tau)
        size_rad, reach_m = abs(by_rad), max(reach_m, 1.0)
        most_radps = min(NOSE_RADPS, SHARE * speed_mps / reach_m, math.sqrt(SHARE * accel_mps2 / reach_m))
        duration_s = max(
            LEAST_S, PEAK_RATE * size_rad / most_radps, math.sqrt(PEAK_CHANGE * size_rad * reach_m / SHARE / accel_mps2)
        )
        return cls(from_rad, by_rad, now, duration_s)

    @classmethod
    def done(cls, heading_rad: float, now: Instant) -> TurnOnSpot:
        """Return one that is over."""
        return cls(heading_rad, 0.0, now, LEAST_S)

    @property
    def goal_rad(self) -> float:
        """Where it ends."""
        return self.begin_rad + self.by_rad

    def setpoint(self, at: int, lag_s: float) -> tuple[float, float]:
        """Return the heading to tell at an instant (ns) to what follows with a lag, and how fast that turns, rad/s."""
        elapsed_s = seconds_between(self.begun, Instant(at))
        share, rate, change = minimum_jerk(min(max(elapsed_s / self.duration_s, 0.0), 1.0))
        rate, change = rate * self.by_rad / self.duration_s, change * self.by_rad / self.duration_s**2
        return self.begin_rad + share * self.by_rad + lag_s * rate, rate + lag_s * change

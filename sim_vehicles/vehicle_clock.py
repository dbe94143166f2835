"""A vehicle's own clock: from its own boot, at its own rate."""

from __future__ import annotations

from dataclasses import dataclass

from airlink.clock import NANOSECONDS, Instant


@dataclass
class VehicleClock:
    """Nanoseconds since boot, off by `offset_s` and running `1 + drift` times as fast as true time."""

    booted: Instant
    offset_s: float = 0.0
    drift: float = 0.0

    def nanoseconds(self, now: Instant) -> int:
        """Return what the clock shows at `now`, in ns."""
        elapsed = now - self.booted
        return elapsed + round(elapsed * self.drift + self.offset_s * NANOSECONDS)

    def seconds(self, now: Instant) -> float:
        """Return what the clock shows at `now`, in s."""
        return self.nanoseconds(now) / NANOSECONDS

"""A vehicle's own clock, from its own boot at its own rate, and its main loop's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from airlink.clock import NANOSECONDS, Instant, nanoseconds, rounded

LOOP_HZ: Final = 50
"""Rate of ArduPlane's main loop, on which it flies, reads and sends."""
LOOP_S: Final = 1.0 / LOOP_HZ
NEVER: Final = Instant(2**62 - 1)
"""Later than any instant of a run."""


class VehicleClock:
    """Nanoseconds since boot, off by `offset_s` and running `1 + drift` times as fast as true time."""

    __slots__ = ("booted", "drift", "offset_s")

    def __init__(self, booted: Instant, offset_s: float = 0.0, drift: float = 0.0) -> None:
        """Start at an instant."""
        self.booted = booted
        self.offset_s = offset_s
        self.drift = drift

    def nanoseconds(self, now: Instant) -> int:
        """Return what the clock shows at `now`, in ns."""
        elapsed = now - self.booted
        return elapsed + rounded(elapsed * self.drift + self.offset_s * NANOSECONDS)

    def began_ns(self) -> int:
        """Return the instant, ns, at which the clock would have shown 0."""
        return self.booted - nanoseconds(self.offset_s / (1.0 + self.drift))

    def seconds(self, now: Instant) -> float:
        """Return what the clock shows at `now`, in s."""
        return self.nanoseconds(now) / NANOSECONDS


@dataclass
class UtcClock:
    """UTC by a vehicle's own clock, as ArduPilot keeps it (AP_RTC).

    While disarmed it is set by the receiver, but never back; armed, it runs on the vehicle's own clock alone. A fast
    clock, which the receiver would have to put back, is set at boot only.
    """

    clock: VehicleClock
    at_0_us: int
    """True UTC at instant 0, microseconds since 1970."""
    error_s: float | None
    """Error of the receiver's UTC; None: there is no receiver, and UTC stays at the time since boot."""

    def __post_init__(self) -> None:
        """Take UTC at boot, when the clock showed 0."""
        self._ahead_ns = 0 if self.error_s is None else self._received_ns(self.clock.began_ns())

    def set_by_receiver(self, now: Instant) -> None:
        """Set it forwards, by its receiver."""
        if self.error_s is not None:
            self._ahead_ns = max(self._ahead_ns, self._received_ns(now) - self.clock.nanoseconds(now))

    def microseconds(self, now: Instant) -> int:
        """Return UTC in microseconds since 1970."""
        return (self.clock.nanoseconds(now) + self._ahead_ns) // 1000

    def _received_ns(self, now: int) -> int:
        return self.at_0_us * 1000 + now + nanoseconds(self.error_s or 0.0)

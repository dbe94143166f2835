"""A vehicle's own clock, with its own boot time and rate, and its main loop's rate."""

from __future__ import annotations

from typing import Final

from airlink.clock import NANOSECONDS, NEVER, Instant, after, nanoseconds, rounded

LOOP_HZ: Final = 50
"""Rate of an emulated autopilot's main loop, as ArduPlane's; it flies, reads and sends in this loop."""
LOOP_S: Final = 1.0 / LOOP_HZ


def delayed(now: Instant, delay_s: float) -> Instant:
    """Return when a delay ends; never if it is 0 or less, which disables it in autopilots' parameters."""
    return after(now, delay_s) if delay_s > 0.0 else NEVER


class BoardClock:
    """Time since boot, off by `offset_s` and running `1 + drift` times as fast as true time, and UTC derived from it.

    UTC is kept as in ArduPilot (AP_RTC): the receiver sets it while disarmed, but only forwards; while armed, it runs
    on the vehicle's own clock. A fast clock, which would have to be set back, is therefore set at boot only.
    """

    def __init__(self, booted: Instant, offset_s: float, drift: float, utc_at_0_us: int, error_s: float | None) -> None:
        """Start at an instant.

        Args:
            booted: the instant.
            offset_s: time shown then, s.
            drift: rate relative to true time, minus 1.
            utc_at_0_us: true UTC at instant 0, microseconds since 1970.
            error_s: error of the receiver's UTC, s; None: there is no receiver, and UTC is the time since boot.
        """
        self.booted = booted
        self.offset_s = offset_s
        self.drift = drift
        self._at_0_ns = utc_at_0_us * 1000
        self._error_s = error_s
        began_ns = booted - nanoseconds(offset_s / (1.0 + drift))  # when it would have shown 0
        self._ahead_ns = 0 if error_s is None else self._received_ns(began_ns)

    def nanoseconds(self, now: Instant) -> int:
        """Return the time shown at `now`, in ns."""
        elapsed = now - self.booted
        return elapsed + rounded(elapsed * self.drift + self.offset_s * NANOSECONDS)

    def seconds(self, now: Instant) -> float:
        """Return the time shown at `now`, in s."""
        return self.nanoseconds(now) / NANOSECONDS

    def set_by_receiver(self, now: Instant) -> None:
        """Set UTC from the receiver, forwards only."""
        if self._error_s is not None:
            self._ahead_ns = max(self._ahead_ns, self._received_ns(now) - self.nanoseconds(now))

    def utc_us(self, now: Instant) -> int:
        """Return UTC in microseconds since 1970."""
        return (self.nanoseconds(now) + self._ahead_ns) // 1000

    def _received_ns(self, now: int) -> int:
        return self._at_0_ns + now + nanoseconds(self._error_s or 0.0)

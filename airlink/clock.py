"""Instants, and the clocks that give them. Only drivers read a clock; engines are passed `now`.

Elsewhere only `airlink.driver` (to pace itself) and `airlink.cli` (to name directories) read the machine's clocks.
"""

from __future__ import annotations

import math
import time
from typing import Final, NewType, Self

Instant = NewType("Instant", int)
"""Nanoseconds since the epoch of the run's clock."""

NANOSECONDS: Final = 1_000_000_000
NEVER: Final = Instant(2**62 - 1)
"""Later than any instant of a run."""
LONG_AGO: Final = Instant(-(2**62))
"""Earlier than any."""
HALF: Final = 0.5
EXACT: Final = 2.0**51
EVEN: Final = 1.5 * 2.0**52
"""Adding and subtracting it rounds a number, ties to even: between 2^52 and 2^53 doubles are 1 apart."""
MICROSECONDS: Final = 1_000_000
VIRTUAL_EPOCH_US: Final = 1_577_836_800 * MICROSECONDS
"""2020-01-01 00:00 UTC, at which every virtual clock begins."""


def after(instant: Instant, seconds: float) -> Instant:
    """Return the instant that lies `seconds` after `instant`."""
    return Instant(instant + nanoseconds(seconds))


def nanoseconds(seconds: float) -> int:
    """Return a time in whole nanoseconds."""
    return rounded(seconds * NANOSECONDS)


def rounded(value: float) -> int:
    """Return `round(value)`, which compiled code would call Python for."""
    if -EXACT < value < EXACT:
        return int(value + EVEN - EVEN)
    below = math.floor(value)
    above = value - below
    return below if above < HALF or (above == HALF and below % 2 == 0) else below + 1


def seconds_between(earlier: Instant, later: Instant) -> float:
    """Return the seconds from `earlier` to `later`; negative if `later` is the earlier one."""
    return (later - earlier) / NANOSECONDS


class VirtualClock:
    """A clock that is held until its owner moves it."""

    def __init__(self) -> None:
        """Start at instant 0."""
        self._now = Instant(0)

    @property
    def utc_at_0_us(self) -> int:
        """UTC at instant 0, microseconds since 1970: the same in every run."""
        return VIRTUAL_EPOCH_US

    def now(self) -> Instant:
        """Return the instant that the clock was last moved to."""
        return self._now

    def move_to(self, instant: Instant) -> None:
        """Move the clock; it never goes back."""
        self._now = max(self._now, instant)


class RealClock:
    """The machine's monotonic clock, run `speedup` times faster from `origin_ns` on.

    Processes that are given the same origin and speed-up share their instants: CLOCK_MONOTONIC is
    the same for every process of a machine.
    """

    def __init__(self, speedup: float = 1.0, origin_ns: int | None = None) -> None:
        """Count from `origin_ns` of the monotonic clock, from this moment when it's None."""
        self.speedup = speedup
        self.origin_ns = time.monotonic_ns() if origin_ns is None else origin_ns

    @classmethod
    def from_utc(cls, utc_at_0_us: int, speedup: float) -> Self:
        """Return the clock that was at instant 0 at a time, microseconds since 1970."""
        return cls(speedup, time.monotonic_ns() - (time.time_ns() - utc_at_0_us * 1000))

    @classmethod
    def at(cls, instant: Instant, speedup: float = 1.0) -> Self:
        """Return the clock that is at an instant now."""
        return cls(speedup, time.monotonic_ns() - math.ceil(instant / speedup))

    @property
    def utc_at_0_us(self) -> int:
        """UTC at instant 0 by the machine's clock, microseconds since 1970."""
        return (time.time_ns() - (time.monotonic_ns() - self.origin_ns)) // 1000

    def now(self) -> Instant:
        """Return the present instant."""
        return Instant(int((time.monotonic_ns() - self.origin_ns) * self.speedup))

    def wall_seconds_until(self, instant: Instant) -> float:
        """Return how long the machine has to wait for `instant`; 0 when it has passed."""
        return max(0.0, seconds_between(self.now(), instant) / self.speedup)


Clock = VirtualClock | RealClock
"""What gives a run its instants."""


class Stopwatch:
    """Time since its creation, for display and statistics of a run; nothing in flight depends on it."""

    def __init__(self) -> None:
        """Start."""
        self._wall_s, self._cpu_s = time.perf_counter(), time.thread_time()

    @property
    def wall_s(self) -> float:
        """Wall time, s."""
        return time.perf_counter() - self._wall_s

    @property
    def cpu_s(self) -> float:
        """Processor time of the calling thread, s."""
        return time.thread_time() - self._cpu_s

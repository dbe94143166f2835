"""Whether late control ticks spoilt a flight: its loop then wasn't the one that the scenario and its margins name."""

from __future__ import annotations

from flight_model.arrays import Array

LATE_S = 0.010
"""A tick that begins more than this after it was due is late."""
SPOILT_SHARE = 0.01
"""Share of late ticks above which a flight says so; on an idle machine it is below 0.001. Simulated PX4s on a machine
that made 1.5 % of the ticks late swung by 4 m about their slots, and looked half as slow again as they are."""
SPOILT_RATE = 0.95
"""Share of `law.rate_hz` below which the mean rate of the ticks is said, too: late ones take the place of others."""


def late_ticks(ticks_s: Array) -> int:
    """Return the number of late ticks; `ticks_s` (2 or more, K): when each was due and when it began, s."""
    return int((ticks_s[1] - ticks_s[0] > LATE_S).sum())


def lateness(ticks_s: Array, rate_hz: float) -> str | None:
    """Return in words how late ticks spoilt a flight, None if they hardly did.

    Args:
        ticks_s: (2 or more, K) when each tick was due and when it began, s.
        rate_hz: `law.rate_hz`.
    """
    due_s, begun_s = ticks_s[:2]
    count, late = int(begun_s.size), late_ticks(ticks_s)
    if count < 2:
        return None
    flown_hz = (count - 1) / float(begun_s[-1] - begun_s[0])
    slow = flown_hz < SPOILT_RATE * rate_hz
    if late <= SPOILT_SHARE * count and not slow:
        return None
    rate = f"{flown_hz:.3g} a second instead of {rate_hz:g}" if slow else f"{rate_hz:g} a second on average"
    latest_s = float((begun_s - due_s).max())
    return (
        f"late ticks: {late} of {count} began more than {LATE_S * 1e3:g} ms late, by up to {latest_s:.2g} s, and there "
        f"were {rate}: errors and delays are those of a loop that was held up, not of law.rate_hz {rate_hz:g}"
    )

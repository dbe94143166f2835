"""Which part of a window of mission time was judged: one rule for gaps in a record.

Ticks come late on a busy machine, a station may be killed and resumed, a vehicle leads for a while and then follows.
Up to `UNJUDGED_GAP_S` without a row, anywhere in a window, its ends included, count as judged, if at least half of the
window's rows exist. Longer gaps aren't judged; of a record with fewer rows, only these are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flight_model.arrays import Array
from formation_scenario.expectation import JUDGED_SHARE, LATE_PERIODS, UNJUDGED_GAP_S

HALF = 0.5
ROUNDING = 1e-6


@dataclass(frozen=True)
class Coverage:
    """How much of a window was judged."""

    share: float
    """From 0 to 1."""
    gap_s: tuple[float, float] | None
    """Begin and end of the longest part without rows that isn't judged; None if there is none."""
    rows: int
    expected: int
    """Number of rows in the window, and how many there are without a late tick."""

    @property
    def enough(self) -> bool:
        """Whether a verdict stands for the whole window."""
        return self.share >= JUDGED_SHARE - ROUNDING

    def __str__(self) -> str:
        """Return in words what is missing; "" if nothing is."""
        if self.gap_s is not None:
            return f"not recorded from {self.gap_s[0]:.1f} s to {self.gap_s[1]:.1f} s"
        return "" if self.share >= 1.0 - ROUNDING else f"recorded at {self.rows} of {self.expected} ticks"


def coverage(times_s: Array, from_s: float, to_s: float, period_s: float, gap_s: float = UNJUDGED_GAP_S) -> Coverage:
    """Return how much of a window is judged by rows at some times.

    Args:
        times_s: (N,) ascending mission times of the rows, all of them in the window.
        from_s: the window's begin.
        to_s: its end, not before that.
        period_s: time between rows, if none is late.
        gap_s: longest time without a row that counts as judged.
    """
    whole_s, rows = to_s - from_s, int(times_s.size)
    expected = max(1, math.floor(whole_s / period_s + ROUNDING))
    edges_s = np.concatenate(([from_s], times_s, [to_s]))
    intervals_s = np.diff(edges_s)
    gaps = intervals_s > gap_s + period_s + ROUNDING
    longest = int(intervals_s.argmax())
    gap = (float(edges_s[longest]), float(edges_s[longest + 1])) if gaps.any() else None
    judged_s = whole_s - float(intervals_s[gaps].sum()) if rows and rows >= HALF * expected else rows * period_s
    share = judged_s / whole_s if whole_s > 0.0 else float(rows > 0)
    return Coverage(min(1.0, max(0.0, share)), gap, rows, expected)


def scored_end_s(times_s: Array, duration_s: float, period_s: float) -> float:
    """Return to which mission time a flight was flown, at most `duration_s`; minus infinity if it didn't begin.

    It is that of the last row up to `duration_s`, unless a late tick hides the end: a later row then shows that the
    flight went on.

    Args:
        times_s: (N,) ascending mission times of all rows on the path.
        duration_s: when the flight was to end.
        period_s: time between rows, if none is late.
    """
    scored_s = times_s[times_s <= duration_s + 1e-9]
    last_s = float(scored_s[-1]) if scored_s.size else -math.inf
    late = scored_s.size < times_s.size and duration_s - last_s > LATE_PERIODS * period_s
    return duration_s if late else last_s

"""A vehicle's clock from the shortest, and the longest, delays, where these have a sharp bound.

The mean of n delays is known to sigma/sqrt(n). Where many delays lie close to the smallest possible one, as behind a
queue that is mostly empty (Pareto) or where a radio waits for its turn (uniform), that bound is known to a few times
1/(n f), f: the density of the delays at the bound, 1/s. Then clock and bound are found together: of all rates of the
clock, the one for which the fastest requests and the fastest answers together are slowest, that is the narrowest
corridor that holds all delays. Where longest delays are bounded too, both edges count. Sources: Moon, Skelly, Towsley,
"Estimation and removal of clock skew from network delay measurements" (INFOCOM 1999); Johnson, "Estimation of location
for a nonregular density" (the 1/n rate).
"""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

CAPACITY: Final = 2048
"""Round trips kept; when they are full the older half goes. Tuned: round trips; 1024 to 8192; shown by `python -m
benchmarks.clock_limits`."""
FEWEST: Final = 64
"""Fewest round trips of which edges are found. Tuned: round trips; 32 to 128; shown by `python -m
benchmarks.clock_limits`."""
NEW: Final = 32
"""The edges are found again after so small a share more of round trips. Tuned: 1/share; 16 to 64; shown by `pytest
tests/gcs_formation/link`."""
BLOCK: Final = 16
"""Of so many consecutive delays one can lie on an edge. Tuned: delays; 8 to 32; shown by `python -m
benchmarks.clock_limits`."""
SHARP: Final = 2.8
"""Of delays with a sharp bound a quarter lies within four times the distance from it within which a sixteenth does; of
normal ones within 1.5 to 1.8 times the distance from the smallest. Tuned: ratio; 2.4 to 3.4; shown by `python -m
benchmarks.clock_limits`."""
PROMISING: Final = 2.2
"""The same by a line along the means, which blurs the edges, or of the longest where the shortest are sharp. Tuned:
ratio; 1.9 to below `SHARP`; shown by `python -m benchmarks.clock_limits`."""
MAX_DRIFT: Final = 3e-4
"""Largest drift of a clock for which edges are searched. Tuned: a number; 1e-4 to 1e-3; shown by `pytest
tests/gcs_formation/link`."""
ITERATIONS: Final = 28
GOLDEN: Final = (math.sqrt(5.0) - 1.0) / 2.0
LEVER: Final = 3.6
"""How much less certain the end of a line along the lower edges is than an edge of known slope. Tuned: ratio; 3 to 5;
shown by `python -m benchmarks.clock_limits`."""
LEVER_BOTH: Final = 2.0
"""The end of a line along the lower edges, or along both, is this much less certain than an edge of known slope. Tuned:
ratio; 1.5 to 3; shown by `python -m benchmarks.clock_limits`."""


class _Edge:
    """The candidates for one edge: of each `BLOCK` of consecutive delays the shortest, or the longest."""

    def __init__(self, sign: float, slope: float) -> None:
        """`sign`: 1 for the shortest, -1 for the longest; `slope`: of the delays, in multiples of the clock's drift."""
        self._sign: float = sign
        self._slope: float = slope
        self._at = vec[float]([0.0] * (CAPACITY // BLOCK))
        self._delays = vec[float]([0.0] * (CAPACITY // BLOCK))
        self._count: i64 = 0

    def collect(self, at_s: vec[float], delays_s: vec[float], count: i64, drift: float) -> None:
        """Find the candidates among delays; a roughly known drift is enough."""
        slope, sign, self._count = self._slope * drift, self._sign, 0
        for begin in range(0, count, BLOCK):
            best, best_s = begin, math.inf
            for index in range(begin, min(begin + BLOCK, count)):
                value_s = sign * (delays_s[index] - slope * at_s[index])
                if value_s < best_s:
                    best, best_s = index, value_s
            self._at[self._count], self._delays[self._count] = at_s[best], delays_s[best]
            self._count += 1

    def bound_s(self, drift: float, now_s: float) -> float:
        """Return the edge's delay now, for a drift, times `sign`."""
        slope, sign, min_s = self._slope * drift, self._sign, math.inf
        for index in range(self._count):
            min_s = min(min_s, sign * (self._delays[index] + slope * (now_s - self._at[index])))
        return min_s


class DelayEdges:
    """The recent delays of one link, up and down, with the clock's offset in them, and the line through their edges."""

    def __init__(self, loop_s: float) -> None:
        """Start without round trips; `loop_s`: period of the loop that answers, a wait that is part of the delay up."""
        self._loop_s: float = loop_s
        self.offset_s: float = 0.0
        """The vehicle's clock minus ours at the newest round trip, less the offset that is subtracted from all."""
        self.drift: float = 0.0
        self.deviation_s: float = 0.0
        """Standard deviation of the offset, roughly."""
        self.span_s: float = 0.0
        """Time between the oldest and the newest round trip."""
        self._at = vec[float]([0.0] * CAPACITY)
        self._up = vec[float]([0.0] * CAPACITY)
        self._down = vec[float]([0.0] * CAPACITY)
        self._each = vec[float]([0.0] * CAPACITY)
        self._count: i64 = 0
        self._new: i64 = 0
        self._now_s: float = 0.0
        self._fastest_up, self._fastest_down = _Edge(1.0, 1.0), _Edge(1.0, -1.0)
        self._slowest_up, self._slowest_down = _Edge(-1.0, 1.0), _Edge(-1.0, -1.0)

    def clear(self) -> None:
        """Forget all: the link, or the clock, is another."""
        self._count = self._new = 0

    def add(self, at_s: float, up_s: float, down_s: float) -> bool:
        """Take when a request was sent, the vehicle's clock minus that, and the arrival minus the vehicle's clock.

        Return whether it is time to find the edges again.
        """
        if self._count == CAPACITY:
            self._forget_half()
        index = self._count
        self._at[index], self._up[index], self._down[index] = at_s, up_s, down_s
        self._count = index + 1
        self._new += 1
        if self._count < FEWEST or self._new < self._count // NEW:
            return False
        self._new = 0
        return True

    def _forget_half(self) -> None:
        half = CAPACITY // 2
        for index in range(half):
            self._at[index], self._up[index] = self._at[half + index], self._up[half + index]
            self._down[index] = self._down[half + index]
        self._count = half

    def find(self, drift: float) -> bool:
        """Find the narrowest corridor; return whether its edges are sharp: `offset_s` and the others are then of now.

        `drift`: the clock's as far as it is known.
        """
        self._now_s = self._at[self._count - 1]
        near_s, far_s = self._spread_s(drift, 1.0)
        if far_s < PROMISING * near_s:
            return False
        self._collect_fastest(drift)
        found = self._narrowest(both=False)
        near_s, far_s = self._spread_s(found, 1.0)
        if far_s < SHARP * near_s:
            return False
        longest_near_s, longest_far_s = self._spread_s(found, -1.0)
        both = longest_far_s > PROMISING * longest_near_s
        if both:
            self._collect_fastest(found)
            self._slowest_up.collect(self._at, self._up, self._count, found)
            self._slowest_down.collect(self._at, self._down, self._count, found)
            found = self._narrowest(both=True)
        self._draw(found, both=both)
        # Within `near_s` of the two edges lie a sixteenth of the delays each.
        lever = LEVER_BOTH if both else LEVER
        self.deviation_s = lever * near_s / 2.0 / float(self._count // 16) / math.sqrt(2.0)
        return True

    def _collect_fastest(self, drift: float) -> None:
        self._fastest_up.collect(self._at, self._up, self._count, drift)
        self._fastest_down.collect(self._at, self._down, self._count, drift)

    def _draw(self, drift: float, *, both: bool) -> None:
        now_s = self._now_s
        offset_s = (self._fastest_up.bound_s(drift, now_s) - self._fastest_down.bound_s(drift, now_s)) / 2.0
        if both:
            longest_s = self._slowest_down.bound_s(drift, now_s) - self._slowest_up.bound_s(drift, now_s)
            offset_s = (offset_s + longest_s / 2.0) / 2.0 - self._loop_s / 4.0
        self.offset_s, self.drift, self.span_s = offset_s, drift, now_s - self._at[0]

    def _narrowest(self, *, both: bool) -> float:
        """Return the drift for which the corridor is narrowest: its width is a convex function of it."""
        low, high = -MAX_DRIFT, MAX_DRIFT
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        left_s, right_s = self._inside_s(left, both=both), self._inside_s(right, both=both)
        for _ in range(ITERATIONS):
            if left_s < right_s:
                low, left, left_s = left, right, right_s
                right = low + GOLDEN * (high - low)
                right_s = self._inside_s(right, both=both)
            else:
                high, right, right_s = right, left, left_s
                left = high - GOLDEN * (high - low)
                left_s = self._inside_s(left, both=both)
        return (low + high) / 2.0

    def _inside_s(self, drift: float, *, both: bool) -> float:
        """Return the shortest round trip that the edges allow, with `both` minus the longest, s."""
        now_s = self._now_s
        inside_s = self._fastest_up.bound_s(drift, now_s) + self._fastest_down.bound_s(drift, now_s)
        if both:
            inside_s += self._slowest_up.bound_s(drift, now_s) + self._slowest_down.bound_s(drift, now_s)
        return inside_s

    def _spread_s(self, drift: float, sign: float) -> tuple[float, float]:
        """Return how far from the edge a sixteenth of each direction's delays lie, and a quarter, summed, s.

        `sign`: 1 for the shortest delays, -1 for the longest.
        """
        up_s, up_near_s, up_far_s = self._from_edge(self._up, drift, sign)
        down_s, down_near_s, down_far_s = self._from_edge(self._down, -drift, sign)
        return up_near_s - up_s + down_near_s - down_s, up_far_s - up_s + down_far_s - down_s

    def _from_edge(self, delays_s: vec[float], slope: float, sign: float) -> tuple[float, float, float]:
        """Return the smallest of `sign` times the delays without a slope, and those after a sixteenth and a quarter."""
        each, few = self._each, self._count // 16
        for index in range(self._count):
            each[index] = sign * (delays_s[index] - slope * self._at[index])
        far_s = ranked(each, self._count, 4 * few)
        near_s = ranked(each, 4 * few + 1, few)
        return ranked(each, few + 1, 0), near_s, far_s


def ranked(values: vec[float], count: i64, rank: i64) -> float:
    """Return which of the first `count` values has a rank, 0 the smallest; those before it are moved to its left.

    Hoare, "Algorithm 65: Find", Communications of the ACM 4 (1961).
    """
    left, right = i64(0), count - 1
    while left < right:
        pivot, low, high = values[rank], left, right
        while low <= high:
            while values[low] < pivot:
                low += 1
            while pivot < values[high]:
                high -= 1
            if low <= high:
                values[low], values[high] = values[high], values[low]
                low += 1
                high -= 1
        if high < rank:
            left = low
        if rank < low:
            right = high
    return values[rank]

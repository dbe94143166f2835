"""The recent round trips of one link: their mean, median and jitter, and whether the link's delay has just stepped."""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from flight_model.autopilot_model import squared

WINDOW: Final = 16
"""Number of recent round trips (4 s) that are kept for the minimum, mean and standard deviation. Tuned: round trips; 8
to 40; shown by `pytest tests/gcs_formation/link`."""
STEPPED: Final = 8
"""The link's delay has stepped once this many consecutive round trips (2 s) are far (`FAR`) from the earlier ones.
Tuned: round trips; 4 to 16; shown by `python -m benchmarks.latency_grid`."""
FAR: Final = 4.0
"""Groups of round trips are far apart if their medians differ by more than this multiple of their summed jitter. Tuned:
ratio; 3 to 6; shown by `pytest tests/gcs_formation/link`."""
NORMAL: Final = 1.4826
"""Ratio of standard deviation to median absolute deviation, for normally distributed noise."""


class RoundTripWindow:
    """The last `WINDOW` round trips; those before a step of the link's delay are dropped."""

    def __init__(self) -> None:
        """Start without any."""
        self._recent, self.count = vec[float]([0.0] * WINDOW), i64(0)
        """The recent round trips, oldest first, and their number."""
        self._off = vec[float]([0.0] * WINDOW)
        """Innovations of the samples of these round trips: sample minus prediction."""
        self._sorted = vec[float]([0.0] * WINDOW)
        self.stepped = False
        """Whether the last one showed a step, before which the others were dropped."""

    @property
    def jitter_s(self) -> float:
        """Standard deviation of the recent round trips."""
        recent, count, mean_s, total = self._recent, self.count, self.mean_s, 0.0
        if count < 2:
            return 0.0
        for index in range(count):
            total += squared(recent[index] - mean_s)
        return math.sqrt(total / (float(count) - 1.0))

    @property
    def usual_jitter_s(self) -> float:
        """Robust standard deviation of the recent round trips: a few outliers don't affect it."""
        return min(self.jitter_s, self._usual_jitter_s(self.count))

    def _usual_jitter_s(self, count: i64) -> float:
        """Return the standard deviation of the first `count` round trips by their median absolute deviation."""
        middle_s, each = self._median_s(0, count), self._sorted
        for index in range(count):
            each[index] = abs(each[index] - middle_s)
        return NORMAL * _median(each, count)

    @property
    def median_s(self) -> float:
        """Median of the recent round trips."""
        return self._median_s(0, self.count)

    def _median_s(self, begin: i64, end: i64) -> float:
        """Return the median of the recent round trips [begin, end); `_sorted` then holds them in order."""
        return self._median_of(self._recent, begin, end)

    def _median_of(self, values: vec[float], begin: i64, end: i64) -> float:
        each = self._sorted
        for index in range(begin, end):
            each[index - begin] = values[index]
        return _median(each, end - begin)

    def add(self, round_trip_s: float, off_s: float) -> float:
        """Store a round trip and its sample's innovation.

        Return the step of the samples if the link's delay has just stepped, 0 if not, or if both ways stepped alike.
        """
        recent, off, count = self._recent, self._off, self.count
        if count == WINDOW:
            count -= 1
            for index in range(count):
                recent[index], off[index] = recent[index + 1], off[index + 1]
        recent[count], off[count] = round_trip_s, off_s
        self.count = count + 1
        known = self.count == WINDOW  # a full window: the first requests may have been delayed by anything
        self.stepped = self._forget_before_step()
        if not self.stepped or not known:
            return 0.0
        step_s = self._median_of(off, 0, STEPPED)
        return step_s if abs(step_s) > self._usual_jitter_s(STEPPED) else 0.0

    def _forget_before_step(self) -> bool:
        """Drop the round trips before the last `STEPPED` if their medians are far apart; return whether they were."""
        recent, since = self._recent, self.count - STEPPED
        if since <= 0:
            return False
        near_s = FAR * _range(recent, since, self.count)
        if _range(recent, 0, self.count) <= near_s:
            return False  # the usual case: the total range is too small for a step
        difference_s = abs(self._median_s(since, self.count) - self._median_s(0, since))
        stepped = difference_s > near_s and difference_s > near_s + FAR * self._usual_jitter_s(since)
        if stepped:
            for index in range(STEPPED):
                recent[index], self._off[index] = recent[since + index], self._off[since + index]
            self.count = STEPPED
        return stepped

    @property
    def mean_s(self) -> float:
        """Mean of the recent round trips; NaN before the first."""
        recent, count, total = self._recent, self.count, 0.0
        for index in range(count):
            total += recent[index]
        return total / float(count) if count else math.nan


def _range(values: vec[float], begin: i64, end: i64) -> float:
    """Return the range (maximum minus minimum) of values[begin:end]."""
    smallest = largest = values[begin]
    for index in range(begin, end):
        smallest, largest = min(smallest, values[index]), max(largest, values[index])
    return largest - smallest


def _median(values: vec[float], count: i64) -> float:
    """Return the median of the first `count` values, 0 if there are none; sorts them in place."""
    for end in range(1, count):
        value, index = values[end], end
        while index > 0 and values[index - 1] > value:
            values[index] = values[index - 1]
            index -= 1
        values[index] = value
    middle = count // 2
    if count % 2:
        return values[middle]
    return (values[middle - 1] + values[middle]) / 2.0 if count else 0.0

"""Recorded delays: when each was measured, and how long it took."""

from __future__ import annotations

import math
from itertools import pairwise
from statistics import fmean, median
from typing import Final, NamedTuple

from formation_scenario.fields import FileError
from formation_scenario.impairment_types import MAX_MS

STEADY: Final = 0.75
"""Share of the intervals that have to be about as long as usual, so that longer ones show missing samples."""
ABOUT: Final = 0.3


class Sample(NamedTuple):
    """A measurement."""

    line: int
    time_s: float
    """When it was sent; NaN if the record doesn't say."""
    delay_ms: float
    """NaN: lost."""


class RecordedDelays(NamedTuple):
    """A record, from its beginning; in one direction."""

    times_s: tuple[float, ...]
    delays_ms: tuple[float, ...]
    """NaN: lost."""
    period_s: float
    """Usual time between two."""
    gaps: bool
    """Whether longer times between two show that samples are missing, which were lost."""
    timed: bool
    """Whether the record says when it was measured; if not, a period was assumed."""

    @property
    def arrived_ms(self) -> list[float]:
        """The delays of what wasn't lost."""
        return [each for each in self.delays_ms if not math.isnan(each)]

    @property
    def mean_ms(self) -> float:
        """Mean of what wasn't lost."""
        return fmean(self.arrived_ms)

    @property
    def loss(self) -> float:
        """Share of the time in which everything is lost, 0 to 1."""
        length_s = self.times_s[-1] + self.period_s
        lost_s = self.period_s * sum(math.isnan(each) for each in self.delays_ms)
        if self.gaps:
            steps_s = (after - before for before, after in pairwise(self.times_s))
            lost_s += sum(step_s - self.period_s for step_s in steps_s if step_s > 1.5 * self.period_s)
        return min(lost_s / length_s, 1.0)


def recorded(name: str, samples: list[Sample], *, round_trip: bool, period_s: float | None) -> RecordedDelays:
    """Return samples as a record.

    Args:
        name: of the file.
        samples: in the file's order; either all have a time or none.
        round_trip: whether their delays are of both directions together.
        period_s: time between two where they have none; None: not known.

    Raises:
        FileError: nothing arrived, a delay is out of range, or times go back.
    """
    for line, _, delay_ms in samples:
        if not math.isnan(delay_ms) and not 0.0 <= delay_ms <= MAX_MS:
            raise FileError(f"found a delay of {delay_ms:g} ms at {name}:{line}")
    if all(math.isnan(each.delay_ms) for each in samples):
        raise FileError(f"found {name} without a delay in it")
    share = 0.5 if round_trip else 1.0
    delays_ms = tuple(share * each.delay_ms for each in samples)
    if math.isnan(samples[0].time_s):
        step_s = 1.0 if period_s is None else period_s
        times_s = tuple(step_s * number for number in range(len(samples)))
        return RecordedDelays(times_s, delays_ms, step_s, gaps=False, timed=period_s is not None)
    spread_s = _spread(name, samples)
    return RecordedDelays(spread_s, delays_ms, *_rhythm(spread_s), timed=True)


def _spread(name: str, samples: list[Sample]) -> tuple[float, ...]:
    """Return the times from 0 on; several samples with one time, which was rounded, are spread up to the next one."""
    zero_s, starts = samples[0].time_s, [0]
    for index in range(1, len(samples)):
        if samples[index].time_s < samples[index - 1].time_s:
            raise FileError(f"found a time before the one above it at {name}:{samples[index].line}")
        if samples[index].time_s > samples[index - 1].time_s:
            starts.append(index)
    if len(starts) == 1 and len(samples) > 1:
        raise FileError(f"found {name}, in which time doesn't advance")
    times_s = list[float]()
    for index, start in enumerate(starts):
        following = starts[index + 1] if index + 1 < len(starts) else len(samples)
        begin_s = samples[start].time_s - zero_s
        whole_s = samples[following].time_s - zero_s - begin_s if following < len(samples) else 0.0
        if whole_s == 0.0 and index > 0:
            whole_s = begin_s - (samples[starts[index - 1]].time_s - zero_s)
        count = following - start
        times_s += [begin_s + (whole_s * number / count if count > 1 else 0.0) for number in range(count)]
    return tuple(times_s)


def _rhythm(times_s: tuple[float, ...]) -> tuple[float, bool]:
    """Return the usual time between two samples, and whether they are steady, so that others are missing."""
    if len(times_s) == 1:
        return 1.0, False
    steps_s = [after - before for before, after in pairwise(times_s)]
    usual_s = median(steps_s)
    near = sum(abs(step_s - usual_s) <= ABOUT * usual_s for step_s in steps_s)
    return usual_s, near >= STEADY * len(steps_s)

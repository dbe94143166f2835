"""Recorded delays, played by time: a datagram takes as long as one did that was sent when the record was as old.

Between two samples the delay is interpolated, so that a recorded queue drains no faster than it did: held until the
next sample, delays of datagrams that keep their order would be longer than recorded. Jitter, of which one sample tells
nothing of the next, has a variance of two thirds of the recorded one then, and datagrams of one interval have similar
delays; where delays are `drawn`, each is that of one of the samples around it instead. A datagram is lost if the sample
nearest in time was lost, or if the nearest is further away than half a period. The record begins with the run, unless
another part of it is to come first, and is repeated from its beginning.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import Final

from airlink.clock import NANOSECONDS, Instant
from airlink.random_streams import random_stream

AROUND: Final = 5
"""Samples before and after an instant of which one is drawn: of a survey's ten a second, those of half a second."""
LONG: Final = 1.5
"""Periods between two samples from which on samples are missing in between."""


class Trace:
    """A process of a link (`airlink.impairment.Process`)."""

    def __init__(
        self,
        times_s: Sequence[float],
        delays_s: Sequence[float],
        period_s: float,
        *,
        gaps: bool,
        begin_s: float = 0.0,
        drawn: bool = False,
    ) -> None:
        """Take when each sample was sent, from 0 on and increasing, and how long it took; NaN: it was lost.

        Args:
            times_s: (N,), N > 0.
            delays_s: (N,).
            period_s: usual time between two samples, and from the last one to the repetition.
            gaps: whether samples are missing where `times_s` are further apart than usual.
            begin_s: how far into the record the run begins.
            drawn: whether delays between two samples are drawn from these, and not interpolated.
        """
        self._random = random_stream(1, "traces") if drawn else None
        self._begin_s = begin_s
        self._length_s = times_s[-1] + period_s
        self._times_s = [*times_s, self._length_s]
        self._delays_s = [*delays_s, delays_s[0]]
        self._half_s = period_s / 2.0
        self._long_s = LONG * period_s if gaps else math.inf

    def __call__(self, size_bytes: int, now: Instant) -> float | None:  # noqa: ARG002 - as any process's
        """Return the delay of a datagram sent at `now`, whatever its size, s; None: it is lost."""
        return self.delay_s(now)

    def delay_s(self, now: Instant) -> float | None:
        """Return the delay of a datagram sent at `now`, s; None: it is lost."""
        at_s = (now / NANOSECONDS + self._begin_s) % self._length_s
        index = bisect_right(self._times_s, at_s, 0, len(self._times_s) - 1) - 1
        since_s, until_s = at_s - self._times_s[index], self._times_s[index + 1] - at_s
        before_s, after_s = self._delays_s[index], self._delays_s[index + 1]
        nearest_s = before_s if since_s <= until_s else after_s
        missing = since_s + until_s > self._long_s and min(since_s, until_s) > self._half_s
        if math.isnan(nearest_s) or missing:
            return None
        if self._random is not None:
            around_s = self._delays_s[max(0, index + 1 - AROUND) : index + 1 + AROUND]
            known_s = [each for each in around_s if not math.isnan(each)]
            return known_s[int(self._random.random() * len(known_s))]
        if math.isnan(before_s + after_s) or since_s + until_s > self._long_s:
            return nearest_s
        return before_s + (after_s - before_s) * since_s / (since_s + until_s)

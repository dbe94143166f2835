"""Probing of what a link carries, with the user's consent: more and more requests until it is full.

Every request is answered by a message of its size, so that both ways carry the same at once. A step counts as carried
while nine in ten are answered that would be without load, and take little longer than at the first step: by `LATER_S`,
or by what datagrams that keep their order wait for each other's jitter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from statistics import median, pstdev
from typing import Final

from airlink.clock import Instant, after, seconds_between
from airlink.messages import Message
from airlink.messages.system import Timesync

STEP_S: Final = 3.0
PAUSE_S: Final = 2.0
"""After each step, for what waits in queues."""
TICK_S: Final = 0.02
FIRST_KBPS: Final = 4.0
FACTOR: Final = 1.4
BITS: Final = 8 * 28
"""Size of a request's frame."""
CARRIED: Final = 0.9
LATER_S: Final = 0.05
LATER_SIGMAS: Final = 4.0
"""Or this multiple of the first step's standard deviation, if that is more."""


class LoadStep:
    """One rate, and what came back of it by link."""

    def __init__(self, kbps: float, begins: Instant) -> None:
        """Begin at an instant."""
        self.kbps, self.begins = kbps, begins
        self.asked, self.trips_s = dict[tuple[int, int], int](), dict[tuple[int, int], list[float]]()


class Load:
    """Sends requests at rising rates, and judges which were carried."""

    def __init__(self, max_kbps: float, begins: Instant) -> None:
        """Plan steps from `FIRST_KBPS` to `max_kbps`."""
        rates, kbps = list[float](), min(FIRST_KBPS, max_kbps)
        while kbps < max_kbps:
            rates.append(kbps)
            kbps *= FACTOR
        rates.append(max_kbps)
        self.max_kbps = max_kbps
        self._steps = [
            LoadStep(each, after(begins, PAUSE_S + number * (STEP_S + PAUSE_S))) for number, each in enumerate(rates)
        ]
        self._next, self._sent, self._index = self._steps[0].begins, 0, 0
        self._pending = dict[int, tuple[int, Instant]]()
        self.over = after(self._steps[-1].begins, STEP_S + PAUSE_S)

    def next_timer(self) -> Instant:
        """Return when the next requests are due."""
        return self._next

    def requests(self, now: Instant) -> Iterator[Message]:
        """Yield the requests that are due now."""
        step = self._steps[self._index]
        since_s = seconds_between(step.begins, now)
        if since_s >= STEP_S:
            self._index, self._sent = min(self._index + 1, len(self._steps) - 1), 0
            last = step is self._steps[-1]
            self._next = after(self.over, 1.0) if last else self._steps[self._index].begins
            return
        due = math.floor(since_s * step.kbps * 1e3 / BITS) + 1
        for number in range(self._sent, due):
            stamp = now + number  # each of another nanosecond, by which its answer is recognised
            self._pending[stamp] = (self._index, now)
            yield Timesync(0, stamp)
        self._sent, self._next = due, after(now, TICK_S)

    def sent(self, key: tuple[int, int]) -> None:
        """Count a request sent over a link."""
        asked = self._steps[self._index].asked
        asked[key] = asked.get(key, 0) + 1

    def receive(self, key: tuple[int, int], message: Message | None, now: Instant) -> None:
        """Take a message, which may be an answer."""
        if isinstance(message, Timesync) and message.ts1_ns in self._pending:
            index, sent = self._pending[message.ts1_ns]
            self._steps[index].trips_s.setdefault(key, []).append(seconds_between(sent, now))

    def carried_kbps(self, key: tuple[int, int], loss: float) -> tuple[float, bool] | None:
        """Return the highest rate that a link carried each way, and whether it was full above; None: not loaded.

        `loss`: of round trips without load.
        """
        best, latest_s = None, math.nan
        for step in self._steps:
            asked, trips_s = step.asked.get(key, 0), step.trips_s.get(key, [])
            if not asked:
                continue
            if not trips_s or len(trips_s) < CARRIED * (1.0 - loss) * asked:
                return best or 0.0, True
            middle_s = median(trips_s)
            if math.isnan(latest_s):
                latest_s = middle_s + max(LATER_S, LATER_SIGMAS * pstdev(trips_s))
            if middle_s > latest_s:
                return best or 0.0, True
            best = step.kbps
        return None if best is None else (best, False)

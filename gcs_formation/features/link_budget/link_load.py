# Compiled by mypyc: it runs every tick.

"""Whether one vehicle's link is full: what its radio says, how long messages wait, and what is lost.

A queue that never empties shows in the shortest of recent round trips (RFC 8289, "Controlled Delay Active Queue
Management"), which jitter doesn't lengthen. A longer link alone does, so something must be lost besides, or round trips
must go on becoming longer. A radio's free buffer tells by itself; below 20 % ArduPilot, too, slows its streams down.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from typing import Final, NamedTuple

from airlink.clock import Instant, after, seconds_between
from gcs_formation.vehicle.vehicle import Vehicle

WINDOW: Final = 5
"""Number of looks, one a second, over which losses are counted. Tuned: s; 4 to 10; shown by `pytest
tests/gcs_formation/features/link_budget`."""
KEPT: Final = 8
"""Number of looks kept before these, for what was asked a round trip earlier. Tuned: s; the longest round trip and
more, 5 to 20; by judgement."""
RECENT_S: Final = 5.0
"""Time over which the shortest round trip is taken, of at least as many as `FEWEST`. Tuned: s; 3 to 10; shown by
`pytest tests/gcs_formation/features/link_budget`."""
FEWEST: Final = 4
"""Fewest round trips over which the shortest is taken. Tuned: round trips; 3 to 10; shown by `pytest
tests/gcs_formation/features/link_budget`."""
QUEUE_S: Final = 0.2
"""Round trips that are all longer by this than the shortest ever wait in a queue. Tuned: s; 0.1 to 0.5; shown by
`pytest tests/gcs_formation/features/link_budget`."""
GROWS_S: Final = 0.2
"""A queue grows if the shortest round trip is longer at each of `WINDOW` looks, and by this in all of them. A link
whose delay takes a step is longer at one or two. Tuned: s; 0.1 to 0.5; shown by `pytest
tests/gcs_formation/features/link_budget`."""
LOST: Final = 0.15
"""Share lost one way beyond which a link with a queue is full. Tuned: share; 0.1 to 0.3; shown by `pytest
tests/gcs_formation/features/link_budget`."""
LOW_PERCENT: Final = 20.0
"""Free share of a radio's buffer below which it is nearly full. Tuned: %; 10 to 30; shown by `pytest
tests/gcs_formation/features/link_budget`."""
LOW_REPORTS: Final = 2
"""A buffer is full that has had less free for this many looks. Tuned: reports; 1 to 4; shown by `pytest
tests/gcs_formation/features/link_budget`."""


class Counts(NamedTuple):
    """What has been counted up to a look."""

    at: Instant
    received: int
    lost: int
    due: float
    """Number of requests made so long ago that their answers are due."""
    answers: int
    bytes_in: int
    bytes_out: int


class LinkLoad:
    """What shows how full one vehicle's link is."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Start with nothing known."""
        self._vehicle, self._sequence = vehicle, vehicle.sequence
        self._looks = deque[Counts](maxlen=WINDOW + 1)
        self._asked = deque[tuple[Instant, int]](maxlen=KEPT + 1)
        """Numbers of requests up to the last looks."""
        self._shortest_s = math.inf
        """The shortest round trip so far."""
        self._queues_s = deque[float](maxlen=WINDOW + 1)
        """The time spent in queues at the last looks."""
        self._low = 0
        """For how many looks the buffer has been low."""
        self.queue_s, self.lost_up, self.lost_down = 0.0, 0.0, 0.0
        """Time spent in queues, there and back, s; shares lost up and down."""
        self.free_percent: float | None = None
        """Free share of the radio's buffer, None if no radio tells."""
        self.bytes_per_s = 0.0
        """What the link carries both ways."""

    def look(self, now: Instant, free_percent: float | None) -> None:
        """Take what has been counted; to be called once a second."""
        vehicle, sequence = self._vehicle, self._vehicle.sequence
        if self._sequence is not sequence:  # another link is in use
            self._sequence = sequence
            self.settle()
            self.clear()
        self.free_percent = free_percent
        self._low = self._low + 1 if free_percent is not None and free_percent <= LOW_PERCENT else 0
        shortest_s = vehicle.round_trips.shortest_s(after(now, -RECENT_S), FEWEST)
        if not math.isnan(shortest_s):
            self._shortest_s = min(self._shortest_s, shortest_s)
            self.queue_s = shortest_s - self._shortest_s
        self._queues_s.append(self.queue_s)
        self._asked.append((now, sequence.asked))
        self._looks.append(
            Counts(
                now,
                sequence.received,
                sequence.lost,
                self._due(now),
                sequence.answers,
                vehicle.bytes_in,
                vehicle.bytes_out,
            )
        )
        self._compare(self._looks[0], self._looks[-1])

    def _due(self, now: Instant) -> float:
        """Return how many requests were made up to a round trip ago, the longest of the recent ones.

        Where the link has just become longer, answers to the others are under way, and not lost.
        """
        trip_s = self._vehicle.round_trips.longest_s(after(now, -RECENT_S))
        at = now if math.isnan(trip_s) else after(now, -trip_s)
        later, count = now, self._asked[-1][1]
        for earlier, before in reversed(self._asked):
            if earlier <= at:
                share = seconds_between(earlier, at) / seconds_between(earlier, later) if later > earlier else 0.0
                return before + share * (count - before)
            later, count = earlier, before
        return float(count)

    def _compare(self, first: Counts, last: Counts) -> None:
        received, lost = last.received - first.received, max(last.lost - first.lost, 0)
        due, answers = last.due - first.due, last.answers - first.answers
        self.lost_down = lost / (received + lost) if received + lost else 0.0
        answered = answers / due / (1.0 - self.lost_down) if due > 0.0 and self.lost_down < 1.0 else 1.0
        self.lost_up = max(0.0, 1.0 - answered)
        over_s = seconds_between(first.at, last.at)
        if over_s > 0.0:
            sent = (last.bytes_out - first.bytes_out) * (1.0 - self.lost_up)
            self.bytes_per_s = (last.bytes_in - first.bytes_in + sent) / over_s

    def settle(self) -> None:
        """Reset the counts of losses: another load is tried."""
        self._looks.clear()
        self._queues_s.clear()

    def clear(self) -> None:
        """Take the present round trips for those of an empty link."""
        self._shortest_s, self.queue_s, self._low = math.inf, 0.0, 0

    @property
    def lost(self) -> float:
        """Share lost up or down, whichever is more."""
        return max(self.lost_up, self.lost_down)

    @property
    def full(self) -> bool:
        """Whether the link carries no more."""
        loses = self.lost > LOST
        waits = self.queue_s > QUEUE_S and len(self._looks) > WINDOW
        return self._low >= LOW_REPORTS or (waits and (loses or self._grows))

    @property
    def _grows(self) -> bool:
        queues_s = list(self._queues_s)
        longer = all(now_s > before_s for before_s, now_s in pairwise(queues_s))
        return len(queues_s) > WINDOW and longer and queues_s[-1] - queues_s[0] > GROWS_S

    @property
    def words(self) -> str:
        """What shows it, in words."""
        waiting = (
            f"messages wait for {self.queue_s:.1f} s, {self.lost_up:.0%} are lost up and {self.lost_down:.0%} down"
        )
        free = "" if self.free_percent is None else f", {self.free_percent:.0f} % of the radio's buffer are free"
        return f"{waiting}{free}"

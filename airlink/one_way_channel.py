"""One direction of one link: when each datagram that is sent over it arrives, if it does."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink.clock import Instant, after, seconds_between
from airlink.impairment import UNIMPAIRED, Impairment

BLOCK: Final = 256
"""Number of datagrams whose random numbers are drawn together."""
DRAWS: Final = 4
"""Random numbers that a datagram can need: for its loss, its duplication, and the delays of both copies."""


class ChannelStatistics:
    """Counts of a channel so far."""

    def __init__(self) -> None:
        """Start at 0."""
        self.datagrams: int = 0
        """Datagrams sent."""
        self.lost: int = 0
        self.delivered: int = 0
        """Datagrams that arrived, counting both copies of duplicated ones."""
        self.total_delay_s: float = 0.0

    def add(self, other: ChannelStatistics) -> None:
        """Add another channel's counts."""
        self.datagrams += other.datagrams
        self.lost += other.lost
        self.delivered += other.delivered
        self.total_delay_s += other.total_delay_s

    @property
    def loss(self) -> float:
        """Share of the datagrams that were lost, 0 to 1."""
        return self.lost / self.datagrams if self.datagrams else 0.0

    @property
    def mean_delay_s(self) -> float:
        """Mean delay of those that arrived, s, including the wait for the limited rate; NaN if none did."""
        return self.total_delay_s / self.delivered if self.delivered else math.nan


class Channel:
    """One direction of one link.

    The n-th datagram always uses the n-th random numbers of the stream, whatever the impairment, so runs that
    differ only in an impairment can be compared datagram by datagram.
    """

    def __init__(self, stream: np.random.Generator) -> None:
        """Draw from `stream`."""
        self.statistics = ChannelStatistics()
        self._random = stream
        self._draws: list[float] = []
        """Random numbers of the present block of datagrams."""
        self._drawn = 0
        self._lost_last = False
        self._busy_until = Instant(0)
        self._last_delivery = Instant(0)
        self._follow(UNIMPAIRED)

    def _follow(self, impairment: Impairment) -> None:
        """Impair what is sent from now on so; its numbers are kept, for they are needed for every datagram."""
        self._impairment, self._transparent = impairment, impairment.transparent
        self._loss_after_arrival, self._loss_after_loss = impairment.loss_after
        self._delays, self._process = impairment.delays, impairment.process
        self._outage, self._reorder, self._duplicate = impairment.outage, impairment.reorder, impairment.duplicate
        self._rate_bps, self._queue_s = impairment.rate_bps, impairment.queue_s

    def lose(self) -> None:
        """Count a datagram that was dropped before it came here."""
        self.statistics.datagrams += 1
        self.statistics.lost += 1

    def pass_on(
        self, size_bytes: int, now: Instant, impairment: Impairment, before_s: float = 0.0, after_s: float = 0.0
    ) -> list[Instant]:
        """Take a datagram at `now`; return when it is delivered: never, once or twice.

        `before_s`: how long it has been under way by now; `after_s`: further delay. Both count as its delay.
        """
        if impairment is not self._impairment:
            self._follow(impairment)
        statistics = self.statistics
        number = statistics.datagrams
        statistics.datagrams = number + 1
        if self._transparent:
            self._lost_last = False
            deliveries = [max(after(now, after_s), self._last_delivery)]
        else:
            deliveries = self._impaired(number, size_bytes, now, after_s)
        if not deliveries:
            statistics.lost += 1
            return deliveries
        statistics.delivered += len(deliveries)
        total_s = 0.0
        for delivery in deliveries:
            total_s += before_s + seconds_between(now, delivery)
            self._last_delivery = max(self._last_delivery, delivery)
        statistics.total_delay_s += total_s
        return deliveries

    def _impaired(self, number: int, size_bytes: int, now: Instant, more_s: float) -> list[Instant]:
        while number >= self._drawn:
            self._draws = self._random.random(BLOCK * DRAWS).tolist()
            self._drawn += BLOCK
        draws = self._draws
        own = (number - self._drawn + BLOCK) * DRAWS
        loss = self._loss_after_loss if self._lost_last else self._loss_after_arrival
        self._lost_last = draws[own] < loss
        departure = self._departure(size_bytes, now)
        if self._outage or self._lost_last or departure is None:
            return []
        process = self._process
        if process is not None:
            found_s = process(size_bytes, now)
            if found_s is None:
                return []
            more_s += found_s
        first = self._arrival(after(departure, self._delays.quantile_s(draws[own + 2]) + more_s))
        if draws[own + 1] >= self._duplicate:
            return [first]
        second = self._arrival(after(departure, self._delays.quantile_s(draws[own + 3]) + more_s))
        return [min(first, second), max(first, second)]

    def _arrival(self, alone: Instant) -> Instant:
        """Return when a datagram arrives that would do so `alone`: behind those before it, if none overtakes."""
        return alone if self._reorder else max(alone, self._last_delivery)

    def _departure(self, size_bytes: int, now: Instant) -> Instant | None:
        """Return when the last bit has been sent, None if the queue is full."""
        if self._rate_bps == 0.0 or self._outage:
            return now
        start = max(now, self._busy_until)
        if seconds_between(now, start) > self._queue_s:
            return None
        self._busy_until = after(start, 8 * size_bytes / self._rate_bps)
        return self._busy_until

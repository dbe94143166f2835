"""Relays datagrams between remotes and a target through impaired channels. Pure: no socket, no clock."""

from __future__ import annotations

from typing import NamedTuple

from airlink.clock import Instant
from airlink.delay_queue import DelayQueue
from airlink.identity import VehicleId
from airlink.impairment import UNIMPAIRED, Channel, ChannelStatistics, Direction, Impairment, link_stream

_NETWORK = 1


class Passage(NamedTuple):
    """A datagram of one remote, in transit in one direction."""

    remote: int
    direction: Direction
    data: bytes


class Relay:
    """Impairs the links of remotes, numbered from 0; the present settings apply to all of them."""

    def __init__(self, seed: int) -> None:
        """Start with unimpaired links; remote r has the random numbers of vehicle r + 1 on network 1."""
        self.impairments: dict[Direction, Impairment] = dict.fromkeys(Direction, UNIMPAIRED)
        self._seed = seed
        self._channels: dict[tuple[int, Direction], Channel] = {}
        self._under_way = DelayQueue[Passage]()

    def accept(self, passage: Passage, now: Instant) -> None:
        """Send a datagram on its way."""
        key = (passage.remote, passage.direction)
        channel = self._channels.get(key)
        if channel is None:
            vehicle = VehicleId(_NETWORK, passage.remote + 1)
            channel = self._channels[key] = Channel(link_stream(self._seed, vehicle, passage.direction))
        for delivery in channel.pass_on(len(passage.data), now, self.impairments[passage.direction]):
            self._under_way.push(delivery, passage)

    def pop_due(self, now: Instant) -> list[Passage]:
        """Remove and return what has arrived by `now`."""
        return self._under_way.pop_due(now)

    def next_timer(self) -> Instant | None:
        """Return when the next datagram arrives, None if none is in transit."""
        return self._under_way.next()

    def statistics(self, direction: Direction) -> ChannelStatistics:
        """Return the statistics of one direction, summed over all remotes."""
        total = ChannelStatistics()
        for (_, of_direction), channel in self._channels.items():
            if of_direction is direction:
                total.datagrams += channel.statistics.datagrams
                total.lost += channel.statistics.lost
                total.delivered += channel.statistics.delivered
                total.total_delay_s += channel.statistics.total_delay_s
        return total

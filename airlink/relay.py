"""An impaired relay without sockets: what passes it in either direction, and when."""

from __future__ import annotations

from functools import partial
from typing import Final

from airlink.clock import Instant, after, seconds_between
from airlink.delay_record import DelayRecord
from airlink.engine import DelayQueue
from airlink.impairment import UNIMPAIRED, Direction, Impairment
from airlink.one_way_channel import Channel, ChannelStatistics
from airlink.radio.settings import RadioSettings
from airlink.radio.shared_radio import SharedRadio
from airlink.random_streams import random_stream
from airlink.telemetry_faults.passing import AlteredStream, LinkFault

NETWORK: Final = 1
"""Remotes use the random numbers of this network's vehicles."""


Passage = tuple[int, Direction, bytes]
"""A datagram of one remote, in transit in one direction."""


class Relay:
    """Impairs the links of remotes, numbered from 0, all by the same settings, and all behind one radio if given."""

    record: DelayRecord | None = None
    """Takes the delays of all datagrams."""
    faults: tuple[LinkFault, ...] = ()
    """Of the telemetry that passes."""

    def __init__(self, seed: int, radio: RadioSettings | None = None) -> None:
        """Start with unimpaired links; remote r has the random numbers of vehicle r + 1 on network 1."""
        self.radio = None if radio is None else SharedRadio[Passage](radio, seed)
        self.impairments: dict[Direction, Impairment] = dict.fromkeys(Direction, UNIMPAIRED)
        self._seed = seed
        self._channels: dict[tuple[int, Direction], Channel] = {}
        self._forgotten = {direction: ChannelStatistics() for direction in Direction}
        self._altered, self._began = dict[int, AlteredStream](), Instant(-1)
        self._newest = Instant(0)
        self._late = DelayQueue[Passage]()
        """What a fault sends later."""
        self.under_way = DelayQueue[Passage]()

    def accept(self, passage: Passage, now: Instant) -> None:
        """Put a datagram, altered by the faults of telemetry, into the radio if there is one, else into its channel."""
        remote, direction, data = passage
        self._newest = now
        if direction is Direction.UPLINK:
            self._carry(passage, now)
            return
        self._began = now if self._began < 0 else self._began
        if not self.faults:
            self._carry(passage, now)
            return
        for later_s, altered in self._stream(remote).pass_on(data, self.faults, self._began, now):
            if later_s > 0.0:
                self._late.push(after(now, later_s), (remote, direction, altered))
            else:
                self._carry((remote, direction, altered), now)

    @property
    def elapsed_s(self) -> float:
        """Time from the first datagram from any vehicle to the newest datagram, s; 0 before."""
        return 0.0 if self._began < 0 else seconds_between(self._began, self._newest)

    def _stream(self, remote: int) -> AlteredStream:
        known = self._altered.get(remote)
        if known is None:
            draws = partial(random_stream, self._seed, "telemetry faults", remote + 1)
            known = self._altered[remote] = AlteredStream(draws)
        return known

    def _carry(self, passage: Passage, now: Instant) -> None:
        """Put a datagram into the radio, if there is one, or else into its channel."""
        remote, direction, data = passage
        channel = self._channel(remote, direction)
        if self.record is not None and direction is Direction.DOWNLINK:
            self.record.came(remote, data, now)
        if self.radio is not None:
            self._move_radio_to(self.radio, now)
            if not self.radio.offer(direction, _vehicle(remote), len(data), passage, now):
                channel.lose()
                self._record(direction, now, [])
            return
        deliveries = channel.pass_on(len(data), now, self.impairments[direction])
        self._record(direction, now, deliveries)
        for delivery in deliveries:
            self.under_way.push(delivery, passage)

    def next_timer(self) -> Instant | None:
        """Return when the next datagram is due or the radio has something to do; None if never."""
        timers = [self.under_way.next(), self._late.next(), None if self.radio is None else self.radio.next_timer()]
        return min((each for each in timers if each is not None), default=None)

    def pop_due(self, now: Instant) -> list[Passage]:
        """Remove and return the datagrams that arrive by now, and what the radio's ends report."""
        for passage in self._late.pop_due(now):
            self._carry(passage, now)
        if self.radio is not None:
            self._move_radio_to(self.radio, now)
        due = self.under_way.pop_due(now)
        if self.record is not None:
            for remote, direction, data in due:
                if direction is Direction.UPLINK:
                    self.record.sent_on(remote, data, now)
        if self.radio is not None and self.radio.report_due(now):
            report, remotes = self.radio.ground_report(), {remote for remote, _ in self._channels}
            due += [(remote, Direction.DOWNLINK, report) for remote in sorted(remotes)]
            due += [(each, Direction.UPLINK, self.radio.vehicle_report(_vehicle(each))) for each in sorted(remotes)]
        return due

    def _record(self, direction: Direction, entered: Instant, deliveries: list[Instant]) -> None:
        if self.record is not None:
            self.record.carried(direction, entered, seconds_between(entered, deliveries[0]) if deliveries else None)

    def _channel(self, remote: int, direction: Direction) -> Channel:
        channel = self._channels.get((remote, direction))
        if channel is None:
            stream = random_stream(self._seed, "links", NETWORK, remote + 1, direction)
            channel = self._channels[remote, direction] = Channel(stream)
        return channel

    def _move_radio_to(self, radio: SharedRadio[Passage], now: Instant) -> None:
        """Let what the radio has sent by now pass the links behind it."""
        for sent in radio.passed(now):
            remote, direction, _ = sent.item
            channel, deliveries = self._channel(remote, direction), list[Instant]()
            if sent.air_s is None:
                channel.lose()
            else:
                impairment = self.impairments[direction]
                deliveries = channel.pass_on(sent.size_bytes, sent.left, impairment, sent.waited_s, sent.air_s)
            self._record(direction, after(sent.left, -sent.waited_s), deliveries)
            if not deliveries:
                radio.lose(sent.vehicle, direction)
            for delivery in deliveries:
                self.under_way.push(delivery, sent.item)

    def disconnect(self, remote: int) -> None:
        """Remove a remote, whose number isn't used again; its statistics are kept."""
        if self.radio is not None:
            self.radio.remove(_vehicle(remote))
        self._altered.pop(remote, None)
        self._late.drop(lambda _, passage: passage[0] == remote)
        for direction, total in self._forgotten.items():
            channel = self._channels.pop((remote, direction), None)
            if channel is not None:
                total.add(channel.statistics)

    def statistics(self, direction: Direction) -> ChannelStatistics:
        """Return the statistics of one direction, summed over all remotes."""
        total = ChannelStatistics()
        total.add(self._forgotten[direction])
        for (_, each), channel in self._channels.items():
            if each is direction:
                total.add(channel.statistics)
        return total


def _vehicle(remote: int) -> tuple[int, int]:
    """Return what distinguishes a remote from others, as for the random numbers of links."""
    return NETWORK, remote + 1

"""An impaired relay, and its shell: sockets, the real clock, and commands typed while it runs."""

from __future__ import annotations

import os
import selectors
import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import count
from typing import Final, Self

from airlink.clock import Instant, RealClock, after, seconds_between
from airlink.delay_record import DelayRecord
from airlink.driver import IDLE_WAIT_S, select_for
from airlink.endpoint import ANY_HOST, LOOPBACK, Address, Endpoint, EndpointError, PortError
from airlink.engine import DelayQueue
from airlink.impairment import UNIMPAIRED, Direction, Impairment
from airlink.one_way_channel import Channel, ChannelStatistics
from airlink.radio.settings import RadioSettings
from airlink.radio.shared_radio import SharedRadio
from airlink.random_streams import random_stream
from airlink.transports.udp import Inbox, open_socket, resolved

MAX_REMOTES: Final = 256
"""Most sockets towards the target. The longest silent remote is dropped first, so strangers can't use up sockets."""
READ_SIZE: Final = 4096
NETWORK: Final = 1
"""Remotes use the random numbers of this network's vehicles."""


Passage = tuple[int, Direction, bytes]
"""A datagram of one remote, in transit in one direction."""


class Relay:
    """Impairs the links of remotes, numbered from 0, all by the same settings, and all behind one radio if given."""

    record: DelayRecord | None = None
    """Takes the delays of all datagrams."""

    def __init__(self, seed: int, radio: RadioSettings | None = None) -> None:
        """Start with unimpaired links; remote r has the random numbers of vehicle r + 1 on network 1."""
        self.radio = None if radio is None else SharedRadio[Passage](radio, seed)
        self.impairments: dict[Direction, Impairment] = dict.fromkeys(Direction, UNIMPAIRED)
        self._seed = seed
        self._channels: dict[tuple[int, Direction], Channel] = {}
        self._forgotten = {way: ChannelStatistics() for way in Direction}
        self.under_way = DelayQueue[Passage]()

    def accept(self, passage: Passage, now: Instant) -> None:
        """Put a datagram into the radio, if there is one, or else into its channel."""
        remote, direction, data = passage
        channel = self._channel(remote, direction)
        if self.record is not None and direction is Direction.DOWNLINK:
            self.record.came(remote, data, now)
        if self.radio is not None:
            self._move_radio_to(self.radio, now)
            if not self.radio.offer(direction, _vehicle(remote), len(data), passage, now):
                channel.lose()
                self._note(direction, now, [])
            return
        deliveries = channel.pass_on(len(data), now, self.impairments[direction])
        self._note(direction, now, deliveries)
        for delivery in deliveries:
            self.under_way.push(delivery, passage)

    def next_timer(self) -> Instant | None:
        """Return when the next datagram is due or the radio has something to do; None if never."""
        timers = [self.under_way.next(), None if self.radio is None else self.radio.next_timer()]
        return min((each for each in timers if each is not None), default=None)

    def pop_due(self, now: Instant) -> list[Passage]:
        """Remove and return the datagrams that arrive by now, and what the radio's ends report."""
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

    def _note(self, direction: Direction, entered: Instant, deliveries: list[Instant]) -> None:
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
            self._note(direction, after(sent.left, -sent.waited_s), deliveries)
            if not deliveries:
                radio.lose(sent.vehicle, direction)
            for delivery in deliveries:
                self.under_way.push(delivery, sent.item)

    def forget(self, remote: int) -> None:
        """Remove a remote, whose number isn't used again; its statistics are kept."""
        if self.radio is not None:
            self.radio.forget(_vehicle(remote))
        for way, total in self._forgotten.items():
            channel = self._channels.pop((remote, way), None)
            if channel is not None:
                total.add(channel.statistics)

    def statistics(self, direction: Direction) -> ChannelStatistics:
        """Return the statistics of one direction, summed over all remotes."""
        total = ChannelStatistics()
        total.add(self._forgotten[direction])
        for (_, way), channel in self._channels.items():
            if way is direction:
                total.add(channel.statistics)
        return total


def _vehicle(remote: int) -> tuple[int, int]:
    """Return what tells a remote apart from others, as for the random numbers of links."""
    return NETWORK, remote + 1


class Proxy:
    """Moves datagrams between the remotes of one listening socket and a target.

    Each remote has a socket of its own towards the target, as behind a NAT.
    """

    def __init__(self, listen: Endpoint, target: Endpoint, relay: Relay) -> None:
        """Open the listening socket.

        Raises:
            PortError: it can't be opened, or the target's host isn't known.
            EndpointError: the target is that socket itself, so that every datagram would circulate for ever.
        """
        self._target = target
        self._target_address = resolved(target).address
        self._relay = relay
        self._clock = RealClock()
        self._remotes: dict[Address, int] = {}
        """Ordered by when they last sent."""
        self._peers: dict[int, Address] = {}
        self._sockets: dict[int, socket.socket] = {}
        """By remote; a new one gets a new number."""
        self._numbers = count()
        self._inbox = Inbox()
        self._selector = selectors.PollSelector()  # unlike epoll, it accepts any standard input
        self._listening = open_socket(listen)
        if _arrives_at(self._listening, self._target_address):
            self._listening.close()
            raise EndpointError(f"found {target}, where we listen ourselves; allowed: where a ground station listens")
        self._selector.register(self._listening, selectors.EVENT_READ, self._from_remotes)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for opened in (self._listening, *self._sockets.values()):
            opened.close()
        self._selector.close()

    def watch(self, descriptor: int, take: Callable[[bytes], None]) -> None:
        """Pass bytes read from a file descriptor to `take`, and empty bytes once at its end."""

        def read() -> None:
            try:
                data = os.read(descriptor, READ_SIZE)
            except OSError:  # the terminal has hung up
                data = b""
            if not data:
                self._selector.unregister(descriptor)
            take(data)

        self._selector.register(descriptor, selectors.EVENT_READ, read)

    def run(self, until: Callable[[], bool]) -> None:
        """Run until `until` holds; it is checked after every wake-up, at least ten times a second."""
        while not until():
            timer = self._relay.next_timer()
            wait_s = IDLE_WAIT_S if timer is None else min(self._clock.wall_seconds_until(timer), IDLE_WAIT_S)
            for key, _ in select_for(self._selector, wait_s):
                key.data()
            for passage in self._relay.pop_due(self._clock.now()):
                self._send(*passage)

    def _from_remotes(self) -> None:
        for datagram in self._inbox.take(self._listening):
            peer = datagram.peer
            remote = self._remotes.pop(peer, None)
            if remote is None:
                try:
                    remote = self._open_towards_target(peer)
                except (OSError, PortError):  # no route to the target: lost, as in any network
                    continue
            self._remotes[peer] = remote
            self._relay.accept((remote, Direction.DOWNLINK, datagram.data), self._clock.now())

    def _open_towards_target(self, peer: Address) -> int:
        opened = open_socket(self._target)
        try:
            opened.connect(self._target_address.pair)
        except OSError:
            opened.close()
            raise
        if len(self._remotes) == MAX_REMOTES:
            self._forget(next(iter(self._remotes)))
        remote = next(self._numbers)
        self._peers[remote], self._sockets[remote] = peer, opened
        self._selector.register(opened, selectors.EVENT_READ, partial(self._from_target, remote))
        return remote

    def _forget(self, peer: Address) -> None:
        """Remove a remote; its datagrams in flight are lost."""
        remote = self._remotes.pop(peer)
        opened = self._sockets.pop(remote)
        self._selector.unregister(opened)
        opened.close()
        del self._peers[remote]
        self._relay.forget(remote)

    def _from_target(self, remote: int) -> None:
        if remote not in self._sockets:  # removed after the selector reported its datagrams
            return
        for datagram in self._inbox.take(self._sockets[remote]):
            self._relay.accept((remote, Direction.UPLINK, datagram.data), self._clock.now())

    def _send(self, remote: int, direction: Direction, data: bytes) -> None:
        if remote not in self._sockets:
            return
        with suppress(OSError):  # unreachable, or a full buffer: lost, as in any network
            if direction is Direction.DOWNLINK:
                self._sockets[remote].send(data)
            else:
                self._listening.sendto(data, self._peers[remote].pair)


def _arrives_at(listening: socket.socket, target: Address) -> bool:
    """Return whether datagrams sent to a target arrive at our listening socket."""
    host, port = listening.getsockname()
    to_host = LOOPBACK if target.host == ANY_HOST else target.host
    return target.port == port and (to_host == host or (host == ANY_HOST and _is_ours(to_host)))


def _is_ours(host: str) -> bool:
    """Return whether an address is one of this machine's: only those can be bound."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((host, 0))
        except OSError:
            return False
    return True

"""The shell of an impaired relay: sockets, the real clock, and commands typed while it runs."""

from __future__ import annotations

import os
import selectors
import socket
import time
from collections.abc import Callable, Iterator
from itertools import count
from typing import Final, Self

from airlink.clock import RealClock
from airlink.driver import IDLE_WAIT_S, select_for
from airlink.endpoint import ANY_HOST, LOOPBACK, Address, AirlinkError, Endpoint, EndpointError, PortError
from airlink.engine import Datagram
from airlink.frame_pieces import Pieces
from airlink.impairment import Direction
from airlink.relay import Relay
from airlink.transports.opening import open_transport
from airlink.transports.transport import Transport
from airlink.transports.udp import DRAIN_LIMIT, Inbox, family_of, resolved

MAX_REMOTES: Final = 256
"""Most sockets towards the target. The longest silent remote is dropped first, so strangers can't use up sockets."""
READ_SIZE: Final = 4096
LISTENING: Final = -1
SHARED: Final = -2
"""Numbers of the transports that aren't a remote's own."""
OWN: Final = frozenset({"udpout", "tcp"})
"""Kinds of targets towards which each remote has an end of its own, as behind a NAT."""
STREAMS: Final = frozenset({"tcp", "tcpin", "serial"})


class Proxy:
    """Moves datagrams between the remotes at one end and a target at the other; both may be of any kind.

    Towards a target that has an address each remote has an end of its own, as behind a NAT. A serial line, a multicast
    group or a listening end is shared: what comes from there goes to every remote, each over its own impaired link. Of
    a stream whole frames pass, or are lost.
    """

    def __init__(self, listen: Endpoint, target: Endpoint, relay: Relay) -> None:
        """Open both ends.

        Raises:
            PortError: one can't be opened, or its host isn't known.
            EndpointError: the target is the other end itself, so that every datagram would circulate for ever.
        """
        self._listen, self._target = resolved(listen), _reached(resolved(target))
        if _arrives_at(self._listen, self._target):
            raise EndpointError(f"found {target}, where we listen ourselves; allowed: where a ground station listens")
        self._relay = relay
        self._clock = RealClock()
        self._remotes: dict[Address, int] = {}
        """Ordered by when they last sent."""
        self._peers: dict[int, Address] = {}
        """By remote; a new one gets a new number."""
        self._numbers = count()
        self._transports: dict[int, Transport] = {}
        """By remote, and those that all share."""
        self._targets: dict[Address, None] = {}
        """Who has been received at a shared target that listens."""
        self._pieces: dict[tuple[int, Address], Pieces] = {}
        self._inbox = Inbox()
        self._selector = selectors.PollSelector()  # unlike epoll, it accepts any standard input
        try:
            self._open(LISTENING, self._listen)
            if self._target.kind not in OWN:
                self._open(SHARED, self._target)
            if self._listen.peer is not None:  # it may wait for the target's first word
                self._add(self._listen.peer)
        except AirlinkError:
            self.__exit__()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for opened in self._transports.values():
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
            for each in self._transports.values():
                if each.maintained:
                    each.maintain(time.monotonic_ns())
            for key, _ in select_for(self._selector, wait_s):
                if callable(key.data):
                    key.data()
                else:
                    self._take(key.data)
            for passage in self._relay.pop_due(self._clock.now()):
                self._send(*passage)

    def _open(self, number: int, endpoint: Endpoint) -> None:
        opened = self._transports[number] = open_transport(endpoint, self._inbox)
        opened.register(self._selector, number)

    def _take(self, number: int) -> None:
        """Pass on what has arrived at one end."""
        opened = self._transports.get(number)
        if opened is None:  # removed after the selector reported its datagrams
            return
        endpoint = self._listen if number == LISTENING else self._target
        for datagram in opened.drain(0, DRAIN_LIMIT):
            if endpoint.kind == "udpout" and datagram.peer != endpoint.address:
                continue  # a stranger's
            for data in self._cut(number, endpoint, datagram):
                for remote, direction in self._links_of(number, datagram.peer):
                    self._relay.accept((remote, direction, data), self._clock.now())

    def _cut(self, number: int, endpoint: Endpoint, datagram: Datagram) -> list[bytes]:
        if endpoint.kind not in STREAMS:
            return [datagram.data]
        return self._pieces.setdefault((number, datagram.peer), Pieces()).cut(datagram.data)

    def _links_of(self, number: int, peer: Address) -> list[tuple[int, Direction]]:
        """Return over which links something goes that a peer has sent to one end."""
        if number == SHARED:
            self._receive_at_target(peer)
            return [(remote, Direction.UPLINK) for remote in self._remotes.values()]
        if number != LISTENING:
            return [(number, Direction.UPLINK)]
        remote = self._remotes.pop(peer, None)
        if remote is not None:
            self._remotes[peer] = remote
            return [(remote, Direction.DOWNLINK)]
        try:
            return [(self._add(peer), Direction.DOWNLINK)]
        except PortError:  # no socket is left: lost, as in any network
            return []

    def _receive_at_target(self, peer: Address) -> None:
        self._targets.pop(peer, None)
        self._targets[peer] = None
        if len(self._targets) > MAX_REMOTES:
            del self._targets[next(iter(self._targets))]

    def _add(self, peer: Address) -> int:
        """Return the number of a new remote."""
        if len(self._remotes) == MAX_REMOTES:
            self._forget(next(iter(self._remotes)))
        remote = next(self._numbers)
        if self._target.kind in OWN:
            self._open(remote, self._target)
        self._remotes[peer], self._peers[remote] = remote, peer
        return remote

    def _forget(self, peer: Address) -> None:
        """Remove a remote; its datagrams in flight are lost."""
        remote = self._remotes.pop(peer)
        del self._peers[remote]
        self._pieces = {each: pieces for each, pieces in self._pieces.items() if each[0] != remote and each[1] != peer}
        opened = self._transports.pop(remote, None)
        if opened is not None:
            for key in [each for each in self._selector.get_map().values() if each.data == remote]:
                self._selector.unregister(key.fileobj)
            opened.close()
        self._relay.disconnect(remote)

    def _send(self, remote: int, direction: Direction, data: bytes) -> None:
        if remote not in self._peers:
            return
        if direction is Direction.UPLINK:
            self._transports[LISTENING].send(data, self._peers[remote])
            return
        opened = self._transports.get(remote) or self._transports[SHARED]
        for peer in self._at_target():
            opened.send(data, peer)

    def _at_target(self) -> Iterator[Address]:
        """Yield whom something goes to at the target: its address, or who has been received there."""
        if self._target.peer is not None:
            yield self._target.peer
        else:
            yield from self._targets


def _reached(target: Endpoint) -> Endpoint:
    """Return a target with an address that answers come from: everywhere is here."""
    if target.kind in OWN and target.address.host == ANY_HOST:
        return Endpoint(target.kind, Address(LOOPBACK, target.address.port))
    return target


def _arrives_at(listen: Endpoint, target: Endpoint) -> bool:
    """Return whether what is sent to a target arrives at our own end."""
    pair = {listen.kind, target.kind}
    if pair not in ({"udpin", "udpout"}, {"tcpin", "tcp"}):
        return listen == target
    here, there = (each.address for each in ((listen, target) if listen.peer is None else (target, listen)))
    host, to_host = _number(here.host), _number(there.host)
    return there.port == here.port and (to_host == host or (host == ANY_HOST and _is_ours(to_host)))


def _number(host: str) -> str:
    """Return a host's address; the host itself, if that isn't known."""
    try:
        return host if ":" in host else socket.gethostbyname(host)
    except OSError:
        return host


def _is_ours(host: str) -> bool:
    """Return whether an address is one of this machine's: only those can be bound."""
    with socket.socket(family_of(host), socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((host, 0))
        except OSError:
            return False
    return True

"""A second ground station beside an engine: it sees what vehicles send, and its commands reach them.

Vehicles' datagrams go to every peer as they are, but for acknowledgements to the first station. What a peer sends goes
frame by frame to the vehicle that it names, or to all; but not what would disturb the first station: requests for other
message rates, heartbeats with its system id, which would hold off the vehicles' failsafe when it is no longer there,
and keys (SETUP_SIGNING), which would shut it out. Nothing is signed here: what a peer sends without a signature, or
with its own, comes to a vehicle just so, and a vehicle with a key refuses the first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address, ComponentId, Endpoint
from airlink.engine import Datagram, Engine
from airlink.frame import HEADER_V2, Frame, frame_length
from airlink.frame_starts import MARKER_V2
from airlink.messages.command import CommandLong, RequestDataStream
from airlink.messages.system import Heartbeat, SetupSigning
from airlink.stream_parser import StreamParser

FORGOTTEN_S: Final = 30.0
"""A peer that hasn't sent for this long is sent nothing more."""
MAX_PEERS: Final = 8
"""At each endpoint; further ones aren't received."""
ACK_ID: Final = m.MAVLINK_MSG_ID_COMMAND_ACK.to_bytes(3, "little")
ACK_SYSTEM: Final = HEADER_V2 + 8
ACK_COMPONENT: Final = HEADER_V2 + 9
"""Where an acknowledgement says whom it answers."""
RATES: Final = (m.MAV_CMD_SET_MESSAGE_INTERVAL,)


class Forward(NamedTuple):
    """Where a second ground station is."""

    endpoint: Endpoint
    takes: bool
    """Whether what it sends reaches the vehicles."""


class Remote(NamedTuple):
    """A vehicle's address at one of the engine's sockets."""

    system: int
    socket: int
    peer: Address


class Peer:
    """A second ground station's address."""

    def __init__(self) -> None:
        """Start with nothing received."""
        self.parser, self.until = StreamParser(), Instant(0)
        self.senders = set[ComponentId]()
        """Those that have been reported."""


class Forwarding(Engine):
    """An engine with further endpoints, for second ground stations."""

    def __init__(
        self,
        engine: Engine,
        forwards: tuple[Forward, ...],
        remotes: Callable[[], list[Remote]],
        station: ComponentId,
        joined: Callable[[ComponentId, Address, Instant], None],
        passed: Callable[[Datagram, Instant], bytes] = lambda datagram, _: datagram.data,
    ) -> None:
        """Put the endpoints of `forwards` beside the engine's.

        Args:
            engine: the first ground station, or what wraps it.
            forwards: the second ones.
            remotes: returns where the vehicles are at present.
            station: the first ground station's ids.
            joined: called once for each sender that is received at a forward.
            passed: returns what of a vehicle's datagram the second ones see: of a signed link what its key admits.
        """
        self._engine, self._forwards, self._remotes = engine, forwards, remotes
        self._station, self._joined, self._passed = station, joined, passed
        self._first = len(engine.endpoints())
        self._peers: list[dict[Address, Peer]] = [{} for _ in forwards]
        self._out = list[Datagram]()

    def replace(self, engine: Engine) -> None:
        """Let an engine that wraps the first ground station take its place."""
        self._engine = engine

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the engine's endpoints, then the forwards'."""
        return (*self._engine.endpoints(), *(each.endpoint for each in self._forwards))

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Pass vehicles' datagrams to the engine and to every peer, and peers' frames to the vehicles."""
        ours = [each for each in datagrams if each.socket < self._first]
        remotes = self._remotes()
        if ours:
            known = {(each.socket, each.peer) for each in remotes}
            for each in ours:
                if each.remote in known:
                    data = self._passed(each, now)
                    if data and not self._answers_us(data):
                        self._spread(data, now)
            self._engine.receive(ours, now)
        for each in datagrams:
            if each.socket >= self._first:
                self._take(each, remotes, now)

    def _answers_us(self, data: bytes) -> bool:
        """Return whether a datagram holds only an acknowledgement to us: 30 a second, which others would print."""
        return (
            len(data) > ACK_COMPONENT
            and data[0] == MARKER_V2
            and data[7:10] == ACK_ID
            and len(data) == frame_length(data, 0)
            and (data[ACK_SYSTEM], data[ACK_COMPONENT]) == self._station
        )

    def _spread(self, data: bytes, now: Instant) -> None:
        for index, forward in enumerate(self._forwards):
            fixed = forward.endpoint.peer
            peers = (
                [fixed] if fixed is not None else [at for at, peer in self._peers[index].items() if peer.until > now]
            )
            self._out += [Datagram(self._first + index, peer, data) for peer in peers]

    def _take(self, datagram: Datagram, remotes: list[Remote], now: Instant) -> None:
        index = datagram.socket - self._first
        peers = self._peers[index]
        peer = peers.get(datagram.peer)
        if peer is None:
            peers = self._peers[index] = {at: each for at, each in peers.items() if each.until > now}
            if len(peers) == MAX_PEERS:
                return
            peer = Peer()
        for frame in peer.parser.feed(datagram.data):
            peer.until = after(now, FORGOTTEN_S)
            peers[datagram.peer] = peer
            sender = ComponentId(frame.system, frame.component)
            if sender not in peer.senders and len(peer.senders) < MAX_PEERS:
                peer.senders.add(sender)
                self._joined(sender, datagram.peer, now)
            if self._forwards[index].takes and self._passes(frame):
                self._out += self._addressed(frame, remotes)

    def _passes(self, frame: Frame) -> bool:
        message = frame.message
        if isinstance(message, Heartbeat):
            return frame.system != self._station.system
        rates = isinstance(message, CommandLong) and message.command in RATES
        return not (rates or isinstance(message, (RequestDataStream, SetupSigning)))

    @staticmethod
    def _addressed(frame: Frame, remotes: list[Remote]) -> Iterator[Datagram]:
        system = 0 if frame.message is None else frame.message.addressee()
        sent = set[tuple[int, Address]]()
        for each in remotes:
            if system in (0, each.system) and (each.socket, each.peer) not in sent:
                sent.add((each.socket, each.peer))
                yield Datagram(each.socket, each.peer, frame.raw)

    def datagrams_to_send(self) -> list[Datagram]:
        """Return the engine's datagrams, and those for and from second ground stations."""
        out, self._out = self._out, []
        return [*self._engine.datagrams_to_send(), *out]

    def next_timer(self) -> Instant | None:
        """Return the engine's."""
        return self._engine.next_timer()

    def handle_timer(self, now: Instant) -> None:
        """Let the engine do what is due."""
        self._engine.handle_timer(now)

    def known_peers(self) -> frozenset[Address] | None:
        """Return the engine's: of second ground stations no more is read than of any stranger."""
        return self._engine.known_peers()

    def left_unread(self, octets: int) -> None:
        """Tell the engine."""
        self._engine.left_unread(octets)

"""One vehicle's end of its link: its peers, datagrams to frames, and messages to datagrams."""

from __future__ import annotations

from collections import deque
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame, FrameWriter, StreamParser
from airlink.messages import KINDS, Message
from sim_vehicles.autopilot.clock import NEVER
from sim_vehicles.config import VehicleConfig

ADDRESSED: Final = frozenset(each.message_type for each in KINDS.values() if "target_system" in each.fields)
"""Messages that may name whom they are for."""
PEER_FORGOTTEN_S: Final = 10.0
MAX_PEERS: Final = 16
MAX_INBOX: Final = 4096
"""Datagrams kept for the next cycle; more are dropped, as by a full serial buffer."""


class Link:
    """Sends answers to the peer that asked, and everything else to all peers.

    A `udpout` has one peer; those of a `udpin` are all that it has heard lately. Frames are numbered separately for
    each peer, so that a gap in the numbers is a loss on that peer's link.
    """

    def __init__(self, socket: int, config: VehicleConfig, outbox: list[Datagram], *, locks: bool = False) -> None:
        """Send on socket number `socket` of the engine, by appending datagrams to its outbox.

        `locks`: only the first who sends is heard, until it restarts.
        """
        self._locks = locks
        self._socket = socket
        self._outbox = outbox
        self._system = config.identity.system
        self._fixed_peer = config.endpoint.address if config.endpoint.kind == "udpout" else None
        self._inbox: deque[tuple[Instant, Address, bytes]] = deque()
        self._parsers: dict[Address, StreamParser] = {}
        self._heard: dict[Address, Instant] = {}
        self.frames_bad = 0
        """Dropped frames, from all peers."""
        self.restart()

    def restart(self) -> None:
        """Start afresh, as after power-up: an empty inbox, no peers, frames numbered from 0."""
        self._writers: dict[Address, FrameWriter] = {}
        self._inbox.clear()
        self._parsers.clear()
        self._heard.clear()

    def receive(self, peer: Address, data: bytes, now: Instant) -> None:
        """Keep a datagram that arrived at `now` for the next turn of the main loop."""
        if len(self._inbox) < MAX_INBOX:
            self._inbox.append((now, peer, data))

    @property
    def next_arrival(self) -> Instant:
        """When the oldest datagram arrived that hasn't been read."""
        return self._inbox[0][0] if self._inbox else NEVER

    def ignore(self) -> None:
        """Drop what has arrived."""
        self._inbox.clear()

    def frames(self, now: Instant) -> list[tuple[Address, Frame]]:
        """Return the valid frames for this vehicle that have arrived by `now`, each with its peer.

        A process that was held up makes up for its cycles: the earlier of them don't know what arrived afterwards.
        """
        found: list[tuple[Address, Frame]] = []
        while self._inbox and self._inbox[0][0] <= now:
            _, peer, data = self._inbox.popleft()
            if self._locks and self._heard and peer not in self._heard:
                continue
            parser = self._parser(peer)
            before = parser.counts.bad
            frames = parser.feed(data)
            self.frames_bad += parser.counts.bad - before
            for frame in frames:
                self._heard[peer] = now
                if self._is_for_us(frame):
                    found.append((peer, frame))
        return found

    def _is_for_us(self, frame: Frame) -> bool:
        """Return whether a frame is for everyone or names us; what has our own id is our own, back from a loop."""
        message = frame.message
        target: int = getattr(message, "target_system") if type(message) in ADDRESSED else 0  # noqa: B009
        return (not target or target == self._system) and frame.system != self._system

    def answer(self, peer: Address, message: Message) -> None:
        """Send to one peer, unless it has been forgotten meanwhile."""
        writer = self._writers.get(peer)
        if writer is None:
            if peer != self._fixed_peer and peer not in self._parsers:
                return
            writer = self._writers[peer] = FrameWriter(self._system, m.MAV_COMP_ID_AUTOPILOT1)
        self._outbox.append(Datagram(self._socket, peer, writer.encode(message)))

    def broadcast(self, message: Message, now: Instant) -> None:
        """Send to everyone."""
        if self._fixed_peer is not None:
            self.answer(self._fixed_peer, message)
            return
        for peer, heard in self._heard.items():
            if seconds_between(heard, now) <= PEER_FORGOTTEN_S:
                self.answer(peer, message)

    def _parser(self, peer: Address) -> StreamParser:
        """Return the parser of what a peer sends."""
        parser = self._parsers.pop(peer, None)
        if parser is None:
            parser = StreamParser()
            if len(self._parsers) >= MAX_PEERS:
                self._forget_one()
        self._parsers[peer] = parser
        return parser

    def _forget_one(self) -> None:
        """Make room for a new peer: forget one that never sent a valid frame, else the one silent longest."""
        known = [peer for peer in self._parsers if peer != self._fixed_peer]
        gone = next((peer for peer in known if peer not in self._heard), known[0])
        del self._parsers[gone]
        self._heard.pop(gone, None)
        self._writers.pop(gone, None)

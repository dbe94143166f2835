"""One vehicle's ends of its links: its peers, and conversion between datagrams, frames and messages."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Final

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after, seconds_between
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame, FrameWriter
from airlink.messages import Message
from airlink.messages.payload import MARKER_V2
from airlink.messages.system import Timesync
from airlink.signing.authentication import A_MINUTE, Authentication, Verdict
from airlink.signing.key import SigningKey
from airlink.signing.signed_links import OF_RADIOS, SignedLink
from airlink.stream_parser import StreamParser
from sim_vehicles.config import VehicleConfig

AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
PEER_FORGOTTEN_S: Final = 10.0
NEVER_RECEIVED: Final = Instant(-1)
"""`Peer.received_at` of a peer that hasn't sent a valid frame."""
MAX_PEERS: Final = 16
MAX_INBOX: Final = 4096
"""Datagrams kept for the next cycle; more are dropped, as by a full serial buffer."""
Altering = Callable[[Message, Instant], list[tuple[float, Message]]]
"""Returns what is sent in place of a message, and by how much later, s."""
_TIMESYNC: Final = m.MAVLINK_MSG_ID_TIMESYNC.to_bytes(3, "little")


class End:
    """One of the vehicle's sockets: a link of its own, as a serial port of an autopilot is."""

    def __init__(self, socket: int, link_id: int, address: Address | None) -> None:
        """Take the socket's number, the id of its signatures, and the address that it sends to; None: it listens."""
        self.socket, self.link_id, self.address = socket, link_id, address


class Peer:
    """A remote: its parser, the writer that numbers frames to it, and when it was last received."""

    def __init__(self, address: Address, end: End, system: int) -> None:
        """Start with nothing received from it at an `end` of the vehicle's; `system` is the vehicle's."""
        self.address, self.end = address, end
        self.parser = StreamParser()
        self.writer = FrameWriter(system, AUTOPILOT)
        self.received_at = NEVER_RECEIVED
        """When its last valid frame was read."""


class Link:
    """Sends answers to the peer that asked, and everything else to all peers of all ends.

    An end that sends to an address has one peer, one that listens all those received recently. Frames are numbered
    separately for each peer, so that a gap in the numbers is a loss on that peer's link.
    """

    def __init__(self, sockets: tuple[int, ...], config: VehicleConfig, utc_at_0_us: int, *, locks: bool) -> None:
        """Send on these sockets of the engine, one for each endpoint, which takes the datagrams from the `outbox`.

        `utc_at_0_us`: UTC at instant 0, microseconds since 1970, by its GNSS receiver, for signatures; `locks`: only
        the first sender at each end is received until the vehicle restarts.
        """
        self.signed: SignedLink | None = None
        """What signs and judges frames; None without a key."""
        self._utc_at_0_us, self._now = utc_at_0_us, Instant(0)
        if config.signing_key is not None:
            self.signed = SignedLink(Authentication(config.signing_key, utc_at_0_us))
        self._locks = locks
        each = zip(sockets, config.endpoints, strict=True)
        self._ends = [End(socket, link_id, endpoint.peer) for link_id, (socket, endpoint) in enumerate(each)]
        self._listens = any(end.address is None for end in self._ends)
        self.outbox: list[Datagram] = []
        self._system = config.identity.system
        self._inbox: list[Datagram] = []
        self._peers: dict[Address, Peer] = {}
        """Peers by address, sorted by when they last sent."""
        self._dropped = 0
        """Invalid frames of forgotten peers."""
        self._number = 0
        """Of altered telemetry that was put off."""
        self.altering: list[Altering] = []
        """What alters the telemetry that is sent, one after the other."""
        self.restart()

    def set_key(self, key: SigningKey | None, timestamp: int) -> None:
        """Sign with a key from now on, and refuse what isn't signed with it; with None sign and refuse nothing.

        As ArduPilot's does, it begins a minute after the timestamp (10 µs since 2015) that comes with the key.
        """
        if key is None:
            self.signed = None
        else:
            self.signed = SignedLink(Authentication(key, self._utc_at_0_us, timestamp + A_MINUTE))

    def restart(self) -> None:
        """Start afresh, as after power-up: an empty inbox, no peers, frames numbered from 0; the key is stored.

        It was stored with a timestamp that may be half a minute old, and so begins a minute after that.
        """
        if self.signed is not None:
            authentication = self.signed.authentication
            authentication.restart(authentication.timestamp + A_MINUTE)
        self._dropped = self.frames_bad
        self._inbox.clear()
        self._late: list[tuple[Instant, int, Message]] = []
        """Altered telemetry that is sent later: when, its number, and the message."""
        self.next_late = NEVER
        """When the first of these is sent."""
        self._peers.clear()
        self._senders: list[Peer] = []
        """Peers that have sent a valid frame, sorted by when they first did."""
        self._last: Peer | None = None
        self._last_address: Address | None = None
        """Sender of the last datagram, usually also the next one's."""
        self._fixed: list[Peer] = []
        """Whom the ends send to that have an address to send to."""
        for end in self._ends:
            if end.address is not None:
                peer = self._peers[end.address] = Peer(end.address, end, self._system)
                self._fixed.append(peer)

    @property
    def frames_bad(self) -> int:
        """Number of invalid frames, from all peers."""
        return self._dropped + sum([peer.parser.counts.bad for peer in self._peers.values()])

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Keep a datagram that arrived at `now` for the next cycle of the main loop."""
        if len(self._inbox) < MAX_INBOX:
            datagram.arrived = now
            self._inbox.append(datagram)

    def time_asked(self, datagram: Datagram, now: Instant) -> Timesync | None:
        """Return the TIMESYNC request if a datagram from a known peer holds only that, else None.

        Its target is whom to answer: the component that asked.
        """
        data, peer = datagram.data, self._peers.get(datagram.peer)
        if (
            len(data) < 10
            or data[0] != MARKER_V2
            or data[7:10] != _TIMESYNC
            or peer is None
            or peer.received_at == NEVER_RECEIVED
        ):
            return None
        frame = StreamParser().first(data)
        if frame is None or len(frame.raw) != len(data) or not self._is_for_us(frame):
            return None
        asked = frame.message
        if not isinstance(asked, Timesync) or asked.tc1_ns:
            return None
        if self.signed is not None and self.signed.authentication.verify(frame.raw, now) is not Verdict.AUTHENTIC:
            return None  # read, and counted, in the next cycle
        self._now = now
        peer.received_at = now
        return Timesync(0, asked.ts1_ns, frame.system, frame.component)

    @property
    def next_arrival(self) -> Instant:
        """Arrival of the oldest unread datagram."""
        return self._inbox[0].arrived if self._inbox else NEVER

    def ignore(self) -> None:
        """Drop unread datagrams."""
        self._inbox.clear()

    def frames(self, now: Instant) -> list[tuple[Address, Frame]]:
        """Return the valid frames for this vehicle that have arrived by `now`, each with its peer.

        When a process that was held up catches up with its cycles, later arrivals are left for later cycles.
        """
        found: list[tuple[Address, Frame]] = []
        if not self._inbox:
            return found
        inbox, self._inbox = self._inbox, []
        for datagram in inbox:
            if datagram.arrived > now:
                self._inbox.append(datagram)
                continue
            peer = self._peer(datagram.peer, datagram.socket)
            if peer is None:
                continue
            frame = self._admitted(peer.parser.first(datagram.data), peer, now)
            if frame is not None and peer.received_at == NEVER_RECEIVED:
                self._senders.append(peer)
            while frame is not None:
                peer.received_at = now
                if self._is_for_us(frame):
                    found.append((datagram.peer, frame))
                frame = frame.following
        return found

    def _admitted(self, frame: Frame | None, peer: Peer, now: Instant) -> Frame | None:
        """Return the first of the frames that the key admits, of some that are linked; a radio itself is no peer."""
        self._now = now
        if self.signed is not None:
            frame = self.signed.admitted(frame, peer.address, now)
            while frame is not None and frame.message_id in OF_RADIOS:
                frame = frame.following
        return frame

    def _is_for_us(self, frame: Frame) -> bool:
        """Return whether a frame is for everyone or for us; a frame with our own ids has come back from a loop.

        A companion computer has our system id, but its own component id.
        """
        target = 0 if frame.message is None else frame.message.addressee()
        own = frame.system == self._system and frame.component == AUTOPILOT
        return (not target or target == self._system) and not own

    def answer(self, address: Address, message: Message) -> None:
        """Send to one peer, unless it has been forgotten meanwhile."""
        peer = self._known(address)
        if peer is not None:
            self._send(peer, message)

    def broadcast(self, message: Message, now: Instant) -> None:
        """Send to all peers received recently, as faults of telemetry alter it."""
        if self.altering:
            self._alter(message, now)
            return
        self._send_to_all(message, now)

    def send_late(self, now: Instant) -> None:
        """Send the altered telemetry that is due."""
        while self._late and self._late[0][0] <= now:
            self._send_to_all(heapq.heappop(self._late)[2], now)
        self.next_late = self._late[0][0] if self._late else NEVER

    def _alter(self, message: Message, now: Instant) -> None:
        copies = [(0.0, message)]
        for altered in self.altering:
            copies = [(sooner_s + later_s, sent) for sooner_s, each in copies for later_s, sent in altered(each, now)]
        for later_s, sent in copies:
            if later_s <= 0.0:
                self._send_to_all(sent, now)
                continue
            self._number += 1
            heapq.heappush(self._late, (after(now, later_s), self._number, sent))
            self.next_late = self._late[0][0]

    def _send_to_all(self, message: Message, now: Instant) -> None:
        self._now = now
        for peer in self._fixed:
            self._send(peer, message)
        if not self._listens:
            return
        for peer in self._senders:
            if peer.end.address is None and seconds_between(peer.received_at, now) <= PEER_FORGOTTEN_S:
                self._send(peer, message)

    def _send(self, peer: Peer, message: Message) -> None:
        raw = peer.writer.encode(message)
        if self.signed is not None:
            raw = self.signed.authentication.sign(raw, peer.end.link_id, self._now)
        self.outbox.append(Datagram(peer.end.socket, peer.address, raw))

    def _peer(self, address: Address, socket: int) -> Peer | None:
        """Return the sender of a datagram; None if it isn't received."""
        if address is self._last_address:
            return self._last
        peer = self._peers.get(address)
        if self._locks and (peer is None or peer.received_at == NEVER_RECEIVED):
            for each in self._senders:
                if each.end.socket == socket:
                    return None
        if peer is None:
            if len(self._peers) >= MAX_PEERS:
                self._forget_one()
            peer = self._peers[address] = Peer(address, self._end(socket), self._system)
        elif len(self._peers) > 1:
            del self._peers[address]
            self._peers[address] = peer
        self._last, self._last_address = peer, address
        return peer

    def _end(self, socket: int) -> End:
        for end in self._ends:
            if end.socket == socket:
                return end
        return self._ends[0]

    def _known(self, address: Address) -> Peer | None:
        return self._last if address is self._last_address else self._peers.get(address)

    def _forget_one(self) -> None:
        """Make room for a new peer: forget one that never sent a valid frame, else the one silent longest."""
        known = [peer for peer in self._peers.values() if peer not in self._fixed]
        gone = next((peer for peer in known if peer.received_at == NEVER_RECEIVED), known[0])
        del self._peers[gone.address]
        self._dropped += gone.parser.counts.bad
        if gone.received_at != NEVER_RECEIVED:
            self._senders.remove(gone)

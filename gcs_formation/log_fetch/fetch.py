"""Fetches the logs of all vehicles at some endpoints, one vehicle after another on a link, and asks for their time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import Address, ComponentId, Endpoint
from airlink.engine import Datagram, Engine
from airlink.frame import Frame, FrameWriter
from airlink.messages import Message
from airlink.messages.command import LogEntry
from airlink.messages.system import Heartbeat, Timesync
from airlink.signing.signed_links import SignedLinks, receiver_of
from gcs_formation.log_fetch.by_ftp import FtpTransfer
from gcs_formation.log_fetch.log_folders import ARDUPILOT, PX4, LogFolders
from gcs_formation.log_fetch.transfer import LogTransfer

HEARTBEAT: Final = Heartbeat(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)
HEARTBEAT_S: Final = 1.0
LOOK_S: Final = 0.05
RECEIVED_S: Final = 30.0
"""Longest wait for a vehicle's first heartbeat, s."""
ARMED: Final = "it is armed: autopilots send their logs on the ground"
SAMPLES: Final = 8
"""Number of answers to TIMESYNC from which its clock is taken."""


class Wanted:
    """A vehicle whose log is fetched."""

    def __init__(self, socket: int, system: int, number: int | None, peer: Address | None) -> None:
        """Expect it at a socket; `peer`: where it is, if that is known."""
        self.socket, self.system, self.number, self.peer = socket, system, number, peer
        self.transfer: LogTransfer | FtpTransfer | None = None
        self.autopilot: int | None = None
        """Its MAV_AUTOPILOT, None before its first heartbeat."""
        self.armed = False
        self.failure = ""
        """Why there is no transfer."""
        self.trips = list[tuple[float, float]]()
        """Round trips, s, and our instant at their middle minus its time since boot, s."""

    @property
    def over(self) -> bool:
        """Whether nothing more comes of it."""
        transfer = self.transfer
        offers_none = isinstance(transfer, LogTransfer) and transfer.offers_none
        return bool(self.failure) or (transfer is not None and transfer.over and not offers_none)

    @property
    def booted_s(self) -> float | None:
        """Our instant at which its clock was 0, s, by the shortest round trip; None while unknown."""
        return min(self.trips)[1] if self.trips else None

    def take_time(self, answer: Timesync, now: Instant) -> None:
        """Take an answer to TIMESYNC."""
        trip_s = seconds_between(Instant(answer.ts1_ns), now)
        self.trips.append((trip_s, now * 1e-9 - trip_s / 2.0 - answer.tc1_ns * 1e-9))


class LogFetch(Engine):
    """Fetches one log of each vehicle."""

    def __init__(
        self,
        endpoints: Sequence[Endpoint],
        vehicles: Mapping[str, tuple[int, int]],
        ids: ComponentId,
        number: int | None = None,
        signing: SignedLinks | None = None,
        kept: Callable[[str, LogEntry], int] = lambda _, __: 0,
    ) -> None:
        """Begin at instant 0.

        Args:
            endpoints: where vehicles are received.
            vehicles: of each by its name the number of its endpoint, and its system id.
            ids: who asks: the station to which vehicles answer.
            number: the log's number, None for the newest.
            signing: the links' keys, if any has one.
            kept: how many bytes of a vehicle's log are there already, from its beginning.
        """
        self._endpoints, self._signing, self._receiver = tuple(endpoints), signing, receiver_of(signing)
        self._writers = [FrameWriter(*ids) for _ in endpoints]
        self.wanted = {
            name: Wanted(socket, system, number, endpoints[socket].peer) for name, (socket, system) in vehicles.items()
        }
        self._next_heartbeat = self._next_look = Instant(0)
        self._kept = kept
        self._out = list[Datagram]()

    @property
    def over(self) -> bool:
        """Whether all have come to an end."""
        return all(each.over for each in self.wanted.values()) and not self._out

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the endpoints."""
        return self._endpoints

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""
        out, self._out = self._out, []
        return out

    def next_timer(self) -> Instant | None:
        """Return when something is due."""
        return None if self.over else min(self._next_heartbeat, self._next_look)

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Take what the vehicles send."""
        for datagram in datagrams:
            frame = self._receiver.first(datagram, now)
            while frame is not None:
                for each in self.wanted.values():
                    if each.socket == datagram.socket and each.system == frame.system:
                        self._take(each, frame, datagram.peer, now)
                frame = frame.following

    def handle_timer(self, now: Instant) -> None:
        """Send what is due."""
        if now >= self._next_heartbeat:
            self._next_heartbeat = after(now, HEARTBEAT_S)
            for each in self.wanted.values():
                self._send(each, HEARTBEAT, now)
        if now >= self._next_look:
            self._next_look = after(now, LOOK_S)
            busy = set[int]()
            for name, each in self.wanted.items():
                if not each.over and each.socket not in busy:
                    busy.add(each.socket)
                    self._go_on(name, each, now)
                elif each.transfer is not None:
                    self._send_all(each, each.transfer.requests(now), now)

    def _go_on(self, name: str, each: Wanted, now: Instant) -> None:
        """Ask a vehicle for its time, then for its log."""
        if each.autopilot is None:
            if seconds_between(Instant(0), now) > RECEIVED_S:
                each.failure = f"it wasn't heard at {self._endpoints[each.socket]} in {RECEIVED_S:g} s"
            return
        if each.armed:
            each.failure = ARMED
            return
        if len(each.trips) < SAMPLES:
            self._send(each, Timesync(0, now, each.system, m.MAV_COMP_ID_AUTOPILOT1), now)
        if each.transfer is None:
            is_px4 = each.autopilot == m.MAV_AUTOPILOT_PX4
            each.transfer = LogTransfer(each.system, each.number, now, partial(self._kept, name), by_time=is_px4)
        elif isinstance(each.transfer, LogTransfer) and each.transfer.offers_none:
            folders = LogFolders(PX4 if each.autopilot == m.MAV_AUTOPILOT_PX4 else ARDUPILOT)
            each.transfer = FtpTransfer(each.system, folders, each.number, now, partial(self._kept, name))
        self._send_all(each, each.transfer.requests(now), now)

    def _take(self, each: Wanted, frame: Frame, peer: Address, now: Instant) -> None:
        message = frame.message
        if frame.component != m.MAV_COMP_ID_AUTOPILOT1 or message is None:
            return
        if isinstance(message, Heartbeat):
            each.peer, each.autopilot = peer, message.autopilot
            each.armed = bool(message.base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED)
        elif isinstance(message, Timesync) and message.tc1_ns and 0 < message.ts1_ns <= now:
            each.take_time(message, now)
        elif each.transfer is not None:
            each.transfer.take(message, now)

    def _send_all(self, each: Wanted, messages: Sequence[Message], now: Instant) -> None:
        for message in messages:
            self._send(each, message, now)

    def _send(self, each: Wanted, message: Message, now: Instant) -> None:
        if each.peer is not None:
            raw = self._writers[each.socket].encode(message)
            if self._signing is not None:
                raw = self._signing.seal(each.socket, raw, now)
            self._out.append(Datagram(each.socket, each.peer, raw))

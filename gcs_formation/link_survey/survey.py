"""Surveys the links at some endpoints: listens, asks vehicles for their time, and commands nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import Address, ComponentId, Endpoint
from airlink.engine import Datagram, Engine
from airlink.frame import Frame, FrameWriter
from airlink.messages import Message
from airlink.messages.system import Heartbeat
from airlink.receiver import Receiver
from gcs_formation.link_survey.load import Load
from gcs_formation.link_survey.measured_link import MeasuredLink
from gcs_formation.link_survey.radio import RadioReports

SURVEYOR: Final = ComponentId(254, 25)
"""Who the survey is on the wire. Not 255: a vehicle's failsafe waits for the heartbeats of its own ground station, and
doesn't act when these end."""
AUTOPILOT: Final = 1
"""The component whose link is measured."""
HEARTBEAT: Final = Heartbeat(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)
HEARTBEAT_S: Final = 1.0
GOLDEN: Final = (math.sqrt(5.0) - 1.0) / 2.0
DITHER_S: Final = 0.02
"""Requests are spread over the period of the vehicle's loop."""
MAX_VEHICLES: Final = 255


class LinkSurvey(Engine):
    """Measures every vehicle that is received at its endpoints, until an instant."""

    def __init__(
        self, endpoints: Sequence[Endpoint], until: Instant, probe_hz: float, load_kbps: float | None = None
    ) -> None:
        """Ask `probe_hz` times a second; `load_kbps`: probe after that for how much the links carry, up to this."""
        endpoints = tuple(dict.fromkeys(endpoints))
        self.links = dict[tuple[int, int], MeasuredLink]()
        """By socket and system id."""
        self.radios = [RadioReports() for _ in endpoints]
        """By socket."""
        self.load = None if load_kbps is None else Load(load_kbps, until)
        self.until = until
        """When the measurement ends, and the probing of capacity begins."""
        self._endpoints, self._period_s = endpoints, 1.0 / probe_hz
        self._receiver, self._writers = Receiver(), [FrameWriter(*SURVEYOR) for _ in endpoints]
        self._peers: list[dict[Address, None]] = [{} if each.peer is None else {each.peer: None} for each in endpoints]
        self._at = dict[tuple[int, int], Address]()
        self._next_heartbeat, self._next_probe, self._probes = Instant(0), Instant(0), 0
        self._out = list[Datagram]()

    @property
    def over(self) -> Instant:
        """When it ends."""
        return self.until if self.load is None else self.load.over

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the endpoints."""
        return self._endpoints

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""
        out, self._out = self._out, []
        return out

    def next_timer(self) -> Instant | None:
        """Return when the next heartbeat or request is due; the end counts too."""
        soonest = min(self._next_heartbeat, self._next_probe, self.over)
        return soonest if self.load is None else min(soonest, self.load.next_timer())

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Take what autopilots and radios send."""
        for datagram in datagrams:
            frame = self._receiver.first(datagram, now)
            while frame is not None:
                self._take(frame, datagram, now)
                frame = frame.following

    def handle_timer(self, now: Instant) -> None:
        """Send what is due."""
        if now >= self._next_heartbeat:
            self._next_heartbeat = after(now, HEARTBEAT_S)
            for socket, peers in enumerate(self._peers):
                for peer in peers:
                    self._send(socket, peer, HEARTBEAT)
        if now >= self._next_probe:
            self._probe(now)
        if self.load is not None and now >= self.load.next_timer():
            self._burden(self.load, now)

    def _probe(self, now: Instant) -> None:
        self._probes += 1
        grid_s = (math.floor(seconds_between(Instant(0), now) / self._period_s) + 1) * self._period_s
        self._next_probe = after(Instant(0), grid_s + DITHER_S * ((self._probes * GOLDEN) % 1.0))
        if now < self.until:
            for key, link in self.links.items():
                link.sent(self._send(key[0], self._at[key], link.ask(now)), now)
        else:
            self._next_probe = after(self.over, self._period_s)

    def _burden(self, load: Load, now: Instant) -> None:
        """Send the requests that fill the links of one vehicle at each endpoint."""
        loaded = {key[0]: key for key in self.links}
        for request in load.requests(now):
            for key in loaded.values():
                self._send(key[0], self._at[key], request)
                load.sent(key)

    def _take(self, frame: Frame, datagram: Datagram, now: Instant) -> None:
        socket, key, message = datagram.socket, (datagram.socket, frame.system), frame.message
        if frame.message_id == m.MAVLINK_MSG_ID_RADIO_STATUS:
            self.radios[socket].receive(frame)
        if frame.component != AUTOPILOT or frame.system == SURVEYOR.system:
            return
        link = self.links.get(key)
        if link is None:
            is_autopilot = isinstance(message, Heartbeat) and message.autopilot != m.MAV_AUTOPILOT_INVALID
            if not isinstance(message, Heartbeat) or not is_autopilot or len(self.links) >= MAX_VEHICLES:
                return
            link = self.links[key] = MeasuredLink(str(self._endpoints[socket]), message, now)
        self._at[key] = datagram.peer
        self._peers[socket][datagram.peer] = None
        if now <= self.until:
            link.receive(frame, now)
        elif self.load is not None:
            self.load.receive(key, message, now)

    def _send(self, socket: int, peer: Address, message: Message) -> int:
        """Send a message; return its size, bytes."""
        raw = self._writers[socket].encode(message)
        self._out.append(Datagram(socket, peer, raw))
        return len(raw)

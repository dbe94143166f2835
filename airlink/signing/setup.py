"""Gives vehicles a key, or takes it from them (SETUP_SIGNING): an engine that does nothing else.

Nothing acknowledges SETUP_SIGNING. What shows that a vehicle has taken a key is a heartbeat that is signed with it;
that it has none any more, one without a signature. Everything sent here is signed with the key: a vehicle without one
takes that as it takes unsigned frames.

The key is sent as it is. So that no one listens, links are loopback or a cable, which the caller has to see to.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address, ComponentId, Endpoint
from airlink.engine import Datagram, Engine
from airlink.frame import Frame, FrameWriter
from airlink.messages import Message
from airlink.messages.system import Heartbeat, SetupSigning, Statustext
from airlink.receiver import Receiver
from airlink.signing.authentication import Authentication
from airlink.signing.key import KEY_BYTES, SigningKey
from airlink.signing.signature import is_authentic, is_signed

AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
AGAIN_S: Final = 1.0
HEARTBEAT: Final = Heartbeat(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)


class Asked(NamedTuple):
    """A vehicle that is to have a key, or none: its system id, the socket of its link, and that link's key."""

    system: int
    socket: int
    key: SigningKey


class _Progress:
    """What is known of one vehicle."""

    def __init__(self, asked: Asked, authentication: Authentication) -> None:
        self.asked, self.authentication = asked, authentication
        self.peer: Address | None = None
        self.received = self.done = self.signs = False
        self.words = ""
        """Its last text."""


class KeySetup(Engine):
    """Asks vehicles once a second until each has the key, or none."""

    def __init__(
        self,
        endpoints: Sequence[Endpoint],
        vehicles: Sequence[Asked],
        station: ComponentId,
        states: dict[SigningKey, Authentication],
        *,
        remove: bool = False,
    ) -> None:
        """Ask nothing before the first timer.

        Args:
            endpoints: of the sockets.
            vehicles: who is asked.
            station: our ids.
            states: what each key has signed and seen.
            remove: take the key away instead.
        """
        self._endpoints, self._remove = tuple(endpoints), remove
        self._vehicles = {(each.socket, each.system): _Progress(each, states[each.key]) for each in vehicles}
        for each in self._vehicles.values():
            each.peer = self._endpoints[each.asked.socket].peer
        self._receiver, self._writers = Receiver(), [FrameWriter(*station) for _ in endpoints]
        self._out, self._next = list[Datagram](), Instant(0)

    @property
    def done(self) -> bool:
        """Whether every vehicle is as it was asked to be."""
        return all(each.done for each in self._vehicles.values())

    def finished(self) -> list[int]:
        """Return the system ids of vehicles that are as they were asked to be."""
        return [each.asked.system for each in self._vehicles.values() if each.done]

    def failures(self) -> list[str]:
        """Return in words which vehicles aren't, and what they said last."""
        return [self._failure(each) for each in self._vehicles.values() if not each.done]

    def _failure(self, each: _Progress) -> str:
        if not each.received:
            return f"vehicle {each.asked.system} isn't heard at {self._endpoints[each.asked.socket]}"
        otherwise = "signs with another key" if each.signs else "doesn't sign"
        what = "still signs" if self._remove else otherwise
        words = f'; it said "{each.words}"' if each.words else ""
        return f"vehicle {each.asked.system} {what}{words}"

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the sockets."""
        return self._endpoints

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Take what vehicles' autopilots say."""
        for datagram in datagrams:
            frame = self._receiver.first(datagram, now)
            while frame is not None:
                vehicle = self._vehicles.get((datagram.socket, frame.system))
                if vehicle is not None and frame.component == AUTOPILOT:
                    self._take(vehicle, frame, datagram.peer, now)
                frame = frame.following

    def _take(self, vehicle: _Progress, frame: Frame, peer: Address, now: Instant) -> None:
        vehicle.received, vehicle.peer = True, peer
        if isinstance(frame.message, Statustext):
            vehicle.words = frame.message.text
        vehicle.signs = is_signed(frame.raw)
        authentic = vehicle.signs and is_authentic(frame.raw, vehicle.asked.key.octets)
        if authentic:
            vehicle.authentication.verify(frame.raw, now)  # so that our timestamps are ahead of its
        if isinstance(frame.message, Heartbeat):
            vehicle.done = not vehicle.signs if self._remove else authentic

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""
        out, self._out = self._out, []
        return out

    def next_timer(self) -> Instant | None:
        """Return when vehicles are asked again; None once all are as they were asked to be."""
        return None if self.done else self._next

    def handle_timer(self, now: Instant) -> None:
        """Ask those that aren't as they should be, and show the others that we are there."""
        self._next = after(now, AGAIN_S)
        for each in self._vehicles.values():
            if each.peer is None:
                continue
            self._send(each, each.peer, HEARTBEAT, now)
            if each.received and not each.done:
                self._send(each, each.peer, self._request(each, now), now)

    def _request(self, each: _Progress, now: Instant) -> SetupSigning:
        if self._remove:
            return SetupSigning(each.asked.system, AUTOPILOT, (0,) * KEY_BYTES, 0)
        return SetupSigning(each.asked.system, AUTOPILOT, tuple(each.asked.key.octets), each.authentication.at(now))

    def _send(self, each: _Progress, peer: Address, message: Message, now: Instant) -> None:
        socket = each.asked.socket
        raw = self._writers[socket].encode(message)
        self._out.append(Datagram(socket, peer, each.authentication.sign(raw, 0, now)))

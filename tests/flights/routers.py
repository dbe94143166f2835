"""Routers between a station and vehicles: one address for all, messages passed on by the system that they name."""

from __future__ import annotations

from typing import ClassVar

from airlink.clock import Instant
from airlink.endpoint import Endpoint
from airlink.engine import Datagram
from airlink.messages import Message
from airlink.messages.system import Timesync
from airlink.stream_parser import StreamParser
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between


class MavlinkRouter(Between):
    """It passes on what names a system it has received to that one, and everything else to all.

    Source: mavlink-router's README, "Message Routing".
    """

    unrouted: ClassVar[tuple[type[Message], ...]] = ()
    """Kinds of messages whose target fields its message definitions don't have."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.links = dict[int, int]()
        """Which link each system was received on."""
        self.passed = [0] * len(fleet.vehicles)
        """Number of frames that each vehicle got."""

    def endpoints(self) -> tuple[Endpoint, ...]:
        return self.fleet.endpoints()[:1]

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        for datagram in datagrams:
            for frame in StreamParser().feed(datagram.data):
                for link in self.links_of(frame.message):
                    self.passed[link] += 1
                    self.fleet.receive([Datagram(link, datagram.peer, frame.raw)], now)

    def links_of(self, message: Message | None) -> tuple[int, ...]:
        target = 0 if isinstance(message, self.unrouted) else getattr(message, "target_system", 0)
        if not target:
            return self.of_no_target()
        return (self.links[target],) if target in self.links else ()

    def of_no_target(self) -> tuple[int, ...]:
        return tuple(range(len(self.passed)))

    def datagrams_to_send(self) -> list[Datagram]:
        found = list[Datagram]()
        for datagram in self.fleet.datagrams_to_send():
            self.links |= {frame.system: datagram.socket for frame in StreamParser().feed(datagram.data)}
            found.append(Datagram(0, datagram.peer, datagram.data))
        return found


class Mavproxy(MavlinkRouter):
    """It passes on what names no system to its first link alone, and its TIMESYNC names none.

    Source: MAVProxy 1.8.75, `process_mavlink` and `MPState.master`; pymavlink 2.4.50's TIMESYNC.
    """

    unrouted = (Timesync,)

    def of_no_target(self) -> tuple[int, ...]:
        return (0,)

    def links_of(self, message: Message | None) -> tuple[int, ...]:
        return super().links_of(message) or self.of_no_target()

"""Vehicles with several links: which link is in use, who speaks there, and what goes out on which."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from airlink import mavlink as m
from airlink.clock import NEVER, Instant
from airlink.endpoint import Address, VehicleId
from airlink.messages import Message
from airlink.messages.command import CommandLong
from airlink.messages.system import Heartbeat, Timesync
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.link.source_binding import second_sender
from gcs_formation.link.vehicle_links import Link, is_one_clock
from gcs_formation.link.vehicle_links import Links as VehicleLinks
from gcs_formation.recorder import LogEvent
from gcs_formation.vehicle.vehicle import Vehicle

MAX_LINKS: Final = 4
"""A vehicle with so many links gets no more by appearing elsewhere."""
OTHERS: Final = "another sender has its system id there, whose clock is another's; what it sends is ignored"


class SeveralLinks:
    """Watches the links of the vehicles that have more than one."""

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle], log_event: LogEvent) -> None:
        """Watch those of `vehicles`."""
        self._vehicles, self._log_event = vehicles, log_event
        self._each = list[tuple[Vehicle, VehicleLinks]]()
        self._take_each()

    def _take_each(self) -> None:
        each = self._vehicles.values()
        self._each = [(vehicle, vehicle.links) for vehicle in each if vehicle.links is not None]

    def try_port(self, vehicle: Vehicle, socket: int, peer: Address, now: Instant) -> bool:
        """Try whether another sender is the vehicle, by another port; return whether it is tried."""
        may_be = vehicle.source_binding.may_be_second_port(socket, peer) and len(vehicle.each_link) < MAX_LINKS
        if may_be:
            vehicle.try_port(socket, peer, now)
            self._take_each()
        return may_be

    def _judge_trials(self, vehicle: Vehicle, links: VehicleLinks, now: Instant) -> None:
        for link in links.each[1:]:
            if link.on_trial_since == NEVER:
                continue
            proven, peer = links.judge_trial(link, now), link.connection.peer
            if proven:
                link.on_trial_since = NEVER
                text = f"is heard from {peer}, too, with one clock and position: taken as link {link.number}"
                self._log_event(now, "address", text, vehicle, {"peer": str(peer)})
            elif proven is not None and peer is not None:
                vehicle.drop_port(link)
                self._take_each()
                text = second_sender(peer, links.in_use.connection.peer)
                self._log_event(now, "duplicate", text, vehicle, {"peer": str(peer)})

    def see_by_those_in_use(self) -> None:
        """See each vehicle by the link in use again, after frames that came on others."""
        for vehicle, links in self._each:
            vehicle.see(links.in_use)

    def choose_link(self, now: Instant) -> None:
        """Note what has become of the links that aren't in use, and choose which one is; called once a tick."""
        for vehicle, links in self._each:
            self._judge_trials(vehicle, links, now)
            for link in links.each:
                if link is not links.in_use:
                    self._check(vehicle, link, now)
            for link in links.compare_clocks(now):
                details = {"peer": str(link.connection.peer)}
                self._log_event(now, "duplicate", f"on link {link.number} {OTHERS}", vehicle, details)
            before = links.in_use
            text = links.choose(now)
            if text:
                self._switch(vehicle, before, links.in_use, text, now)

    def _check(self, vehicle: Vehicle, link: Link, now: Instant) -> None:
        connection = link.connection
        if not connection.in_order(now) and connection.check(now, link.sequence.loss):
            self.log_state(vehicle, connection, now)

    def log_state(self, vehicle: Vehicle, connection: Connection, now: Instant) -> None:
        """Record the state of one of its links."""
        number = next(link.number for link in vehicle.each_link if link.connection is connection)
        text = f"{connection.state.value} (link {number})"
        self._log_event(now, "link", text, vehicle, {"peer": str(connection.peer), "link": number})

    def _switch(self, vehicle: Vehicle, before: Link, link: Link, text: str, now: Instant) -> None:
        self._log_event(now, "link_choice", text, vehicle, {"link": link.number})
        vehicle.see(link)
        vehicle.forget_setpoints()
        if before.connection.state is LinkState.LOST and not is_one_clock(before.clock, link.clock, now):
            vehicle.restart(now)


def receivers(vehicle: Vehicle, message: Message) -> list[Link]:
    """Return the links on which a message to a vehicle goes out, of those where it was received or has an address.

    What keeps links alive and measures them goes out on all, and so does the request for a message's rate, which an
    autopilot takes for the link on which it comes.
    """
    links = vehicle.links
    if links is None:
        return vehicle.each_link
    rate = isinstance(message, CommandLong) and message.command == m.MAV_CMD_SET_MESSAGE_INTERVAL
    return links.each if rate or isinstance(message, (Heartbeat, Timesync)) else [links.in_use]

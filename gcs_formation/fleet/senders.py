"""Finds the sender of each frame: one of our vehicles, a stranger, or our own echo.

Which of two remotes with a vehicle's system id is that vehicle is decided by `link.source_binding`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from airlink import mavlink as m
from airlink.clock import NEVER, Instant
from airlink.endpoint import Address, ComponentId, VehicleId
from airlink.engine import Datagram
from airlink.frame import Frame
from airlink.messages.system import Heartbeat
from gcs_formation.link.frame_loss import STALE_AFTER_NS
from gcs_formation.link.link_health import LinkState
from gcs_formation.phases import Flight, Phase
from gcs_formation.recorder import GiveUp, LogEvent
from gcs_formation.vehicle.autopilot_family import STATION
from gcs_formation.vehicle.vehicle import Vehicle

AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
NO_AUTOPILOT: Final = m.MAV_AUTOPILOT_INVALID
SYSTEMS: Final = 256
MANY_COPIES: Final = 20
"""Number of copies of a vehicle's frames after which they are reported."""
COPIES_TEXT: Final = "its frames come more than once, as by a second link; copies and what is overtaken are ignored"
IF_ONE: Final = "If it is one vehicle with two links, name both: endpoint: [A, B]"
HOLDS_OFF: Final = "its heartbeats hold off the vehicles' failsafe when ours stop (another id: station.system)"
EVERYONE = 0
"""MAVLink's broadcast id, which isn't allowed as a sender's id."""
TryPort = Callable[[Vehicle, int, Address, Instant], bool]


class Senders:
    """Finds the vehicle that sent a frame; reports each other sender once."""

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        networks: tuple[int, ...],
        flight: Flight,
        log_event: LogEvent,
        give_up: GiveUp,
        station: ComponentId = STATION,
        try_port: TryPort | None = None,
    ) -> None:
        """Take the `vehicles`; `networks[s]` is the network of socket s; `station`: our own ids.

        `try_port`: tries a second sender as a further link of a vehicle.
        """
        self._try_port = try_port
        self._networks = networks
        self._vehicles: list[list[Vehicle | None]] = [[None] * SYSTEMS for _ in networks]
        """Vehicles by socket and system id."""
        for identity, vehicle in vehicles.items():
            for socket, network in enumerate(networks):
                if network == identity.network:
                    self._vehicles[socket][identity.system] = vehicle
        self._flight = flight
        self._log_event = log_event
        self._give_up = give_up
        self._station = station
        self._strangers: set[VehicleId] = set()
        self._namesakes: set[ComponentId] = set()
        """Other senders with our system id that have been reported."""
        self._all = list(vehicles.values())
        self._peers, self._peers_at = frozenset[Address](), NEVER

    def peers(self, tick: Instant) -> frozenset[Address]:
        """Return the vehicles' addresses, looked up once for each next tick."""
        if self._peers_at != tick:
            self._peers_at = tick
            connections = [link.connection for vehicle in self._all for link in vehicle.each_link]
            self._peers = frozenset(each.peer for each in connections if each.peer is not None)
        return self._peers

    def sender(self, frame: Frame, datagram: Datagram, now: Instant) -> Vehicle | None:
        """Return the vehicle whose autopilot sent a frame, None for another sender; its `history` tells news.

        One with several links is then seen by that on which the frame came.
        """
        socket, message = datagram.socket, frame.message
        vehicle = self._vehicles[socket][frame.system]
        if vehicle is None:
            self._log_stranger(VehicleId(self._networks[socket], frame.system), frame, datagram, now)
            return None
        if frame.component != AUTOPILOT or (isinstance(message, Heartbeat) and message.autopilot == NO_AUTOPILOT):
            return None  # from a device that isn't an autopilot, such as a companion computer
        if vehicle.links is not None:
            vehicle.see(vehicle.links.at(socket, datagram.peer))
        connection, history = vehicle.connection, vehicle.history
        bound = connection.state is not LinkState.SEARCHING
        elsewhere = bound and (socket != connection.socket or datagram.peer != connection.peer)
        silent = now - connection.last_received >= STALE_AFTER_NS
        sequence = vehicle.sequence
        follows = sequence.may_follow(frame.sequence, now, connection.last_received)
        overtaken = sequence.was_overtaken(frame.sequence)
        if history.is_copy(frame, now, elsewhere=elsewhere, follows=follows, overtaken=overtaken, silent=silent):
            if history.copies == MANY_COPIES:
                self._log_event(now, "copies", COPIES_TEXT, vehicle, {"peer": str(datagram.peer)})
            return vehicle
        if history.is_lost_one(frame, now, elsewhere=elsewhere):
            return None
        admitted, finding = vehicle.source_binding.rule(message, socket, datagram.peer, now)
        tried = not admitted and self._is_tried(vehicle, datagram, now) if finding is not None else False
        if finding is not None and not tried:
            self._log_finding(vehicle, finding, datagram, now, admitted=admitted)
        if not admitted:
            return None
        follows = follows or sequence.is_near(frame.sequence)
        history.record(frame, now, follows=follows, awaited=vehicle.round_trips.awaits(message))
        return vehicle

    def _is_tried(self, vehicle: Vehicle, datagram: Datagram, now: Instant) -> bool:
        """Return whether another sender is tried as a further link: in flight, where positions tell vehicles apart."""
        if self._try_port is None or self._flight.phase is Phase.CONNECTING:
            return False
        return self._try_port(vehicle, datagram.socket, datagram.peer, now)

    def _log_finding(self, vehicle: Vehicle, text: str, datagram: Datagram, now: Instant, *, admitted: bool) -> None:
        self._log_event(now, "address" if admitted else "duplicate", text, vehicle, {"peer": str(datagram.peer)})
        if admitted:
            vehicle.sequence.restart()
            vehicle.history.restart()
        elif self._flight.phase is Phase.CONNECTING:
            self._give_up(f"vehicle {vehicle.identity}: {text}; allowed: each id once. {IF_ONE}", now)

    def _log_stranger(self, identity: VehicleId, frame: Frame, datagram: Datagram, now: Instant) -> None:
        if not isinstance(frame.message, Heartbeat):
            return
        details = {"peer": str(datagram.peer)}
        if identity.system == self._station.system:
            self._log_namesake(ComponentId(frame.system, frame.component), details, now)
        elif identity not in self._strangers:
            self._strangers.add(identity)
            why = (
                "is the broadcast address and no vehicle's id"
                if identity.system == EVERYONE
                else "isn't in the scenario"
            )
            self._log_event(now, "stranger", f"system {identity} is heard, but {why}", None, details)

    def _log_namesake(self, sender: ComponentId, details: dict[str, str], now: Instant) -> None:
        """Report a sender with our system id once, with what it means."""
        if sender in self._namesakes:
            return
        self._namesakes.add(sender)
        if sender == self._station:
            text = f"{sender} are our own ids: another ground station has them, or our own frames come back"
        else:
            text = f"another ground station, {sender}, has our system id"
        self._log_event(now, "own_id", f"{text}; {HOLDS_OFF}", None, dict(details))

"""Identifies the sender of each frame: one of our vehicles, a stranger, or our own echo.

Which of two remotes with a vehicle's system id is that vehicle is decided by `link.source_binding`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.engine import Datagram
from airlink.frame import Frame
from airlink.messages.system import Heartbeat
from gcs_formation.phases import Flight, Phase
from gcs_formation.recorder import GiveUp, Note
from gcs_formation.vehicle.autopilot_family import STATION_SYSTEM
from gcs_formation.vehicle.vehicle import Vehicle

AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
NO_AUTOPILOT: Final = m.MAV_AUTOPILOT_INVALID
SYSTEMS: Final = 256
EVERYONE = 0
"""MAVLink's broadcast id, which no sender may have."""


class Senders:
    """Finds the vehicle that sent a frame; reports each other sender on the network once."""

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        networks: tuple[int, ...],
        flight: Flight,
        note: Note,
        give_up: GiveUp,
    ) -> None:
        """Know `vehicles`; `networks[s]` is the network of socket s."""
        self._networks = networks
        self._vehicles: list[list[Vehicle | None]] = [[None] * SYSTEMS for _ in networks]
        """By socket and system id."""
        for identity, vehicle in vehicles.items():
            for socket, network in enumerate(networks):
                if network == identity.network:
                    self._vehicles[socket][identity.system] = vehicle
        self._flight = flight
        self._note = note
        self._give_up = give_up
        self._strangers: set[VehicleId] = set()

    def sender(self, frame: Frame, datagram: Datagram, now: Instant) -> Vehicle | None:
        """Return the vehicle whose autopilot sent a frame, None if another sender did."""
        socket, message = datagram.socket, frame.message
        vehicle = self._vehicles[socket][frame.system]
        if vehicle is None:
            self._note_stranger(VehicleId(self._networks[socket], frame.system), frame, datagram, now)
            return None
        if frame.component != AUTOPILOT or (isinstance(message, Heartbeat) and message.autopilot == NO_AUTOPILOT):
            return None  # that of a device that isn't an autopilot, such as a companion computer
        admitted, finding = vehicle.source_binding.judge(message, socket, datagram.peer, now)
        if finding is not None:
            self._note_finding(vehicle, finding, datagram, now, admitted=admitted)
        return vehicle if admitted else None

    def _note_finding(self, vehicle: Vehicle, text: str, datagram: Datagram, now: Instant, *, admitted: bool) -> None:
        self._note(now, "address" if admitted else "duplicate", text, vehicle, {"peer": str(datagram.peer)})
        if admitted:
            vehicle.sequence.restart()
        elif self._flight.phase is Phase.CONNECTING:
            self._give_up(f"vehicle {vehicle.identity}: {text}; allowed: each id once", now)

    def _note_stranger(self, identity: VehicleId, frame: Frame, datagram: Datagram, now: Instant) -> None:
        if not isinstance(frame.message, Heartbeat) or identity in self._strangers:
            return
        self._strangers.add(identity)
        details = {"peer": str(datagram.peer)}
        if identity.system == STATION_SYSTEM:
            text = f"system {identity} is our own id: another ground station has it, or our own frames come back"
            self._note(now, "own_id", text, None, details)
        else:
            why = "is everyone's address and nobody's id" if identity.system == EVERYONE else "isn't in the scenario"
            self._note(now, "stranger", f"system {identity} is heard, but {why}", None, details)

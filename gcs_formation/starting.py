"""The start of a run: once all vehicles answer, each goes through the start-up of its autopilot family."""

from __future__ import annotations

from collections.abc import Mapping

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.endpoint import Endpoint
from airlink.identity import VehicleId
from airlink.messages.system import Heartbeat
from formation_scenario import Vehicle as PlannedVehicle
from gcs_formation.link.connection import LinkState
from gcs_formation.membership import Member
from gcs_formation.phases import OVER, Flight, Phase
from gcs_formation.preflight import PreFlight
from gcs_formation.recorder import GiveUp, Note
from gcs_formation.takeover import Takeover
from gcs_formation.vehicle.vehicle import Vehicle

CONNECT_LIMIT_S = 30.0
"""Longest wait for every vehicle's first heartbeat."""


class Starting:
    """Gets vehicles ready, at the beginning and after a vehicle restarts."""

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        endpoints: tuple[Endpoint, ...],
        flight: Flight,
        preflight: PreFlight,
        takeover: Takeover,
        note: Note,
        give_up: GiveUp,
    ) -> None:
        """Start up `vehicles`, the leader first; `endpoints` are where they should be heard."""
        self._preflight, self._takeover = preflight, takeover
        self._vehicles = vehicles
        self._endpoints = endpoints
        self._flight = flight
        self._note = note
        self._give_up = give_up

    def advance(self, now: Instant) -> None:
        """Continue the start-up of every vehicle; none takes off before all have answered."""
        silent = [vehicle for vehicle in self._vehicles.values() if vehicle.connection.state is LinkState.SEARCHING]
        missed = self._takeover.waits_for(now)
        if missed is None and silent:
            self._wait_for(silent, now)
        if silent if missed is None else missed:
            return
        foreign = [vehicle for vehicle in self._vehicles.values() if not _is_of_its_family(vehicle)]
        if foreign and self._flight.phase is Phase.CONNECTING:
            self._give_up("; ".join(map(_is_another, foreign)), now)
        for vehicle in self._vehicles.values():
            if not vehicle.start_up.finished and vehicle not in silent and self._flight.phase not in OVER:
                self._advance(vehicle, now)

    def leader_ready(self, leader: PlannedVehicle | None) -> bool:
        """Return whether the leader follows setpoints; under a virtual one, whether all vehicles do."""
        needed = self._vehicles.values() if leader is None else (self._vehicles[leader.vehicle_id],)
        return all(vehicle.member is Member.FLYING for vehicle in needed)

    def _wait_for(self, silent: list[Vehicle], now: Instant) -> None:
        waited_s = seconds_between(Instant(0), now)
        if self._flight.phase is Phase.CONNECTING and waited_s > CONNECT_LIMIT_S:
            who = ", ".join(str(vehicle.identity) for vehicle in silent)
            where = ", ".join(dict.fromkeys(str(self._endpoints[vehicle.connection.socket]) for vehicle in silent))
            self._give_up(f"no vehicle {who} answered at {where} in {waited_s:.0f} s", now)

    def _advance(self, vehicle: Vehicle, now: Instant) -> None:
        may_act = self._takeover.may_act(vehicle, now) and self._preflight.passed
        vehicle.start_up.advance(vehicle.telemetry, vehicle.commands, now, may_act=may_act)
        if self._flight.phase is Phase.FLYING and vehicle.start_up.takes_off:
            vehicle.leave_to_pilot(now)
            self._note(now, "abandoned", "on the ground after the path has begun: left to its pilot", vehicle)
        reason = vehicle.start_up.failure(vehicle.commands, now)
        if reason:
            said = f"; it said: '{vehicle.telemetry.texts[-1]}'" if vehicle.telemetry.texts else ""
            self._abandon(vehicle, f"vehicle {vehicle.identity}: {reason}{_result(vehicle)}{said}", now)
        elif vehicle.start_up.finished:
            self._note(now, "ready", "in the air and following setpoints", vehicle)

    def _abandon(self, vehicle: Vehicle, text: str, now: Instant) -> None:
        """End the run because a vehicle can't be started; once others have flown the path, go on without it instead."""
        if self._flight.phase is not Phase.FLYING and self._takeover.resumed is None:
            self._give_up(text, now)
        elif not vehicle.start_up.abandoned:
            vehicle.start_up.abandoned = True
            self._note(now, "abandoned", text, vehicle)


def _is_of_its_family(vehicle: Vehicle) -> bool:
    heartbeat = vehicle.telemetry.heartbeat
    return heartbeat is None or vehicle.autopilot.speaks(heartbeat)


def _is_another(vehicle: Vehicle) -> str:
    heartbeat = vehicle.telemetry.heartbeat or Heartbeat(0, 0)
    names = m.name_of("MAV_AUTOPILOT", heartbeat.autopilot), m.name_of("MAV_TYPE", heartbeat.type)
    return f"vehicle {vehicle.identity} says that it is a {' '.join(names)}; allowed: {vehicle.autopilot.family}"


def _result(vehicle: Vehicle) -> str:
    refusal = vehicle.commands.refusal
    return f" (command {refusal[0]}: {m.name_of('MAV_RESULT', refusal[1])})" if refusal else ""

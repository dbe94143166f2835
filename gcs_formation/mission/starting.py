"""The start of a run: each vehicle's start-up."""

from __future__ import annotations

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.endpoint import Endpoint, VehicleId
from airlink.messages.system import Heartbeat
from gcs_formation.link.link_health import LinkState
from gcs_formation.mission.beginning import Beginning
from gcs_formation.mission.gate import Gate
from gcs_formation.phases import OVER, Flight, Phase
from gcs_formation.recorder import GiveUp, LogEvent
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.startup_step import StartUpStep
from gcs_formation.vehicle.vehicle import Vehicle

TOGETHER_S = 600.0
"""Longest wait for the other vehicles; each one's own steps end or fail sooner."""
WAITS_S = 10.0
"""A vehicle that takes longer than this to get ready is reported, with what it lacks."""
CONNECT_LIMIT_S = 30.0
"""Longest wait for every vehicle's first heartbeat."""


class Starting:
    """Prepares vehicles for flight, at the beginning and after a vehicle restarts."""

    def __init__(
        self,
        vehicles: dict[VehicleId, Vehicle],
        endpoints: tuple[Endpoint, ...],
        flight: Flight,
        gate: Gate,
        beginning: Beginning,
        log_event: LogEvent,
        give_up: GiveUp,
        *,
        together: bool,
    ) -> None:
        """Start up `vehicles`, the leader first; `endpoints` are where they should be received.

        With `together`, those that are ready hover until all are, so that none is led past others still climbing.
        """
        self._gate, self._beginning = gate, beginning
        self._lacking = dict[VehicleId, str]()
        """What each vehicle was last said to lack."""
        self._vehicles, self._each = vehicles, list(vehicles.values())
        self._endpoints = endpoints
        self._flight = flight
        self._log_event = log_event
        self._give_up = give_up
        if together:
            wait = StartUpStep("waited for the others to be ready", lambda _: self._all_ready(), timeout_s=TOGETHER_S)
            for vehicle in vehicles.values():
                vehicle.end_start_up_with(wait)

    def _all_ready(self) -> bool:
        """Return whether every vehicle has finished all steps but the last, which waits for this."""
        each = [vehicle.start_up for vehicle in self._each]
        return all(one.abandoned or one.index >= len(one.steps) - 1 for one in each)

    def advance(self, now: Instant) -> None:
        """Continue the start-up of every vehicle; none takes off before all have answered."""
        silent, unready = list[Vehicle](), list[Vehicle]()
        for vehicle in self._each:
            if vehicle.connection.state is LinkState.SEARCHING:
                silent.append(vehicle)
            elif not vehicle.start_up.finished:
                unready.append(vehicle)
        missed = self._beginning.waits_for(now)
        if missed is None and silent:
            self._wait_for(silent, now)
        if silent if missed is None else missed:
            return
        if self._flight.phase is Phase.CONNECTING:
            foreign = [vehicle for vehicle in self._each if not _is_of_its_family(vehicle)]
            if foreign:
                self._give_up("; ".join(map(_wrong_family, foreign)), now)
        for vehicle in unready:
            if self._flight.phase not in OVER:
                self._advance(vehicle, now)
            elif vehicle.restarts and not vehicle.start_up.asked_for_telemetry:
                # A vehicle that restarts while the run ends: its telemetry is needed to watch it.
                vehicle.start_up.advance(vehicle.telemetry, vehicle.commands, now, may_act=False)

    def _wait_for(self, silent: list[Vehicle], now: Instant) -> None:
        waited_s = seconds_between(self._flight.since, now)
        if self._flight.phase is Phase.CONNECTING and waited_s > CONNECT_LIMIT_S:
            who = ", ".join(str(vehicle.identity) for vehicle in silent)
            where = ", ".join(dict.fromkeys(str(self._endpoints[vehicle.connection.socket]) for vehicle in silent))
            self._give_up(f"no vehicle {who} answered at {where} in {waited_s:.0f} s", now)

    def _advance(self, vehicle: Vehicle, now: Instant) -> None:
        if vehicle.airborne and vehicle.start_up.taken_over(vehicle.telemetry):
            mode = vehicle.autopilot.mode_name(vehicle.telemetry)
            vehicle.leave_to_pilot(now)
            self._log_event(now, "abandoned", f"taken over in {mode} before it was ready: left to its pilot", vehicle)
        too_late = self._flight.phase is Phase.FLYING and vehicle.autopilot.is_grounded(vehicle.telemetry)
        may_act = self._beginning.may_act(vehicle, now) and self._gate.passed and not too_late
        if not (vehicle.start_up.asks_for_telemetry and vehicle.sampler.why_unknown(now)):
            vehicle.start_up.advance(vehicle.telemetry, vehicle.commands, now, may_act=may_act)
        if vehicle.start_up.asks_for_telemetry:
            vehicle.start_up.ask_again(vehicle.telemetry, vehicle.commands, now)
        if (too_late and vehicle.start_up.held) or (self._flight.phase is Phase.FLYING and vehicle.start_up.takes_off):
            vehicle.leave_to_pilot(now)
            self._log_event(now, "abandoned", "on the ground after the path has begun: left to its pilot", vehicle)
        vehicle.start_up.update_progress(vehicle.telemetry, now)
        reason = vehicle.start_up.failure(vehicle.commands, now, self._gate.boot_timeout_s)
        if reason:
            answered = f"{_result(vehicle)}{_lacks(vehicle, now)}{vehicle.telemetry.last_words}"
            self._abandon(vehicle, f"vehicle {vehicle.identity}: {reason}{answered}", now)
        elif vehicle.start_up.waited_s(now) > WAITS_S:
            self._report_lacks(vehicle, now)
        elif vehicle.start_up.finished:
            self._log_event(now, "ready", "in the air and following setpoints", vehicle)

    def _report_lacks(self, vehicle: Vehicle, now: Instant) -> None:
        """Record what a vehicle is waited for that takes long to get ready, once for each thing."""
        lacks = _lacks(vehicle, now)
        if lacks and lacks != self._lacking.get(vehicle.identity):
            self._lacking[vehicle.identity] = lacks
            self._log_event(now, "waits", f"not ready yet{lacks}{vehicle.telemetry.last_words}", vehicle)

    def _abandon(self, vehicle: Vehicle, text: str, now: Instant) -> None:
        """End the run because a vehicle can't be started; on the path, continue without the vehicle instead."""
        if self._flight.phase is not Phase.FLYING and self._beginning.from_start:
            self._give_up(text, now)
        elif not vehicle.start_up.abandoned:
            vehicle.start_up.abandoned = True
            self._log_event(now, "abandoned", text, vehicle)


def _is_of_its_family(vehicle: Vehicle) -> bool:
    heartbeat = vehicle.telemetry.heartbeat
    return heartbeat is None or vehicle.autopilot.speaks(heartbeat)


def _wrong_family(vehicle: Vehicle) -> str:
    heartbeat = vehicle.telemetry.heartbeat or Heartbeat(0, 0)
    names = m.name_of("MAV_AUTOPILOT", heartbeat.autopilot), m.name_of("MAV_TYPE", heartbeat.type)
    return f"vehicle {vehicle.identity} says that it is a {' '.join(names)}; allowed: {vehicle.autopilot.family}"


def _lacks(vehicle: Vehicle, now: Instant) -> str:
    """Return in brackets what a step waits for: readiness, or telemetry, which is missing or can't be used.

    Over a full link nothing that is missing tells about the vehicle.
    """
    if vehicle.limits.full:
        return f" (the link is full: {vehicle.limits.full})"
    if not vehicle.start_up.asks_for_telemetry:
        lacking = vehicle.start_up.lacks(vehicle.telemetry)
        return f" ({lacking})" if lacking else ""
    seen, acknowledged = vehicle.telemetry, vehicle.commands.outcome is Outcome.ACCEPTED
    unknown = vehicle.sampler.why_unknown(now) if acknowledged else None
    if unknown:
        return f" ({unknown})"
    untold = [name for name, value in (("position", seen.motion), ("attitude", seen.attitude)) if value is None]
    why = [f": {seen.position_refused}"] if seen.motion is None and seen.position_refused else []
    return f" (it has reported no {' and no '.join(untold)}{''.join(why)})" if untold else ""


def _result(vehicle: Vehicle) -> str:
    refusal, asked = vehicle.commands.refusal, vehicle.commands.under_way
    if refusal is None:
        return ""
    of_message = asked is not None and asked.command == refusal[0] == m.MAV_CMD_SET_MESSAGE_INTERVAL
    which = f" of message {asked.param1:.0f}" if asked is not None and of_message else ""
    return f" ({m.name_of('MAV_CMD', refusal[0])}{which}: {m.name_of('MAV_RESULT', refusal[1])})"

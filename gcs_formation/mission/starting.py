"""The start of a run: checks before the first command, then each vehicle's start-up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.endpoint import Endpoint, VehicleId
from airlink.messages import Message
from airlink.messages.command import ParamValue
from airlink.messages.system import Heartbeat
from formation_scenario import Scenario
from formation_scenario import Vehicle as PlannedVehicle
from gcs_formation.link.link_health import LinkState
from gcs_formation.mission.read_limits import Bound, ReadLimits
from gcs_formation.mission.resumption import Takeover
from gcs_formation.phases import OVER, Flight, Phase
from gcs_formation.recorder import GiveUp, Note
from gcs_formation.vehicle.autopilot_family import Autopilot, StartUpStep
from gcs_formation.vehicle.checks import Finding, ParameterReader, place_findings
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.startup import StartUp
from gcs_formation.vehicle.telemetry import ReportedMotion, Telemetry
from gcs_formation.vehicle.vehicle import Member, Vehicle

IN_ORDER = "in order"
TAKE = "; --take takes it over, --confirm asks"
TOGETHER_S = 600.0
"""Longest wait for the other vehicles; each one's own steps end or fail sooner."""
WAITS_S = 10.0
"""A vehicle that takes longer than this to get ready is reported, with what it lacks."""
STANDS_S = 1.0
"""Time between the two positions by which features check what a vehicle says of its motion, s."""
CONNECT_LIMIT_S = 30.0
"""Longest wait for every vehicle's first heartbeat."""


@dataclass(frozen=True)
class PreFlightOptions:
    """What precedes the first command (change of mode, arming or setpoint)."""

    parameters: bool = False
    """Whether parameters and positions of vehicles are checked."""
    confirm: bool = False
    """Whether to wait for the operator's confirmation when all vehicles are ready."""
    rehearse: bool = False
    """Whether the run ends at that point."""
    take: bool = False
    """Whether vehicles that fly already under somebody's command are taken over without a question."""


UNCHECKED = PreFlightOptions()


@dataclass(frozen=True)
class AsFound:
    """A vehicle as it is found before the first command, once it is ready."""

    autopilot: Autopilot
    """Its family, for what to set."""
    seen: Telemetry
    """Its newest telemetry, with a position."""
    least_mps: float
    """The lowest airspeed at which it flies."""
    first: ReportedMotion
    """The position that it reported when it became ready, `STANDS_S` or more before."""
    flies: bool
    """Whether it's in the air already."""


BeforeTakeOff = Callable[[AsFound], list[Finding]]
"""Returns what is wrong with a vehicle before the first command."""


class PreFlight:
    """Holds all start-ups before their first command until every vehicle may begin."""

    def __init__(
        self,
        scenario: Scenario,
        vehicles: dict[VehicleId, Vehicle],
        caution: PreFlightOptions,
        note: Note,
        give_up: GiveUp,
        bound: Bound,
    ) -> None:
        """Prepare to read the parameters of `vehicles`, if `caution` asks for it; `bound` applies their limits."""
        self.limits, self.boot_timeout_s = ReadLimits(scenario, bound), scenario.start.boot_timeout_s
        self.vehicles, self._caution = vehicles, caution
        self._note, self._give_up = note, give_up
        self._confirmed = not (caution.confirm or caution.rehearse)
        self.passed = self._confirmed and not caution.parameters
        """Whether vehicles may be commanded."""
        self._readers: dict[VehicleId, ParameterReader] = {}
        if caution.parameters:
            for planned in scenario.vehicles:
                autopilot = vehicles[planned.vehicle_id].autopilot
                checks = autopilot.checks(planned.model, scenario.path)
                self._readers[planned.vehicle_id] = ParameterReader(planned.id, checks, autopilot.parameter)
        self._scenario, self._placed = scenario, set[VehicleId]()
        self._least_mps = {each.vehicle_id: each.model.speed_min_mps for each in scenario.vehicles}
        self._first = dict[VehicleId, ReportedMotion]()
        """Each vehicle's position when it became ready."""
        self.checks = list[BeforeTakeOff]()
        """What features check before the first command, in their order."""
        emulated = (each.vehicle_id for each in scenario.vehicles if each.autopilot == "emulator")
        self._nobodys = frozenset(emulated if scenario.start.in_air else ())
        """Vehicles that begin in the air, and so are not under another command."""
        self._judged = set[VehicleId]()
        self._refused, self._gave_up = list[str](), False
        """What prevents the take-off, in words, and whether that has ended the run."""
        self.warnings: dict[VehicleId, tuple[str, ...]] = {}
        """Findings that don't prevent the take-off."""

    def watch(self) -> None:
        """Allow commands, for good, once all vehicles are connected, ready and checked, and the operator confirms."""
        self.passed = self.passed or (
            self._confirmed and self._checked and self._ready and (self._may_take or not self.flown_by_others)
        )

    @property
    def flown_by_others(self) -> list[tuple[Vehicle, str]]:
        """Vehicles that fly already, and so under somebody's command, and their modes."""
        if not self._caution.parameters:
            return []
        flying = (each for each in self.vehicles.values() if each.airborne and each.identity not in self._nobodys)
        return [(each, each.autopilot.mode_name(each.telemetry)) for each in flying if not each.start_up.acted]

    @property
    def _may_take(self) -> bool:
        return self._caution.take or self._caution.confirm or self._caution.rehearse

    @property
    def awaits_word(self) -> bool:
        """Whether only the operator's confirmation is missing."""
        return not self._confirmed and self._checked and self._ready

    @property
    def rehearsed(self) -> bool:
        """Whether a rehearsal has finished."""
        return self._caution.rehearse and self.awaits_word

    @property
    def _ready(self) -> bool:
        return all(_is_ready(vehicle.start_up) for vehicle in self.vehicles.values())

    @property
    def _checked(self) -> bool:
        return len(self._judged) == len(self._placed) == len(self._readers) and not self._refused

    def confirm(self) -> None:
        """Record the operator's confirmation."""
        self._confirmed = True

    def requests(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return the parameter requests to send now; judge complete sets of parameters, and positions."""
        found = list[tuple[Vehicle, Message]]()
        for identity, reader in self._readers.items():
            vehicle = self.vehicles[identity]
            if identity not in self._placed:
                self._report_place(vehicle, now)
            if identity in self._judged or not vehicle.connection.talks:
                continue
            if reader.complete:
                self._judge(vehicle, reader, now)
            else:
                found += [(vehicle, request) for request in reader.requests(now)]
        if len(self._judged) == len(self._readers) and not (self.passed or self._gave_up):
            refused = [*self._refused, *self._unasked(), *self._beyond_limits()]
            self._gave_up = bool(
                refused
            )  # only now: an operator who mends one vehicle's parameters wants to know of all
            if refused:
                self._give_up("; ".join(refused), now)
        return found

    def _beyond_limits(self) -> list[str]:
        """Return in words what can't be flown within the limits that vehicles tell, unless one flies already."""
        grounded = not any(each.airborne for each in self.vehicles.values())
        return self.limits.unflyable() if grounded and not self._refused else []

    def _unasked(self) -> list[str]:
        """Return in words which vehicles would be taken, unasked, from those who fly them."""
        if self._may_take:
            return []
        return [f"vehicle {each.identity} {_flies(mode)}{TAKE}" for each, mode in self.flown_by_others]

    def take(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter reported by a vehicle."""
        if vehicle.identity in self._readers:
            self._readers[vehicle.identity].take(message, now)

    def _judge(self, vehicle: Vehicle, reader: ParameterReader, now: Instant) -> None:
        """Record the findings. Those that prevent a take-off are warnings for a vehicle already in flight."""
        findings, flies = reader.findings(), vehicle.airborne
        self.limits.take(vehicle, reader.bounds())
        self._judged.add(vehicle.identity)
        self._record(vehicle, [each._replace(refuses=each.refuses and not flies) for each in findings], now)

    def _report_place(self, vehicle: Vehicle, now: Instant) -> None:
        """Record whether a vehicle is at the scenario's field, once it is ready and so knows its home.

        What features check is checked then, too.
        """
        motion = vehicle.telemetry.motion
        if motion is None:
            return
        if not _is_ready(vehicle.start_up):
            self._first[vehicle.identity] = motion  # an ArduPilot without a fix tells places near 0, 0 until it has one
            return
        first = self._first.setdefault(vehicle.identity, motion)
        if self.checks and motion.stamp_s - first.stamp_s < STANDS_S:
            return
        self._placed.add(vehicle.identity)
        flies, seen = vehicle.airborne, vehicle.telemetry
        findings = place_findings(motion, self._scenario, flies=flies)
        found = AsFound(vehicle.autopilot, seen, self._least_mps[vehicle.identity], first, flies)
        for check in self.checks:
            findings += check(found)
        findings += [Finding(_flies(mode)) for each, mode in self.flown_by_others if each is vehicle]
        if findings:
            self._record(vehicle, findings, now)

    def _record(self, vehicle: Vehicle, findings: list[Finding], now: Instant) -> None:
        refused = [finding.text for finding in findings if finding.refuses]
        text = tuple(finding.text for finding in findings if not finding.refuses)
        self.warnings[vehicle.identity] = (*self.warnings.get(vehicle.identity, ()), *text)
        self._note(now, "parameters", "; ".join([*refused, *text]) or IN_ORDER, vehicle)
        if refused:
            self._refused.append(f"vehicle {vehicle.identity}: {'; '.join(refused)}")


class Starting:
    """Prepares vehicles for flight, at the beginning and after a vehicle restarts."""

    def __init__(
        self,
        vehicles: dict[VehicleId, Vehicle],
        endpoints: tuple[Endpoint, ...],
        flight: Flight,
        preflight: PreFlight,
        takeover: Takeover,
        note: Note,
        give_up: GiveUp,
        *,
        together: bool,
    ) -> None:
        """Start up `vehicles`, the leader first; `endpoints` are where they should be heard.

        With `together`, those that are ready hover until all are, so that none is led past others still climbing.
        """
        self._preflight, self._takeover = preflight, takeover
        self._lacking = dict[VehicleId, str]()
        """What each vehicle was last said to lack."""
        self._vehicles, self._each = vehicles, list(vehicles.values())
        self._endpoints = endpoints
        self._flight = flight
        self._note = note
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
        missed = None if self._takeover.resumed is None else self._takeover.waits_for(now)
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

    def leader_ready(self, leader: PlannedVehicle | None) -> bool:
        """Return whether the leader follows setpoints or, with a virtual leader, whether all vehicles do."""
        needed = self._vehicles.values() if leader is None else (self._vehicles[leader.vehicle_id],)
        return all(vehicle.member is Member.FLYING for vehicle in needed)

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
            self._note(now, "abandoned", f"taken over in {mode} before it was ready: left to its pilot", vehicle)
        may_act = self._takeover.may_act(vehicle, now) and self._preflight.passed
        if not (vehicle.start_up.asks_for_telemetry and vehicle.sampler.why_unknown(now)):
            vehicle.start_up.advance(vehicle.telemetry, vehicle.commands, now, may_act=may_act)
        if self._flight.phase is Phase.FLYING and vehicle.start_up.takes_off:
            vehicle.leave_to_pilot(now)
            self._note(now, "abandoned", "on the ground after the path has begun: left to its pilot", vehicle)
        vehicle.start_up.watch(vehicle.telemetry, now)
        reason = vehicle.start_up.failure(vehicle.commands, now, self._preflight.boot_timeout_s)
        if reason:
            answered = f"{_result(vehicle)}{_lacks(vehicle, now)}{vehicle.telemetry.last_words}"
            self._abandon(vehicle, f"vehicle {vehicle.identity}: {reason}{answered}", now)
        elif vehicle.start_up.waited_s(now) > WAITS_S:
            self._say_what_it_lacks(vehicle, now)
        elif vehicle.start_up.finished:
            self._note(now, "ready", "in the air and following setpoints", vehicle)

    def _say_what_it_lacks(self, vehicle: Vehicle, now: Instant) -> None:
        """Record what a vehicle is waited for that takes long to get ready, once for each thing."""
        lacks = _lacks(vehicle, now)
        if lacks and lacks != self._lacking.get(vehicle.identity):
            self._lacking[vehicle.identity] = lacks
            self._note(now, "waits", f"not ready yet{lacks}{vehicle.telemetry.last_words}", vehicle)

    def _abandon(self, vehicle: Vehicle, text: str, now: Instant) -> None:
        """End the run because a vehicle can't be started; on the path, continue without the vehicle instead."""
        if self._flight.phase is not Phase.FLYING and self._takeover.resumed is None:
            self._give_up(text, now)
        elif not vehicle.start_up.abandoned:
            vehicle.start_up.abandoned = True
            self._note(now, "abandoned", text, vehicle)


def _flies(mode: str) -> str:
    return f"flies already, in {mode}: under somebody's command"


def _is_ready(start_up: StartUp) -> bool:
    """Return whether a vehicle waits only for permission, has begun already, or is left to its pilot."""
    return start_up.held or start_up.acted or start_up.finished or start_up.left


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
    untold = [name for name, told in (("position", seen.motion), ("attitude", seen.attitude)) if told is None]
    why = [f": {seen.position_refused}"] if seen.motion is None and seen.position_refused else []
    return f" (it has told no {' and no '.join(untold)}{''.join(why)})" if untold else ""


def _result(vehicle: Vehicle) -> str:
    refusal, asked = vehicle.commands.refusal, vehicle.commands.under_way
    if refusal is None:
        return ""
    of_message = asked is not None and asked.command == refusal[0] == m.MAV_CMD_SET_MESSAGE_INTERVAL
    which = f" of message {asked.param1:.0f}" if asked is not None and of_message else ""
    return f" ({m.name_of('MAV_CMD', refusal[0])}{which}: {m.name_of('MAV_RESULT', refusal[1])})"

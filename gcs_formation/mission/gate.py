"""What precedes the first command: vehicles are looked at, features examine them, and the operator confirms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

from mypy_extensions import mypyc_attr

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.messages import Message
from airlink.messages.command import ParamValue
from formation_scenario import Scenario
from gcs_formation.mission.restoration import Restoration
from gcs_formation.recorder import GiveUp, LogEvent
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.checks import Finding
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.startup import StartUp
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.vehicle import Vehicle

IN_ORDER = "in order"
SETTLE_S = 1.0
"""Time between the two positions by which features check what a vehicle reports of its motion, s."""
TAKE = "; --take takes it over, --confirm asks"


@dataclass(frozen=True)
class PreFlightOptions:
    """What precedes the first command (change of mode, arming or setpoint)."""

    parameters: bool = False
    """Whether parameters and positions of vehicles are checked."""
    confirm: bool = False
    """Whether to wait for the operator's confirmation when all vehicles are ready."""
    rehearse: bool = False
    """Whether the run ends at that point."""
    set_parameters: bool = False
    """Whether parameters are set that aren't as the check asks for, and restored after the flight."""
    take: bool = False
    """Whether vehicles that fly already under somebody's command are taken over without a question."""


UNCHECKED = PreFlightOptions()


@dataclass(frozen=True)
class AsFound:
    """A vehicle as it is found before the first command, once it is ready."""

    autopilot: Autopilot
    """Its family, for what to set."""
    scenario: Scenario
    """What it is to fly."""
    seen: Telemetry
    """Its newest telemetry, with a position."""
    min_mps: float
    """The lowest airspeed at which it flies."""
    first: ReportedMotion
    """The position that it reported when it became ready, `SETTLE_S` or more before."""
    flies: bool
    """Whether it's in the air already."""


BeforeTakeOff = Callable[[AsFound], list[Finding]]
"""Returns what is wrong with a vehicle before the first command."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Examination(ABC):
    """What a feature asks vehicles before the first command, and finds by their answers."""

    @abstractmethod
    def requests(self, vehicle: Vehicle, now: Instant) -> list[Message]:
        """Return what to ask a vehicle now; judge it once it has answered: `Gate.record`."""

    @abstractmethod
    def receive_parameter(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter reported by a vehicle."""

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether all vehicles have been judged."""

    @abstractmethod
    def objections(self) -> list[str]:
        """Return in words what can't be flown by all that has been found."""


@mypyc_attr(allow_interpreted_subclasses=True)
class AlwaysExamined(ABC):
    """What a feature must know of all vehicles before the first command, where a scenario asks for it."""

    only_warns: bool = False
    """Whether the flight goes on whatever is found: it is resumed, or vehicles are taken over in the air."""

    @property
    @abstractmethod
    def passed(self) -> bool:
        """Whether nothing is found that prevents the take-off."""

    @abstractmethod
    def requests(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return what to ask vehicles now."""

    @abstractmethod
    def take_item(self, vehicle: Vehicle, message: Message, now: Instant) -> None:
        """Take a message of the mission protocol, or a parameter."""

    @abstractmethod
    def refusal(self, *, ready: bool) -> str | None:
        """Return once what is found, None if nothing is, or isn't known yet; `ready`: all vehicles may begin."""


class Gate:
    """Holds all start-ups before their first command until every vehicle may begin."""

    def __init__(
        self,
        scenario: Scenario,
        vehicles: dict[VehicleId, Vehicle],
        caution: PreFlightOptions,
        log_event: LogEvent,
        give_up: GiveUp,
    ) -> None:
        """Prepare to look at `vehicles`, if `caution` asks for it."""
        self.boot_timeout_s, self.vehicles, self._caution = scenario.start.boot_timeout_s, vehicles, caution
        self._scenario, self._log_event, self._give_up = scenario, log_event, give_up
        self._confirmed = not (caution.confirm or caution.rehearse)
        self.passed = self._confirmed and not caution.parameters
        """Whether vehicles may be commanded."""
        self.checks = list[BeforeTakeOff]()
        """What features check of each vehicle once it is ready, in their order."""
        self._examinations, self._always = list[Examination](), list[AlwaysExamined]()
        self._examined = [vehicles[each.vehicle_id] for each in scenario.vehicles] if caution.parameters else []
        """Vehicles to look at."""
        self._min_mps = {each.vehicle_id: each.model.speed_min_mps for each in scenario.vehicles}
        self._first = dict[VehicleId, ReportedMotion]()
        """Each vehicle's position when it became ready."""
        emulated = (each.vehicle_id for each in scenario.vehicles if each.autopilot == "emulator")
        self._nobodys = frozenset(emulated if scenario.start.in_air else ())
        """Vehicles that begin in the air, and so are not under another command."""
        self._placed = set[VehicleId]()
        """Vehicles that have been looked at."""
        self._refused, self._gave_up = list[str](), False
        """What prevents the take-off, in words, and whether that has ended the run."""
        self.restoration = Restoration(vehicles, log_event)
        """What has been set, and gets its values back."""
        self.warnings: dict[VehicleId, tuple[str, ...]] = {}
        """Findings that don't prevent the take-off."""

    @property
    def examines(self) -> bool:
        """Whether vehicles are looked at before the first command."""
        return bool(self._examined)

    @property
    def sets_parameters(self) -> bool:
        """Whether parameters of vehicles on the ground may be set."""
        return self._caution.set_parameters and not self._caution.rehearse

    @property
    def says_what_to_set(self) -> bool:
        """Whether it is only said which parameters would be set."""
        return self._caution.set_parameters and self._caution.rehearse

    def hold(self, examination: AlwaysExamined) -> None:
        """Hold all start-ups until an examination is over that every flight has, emulated ones too."""
        self._always.append(examination)
        self.passed = False

    def let_go_on(self) -> None:
        """Let a flight go on that has begun before, whatever such examinations find."""
        for each in self._always:
            each.only_warns = True
        self.passed = self.passed or (self._confirmed and not self._examined)

    def take_item(self, vehicle: Vehicle, message: Message, now: Instant) -> None:
        """Take a message of the mission protocol, or a parameter."""
        for each in self._always:
            each.take_item(vehicle, message, now)

    def add(self, examination: Examination) -> None:
        """Let vehicles be examined before the first command."""
        self._examinations.append(examination)

    def open_if_ready(self) -> None:
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
        looked_at = len(self._placed) == len(self._examined)
        examined = all(each.complete for each in self._examinations) and all(each.passed for each in self._always)
        return looked_at and examined and not self._refused

    def confirm(self) -> None:
        """Record the operator's confirmation."""
        self._confirmed = True

    def requests(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return the requests to send now; look at vehicles, and end the run once all is known that prevents it."""
        found = list[tuple[Vehicle, Message]]()
        for vehicle in self._examined:
            if vehicle.identity not in self._placed:
                self._look_at(vehicle, now)
            for each in self._examinations:
                found += [(vehicle, request) for request in each.requests(vehicle, now)]
        for always in self._always:
            found += always.requests(now)
        if (self._examined or self._always) and not (self.passed or self._gave_up) and self._complete:
            refused = [*self._refused, *self._unasked(), *self._objections(), *self._found_always(now)]
            self._gave_up = bool(refused)
            if refused:
                self._give_up("; ".join(refused), now)
        return found

    @property
    def _complete(self) -> bool:
        """Whether all is known: an operator who mends one vehicle's parameters wants to know of all."""
        if not self._examinations:
            return len(self._placed) == len(self._examined)
        return all(each.complete for each in self._examinations)

    def _found_always(self, now: Instant) -> list[str]:
        """Return in words what such examinations find; of vehicles taken over it is only said."""
        found = list[str]()
        for each in self._always:
            each.only_warns |= bool(self.flown_by_others)
            refusal = each.refusal(ready=self._ready)
            if each.only_warns and refusal is not None:
                self._log_event(now, "parameters", refusal)
            elif refusal is not None:
                found.append(refusal)
        return found

    def _objections(self) -> list[str]:
        """Return in words what can't be flown by what was found, unless a vehicle flies already."""
        if self._refused or any(each.airborne for each in self.vehicles.values()):
            return []
        return [text for each in self._examinations for text in each.objections()]

    def _unasked(self) -> list[str]:
        """Return in words which vehicles would be taken, unasked, from those who fly them."""
        if self._may_take:
            return []
        return [f"vehicle {each.identity} {_flies(mode)}{TAKE}" for each, mode in self.flown_by_others]

    def receive_parameter(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter reported by a vehicle."""
        self.restoration.take(vehicle, message, now)
        for each in self._examinations:
            each.receive_parameter(vehicle, message, now)

    def _look_at(self, vehicle: Vehicle, now: Instant) -> None:
        """Record what is found of a vehicle once it is ready and so knows its home."""
        motion = vehicle.telemetry.motion
        if motion is None:
            return
        if not _is_ready(vehicle.start_up):
            self._first[vehicle.identity] = (
                motion  # an ArduPilot without a fix has positions near 0, 0 until it has one
            )
            return
        first = self._first.setdefault(vehicle.identity, motion)
        if self.checks and motion.stamp_s - first.stamp_s < SETTLE_S:
            return
        self._placed.add(vehicle.identity)
        autopilot, seen, min_mps = vehicle.autopilot, vehicle.telemetry, self._min_mps[vehicle.identity]
        found = AsFound(autopilot, self._scenario, seen, min_mps, first, vehicle.airborne)
        findings = [finding for check in self.checks for finding in check(found)]
        findings += [Finding(_flies(mode)) for each, mode in self.flown_by_others if each is vehicle]
        if findings:
            self.record(vehicle, findings, now)

    def record(self, vehicle: Vehicle, findings: list[Finding], now: Instant) -> None:
        """Record what was found of a vehicle; what refuses the take-off ends the run once all is known."""
        refused = [finding.text for finding in findings if finding.refuses]
        text = tuple(finding.text for finding in findings if not finding.refuses)
        self.warnings[vehicle.identity] = (*self.warnings.get(vehicle.identity, ()), *text)
        self._log_event(now, "parameters", "; ".join([*refused, *text]) or IN_ORDER, vehicle)
        if refused:
            self._refused.append(f"vehicle {vehicle.identity}: {'; '.join(refused)}")


def _flies(mode: str) -> str:
    return f"flies already, in {mode}: under somebody's command"


def _is_ready(start_up: StartUp) -> bool:
    """Return whether a vehicle waits only for permission, has begun already, or is left to its pilot."""
    return start_up.held or start_up.acted or start_up.finished or start_up.left

"""What a program does to a flight between control ticks: carried out now, or again from where run.yaml records it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterator
from operator import attrgetter, itemgetter
from typing import Any

from pydantic import ValidationError

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import VehicleId
from formation_scenario import Scenario, ScenarioError
from formation_scenario.error_messages import problems_of
from formation_scenario.extension_keys import IN_ACTS, with_parameters
from formation_scenario.fields import refused
from formation_scenario.links import LinkChange
from formation_scenario.orders import Answer
from formation_scenario.rules import refused_act
from formation_scenario.scripted import REPLACED, ScriptedFault, ScriptedOrder
from formation_scenario.slot_assignment import ids_by_index
from formation_scenario.source import Source, plain_mapping
from formation_scenario.surroundings import Disturbance, Fault
from gcs_formation.app.link_injection import LinkSchedule
from gcs_formation.extend.cycle import Wanted
from gcs_formation.recorder import Event, Recorder
from gcs_formation.station import Station

Strike = Callable[[ScriptedOrder, frozenset[VehicleId], Instant], None]
"""Passes a fault or a disturbance, whose times count from an instant, to the emulators of some vehicles."""
Moment = tuple[Instant, VehicleId, str, bool]
"""When a fault begins or ends, of which vehicle, its kind, and whether it ends."""


UNCHANGED = Answer(True, "it is so already")


class Script:
    """Carries out what a program does, and what the scenario says that one did, each after its control tick."""

    def __init__(
        self,
        scenario: Scenario,
        station: Station,
        recorder: Recorder,
        links: tuple[LinkSchedule, Callable[[LinkSchedule], None]],
        *,
        repeats: bool,
    ) -> None:
        """Begin before the first tick.

        `links`: their schedule, and what is called after it has changed; `repeats`: whether what the scenario records
        is done again.
        """
        self._scenario, self._station, self._recorder, self._links = scenario, station, recorder, links
        recorded = (act for _, act in scenario.scripted if repeats)
        self._recorded = deque(sorted(recorded, key=attrgetter("at_tick")))
        self._moments: list[Moment] = []
        self._done: list[tuple[Instant, ScriptedOrder]] = []
        self._new: list[ScriptedOrder] = []
        self._lasting = set[tuple[str, str, VehicleId]]()
        """Faults that were injected for good, of each vehicle."""
        self._replaces_since = dict[int, Instant]()
        """When the program replaced a setpoint first, of each vehicle."""
        self.emulators: Strike | None = None
        """Reaches the emulated vehicles; None where there are none."""
        self.refuses_faults = False
        """Whether the vehicles are real autopilots in our air, which have no emulated faults."""

    def replace(self, index: int, wanted: Wanted, now: Instant) -> None:
        """Command a vehicle otherwise than the law does, until `keep_replaced` without it.

        Values aren't recorded: run.yaml says that this flight needs its program.
        """
        if not self._replaces_since:
            self._new.append(ScriptedOrder(at_tick=self._station.recorded_ticks, setpoints=REPLACED))
        if index not in self._replaces_since:
            identity = ids_by_index(self._scenario)[index]
            self._recorder.event(Event(now, "script", "its setpoint is replaced by the program", identity))
        self._replaces_since.setdefault(index, now)
        self._station.controller.outside(self._station.scenario).by_program[index] = wanted

    @property
    def replaces(self) -> bool:
        """Whether a program has replaced any setpoint."""
        return bool(self._replaces_since)

    def keep_replaced(self, indices: Collection[int]) -> None:
        """Give all vehicles but some back to the law."""
        replaced = self._station.controller.outside(self._station.scenario).by_program
        for index in [each for each in replaced if each not in indices]:
            del replaced[index]

    @property
    def pending(self) -> bool:
        """Whether anything that was recorded, or a moment of a fault, is still to come."""
        return bool(self._recorded or self._moments)

    def attend(self, now: Instant) -> None:
        """Carry out what was recorded up to this tick, and report faults that are due."""
        while self._recorded and self._recorded[0].at_tick <= self._station.recorded_ticks:
            self._carry_out(self._recorded.popleft(), now)
        while self._moments and self._moments[0][0] <= now:
            _, vehicle, kind, ends = self._moments.pop(0)
            text = f"{kind} is over" if ends else kind
            self._recorder.event(Event(now, "fault", text, vehicle, {"fault": kind, "ends": ends}))

    def do(self, act: ScriptedOrder, now: Instant) -> Answer:
        """Carry out what a program does now, and keep it for run.yaml unless everything is so already.

        Raises:
            ScenarioError: links can't be changed like that.
        """
        answer = self._carry_out(act, now)
        if answer is not UNCHANGED:
            self._new.append(act)
        return answer

    @property
    def has_new(self) -> bool:
        """Whether a program has done anything that the scenario doesn't record."""
        return bool(self._new)

    def recorded(self) -> Scenario:
        """Return the scenario with everything that a program did, so that it repeats the flight."""
        return self._scenario.model_copy(update={"orders": (*self._scenario.orders, *self._new)})

    def as_planned(self) -> Scenario:
        """Return the scenario as if what was done to links, vehicles and air had been planned by mission time.

        By this a flight is judged: a vehicle that a program crashed isn't missing. Before t = 0 counts as 0.
        """
        began = self._station.flight.path_began
        if began is None or not self._done:
            return self._scenario
        links, faults, air = list[LinkChange](), list[Fault](), list[Disturbance]()
        for at, act in self._done:
            zero_s = seconds_between(began, at)
            if act.link is not None:
                links.append(LinkChange(at_s=max(0.0, zero_s), **dict(act.link)))
            if act.fault is not None:
                faults.append(Fault.model_validate(_moved(act.fault, zero_s)))
            if act.disturbance is not None:
                air.append(act.disturbance.model_copy(update=_moved(act.disturbance, zero_s)))
        changed = self._scenario.links.model_copy(update={"changes": (*self._scenario.links.changes, *links)})
        added = {"faults": (*self._scenario.faults, *faults), "disturbances": (*self._scenario.disturbances, *air)}
        return self._scenario.model_copy(update={"links": changed, **added})

    def _carry_out(self, act: ScriptedOrder, now: Instant) -> Answer:
        if act.order is not None:
            return self._station.orders.execute(act.order, now)
        if act.link is not None:
            schedule, changed = self._links
            if not schedule.change(act.link):
                return UNCHANGED
            changed(schedule)
            self._log_event("link of", act.link.vehicles, dict(_given(act)), now)
        hit = act.fault or act.disturbance
        if hit is not None and self.emulators is not None:
            if act.fault is not None and self.refuses_faults:
                raise refused("fault.kind", f"found {act.fault.kind} of a real autopilot", "one of emulated vehicles")
            identities = frozenset(each.vehicle_id for each in self._scenario.selected(hit.vehicles))
            if act.fault is not None and self._lasts_already(act.fault, identities):
                return UNCHANGED
            self.emulators(act, identities, now)
            if act.fault is not None:
                self._moments += _moments(act.fault, identities, now)
                self._moments.sort(key=itemgetter(0))
            else:
                self._log_event("disturbance of", hit.vehicles, dict(_given(act)), now)
        self._done.append((now, act))
        return Answer(True, "done")

    def _lasts_already(self, fault: ScriptedFault, hit: frozenset[VehicleId]) -> bool:
        """Return whether the vehicles have this fault for good; a restart ends what they have."""
        if fault.kind == "restart":
            self._lasting.clear()
        if fault.kind == "restart" or fault.at_s > 0.0 or fault.end_s < math.inf:
            return False
        lasting = {(fault.kind, str(fault.own_keys), vehicle) for vehicle in hit}
        known = lasting <= self._lasting
        self._lasting |= lasting
        return known

    def _log_event(self, what: str, whose: object, keys: dict[str, object], now: Instant) -> None:
        names = "all" if whose == "all" else ", ".join(map(str, whose if isinstance(whose, tuple) else (whose,)))
        given = ", ".join(f"{name} {value}" for name, value in keys.items())
        self._recorder.event(Event(now, "script", f"{what} {names}: {given}"))


def scripted(scenario: Scenario, keys: dict[str, Any]) -> ScriptedOrder:
    """Return what a program or the page does, checked as the scenario's keys are; of tick 0.

    Raises:
        ScenarioError: no such vehicle or key, or a value that isn't allowed.
    """
    given = Source(None, plain_mapping({"at_tick": 0} | keys))
    source, problems = with_parameters(given, scenario.registered, IN_ACTS)
    try:
        act = ScriptedOrder.model_validate(source.data)
    except ValidationError as error:
        raise ScenarioError([*problems, *problems_of(error, ScriptedOrder, source)]) from error
    if problems:
        raise ScenarioError(problems)
    wrong = refused_act(scenario, act)
    if wrong:
        path, found, allowed = wrong[0]
        raise refused(".".join(map(str, path[2:])), found, allowed)
    return act


def _given(act: ScriptedOrder) -> Iterator[tuple[str, object]]:
    part = act.link or act.disturbance
    if part is not None:
        yield from part.model_dump(exclude={"vehicles"}, exclude_none=True, exclude_defaults=True).items()


def _moments(fault: ScriptedFault, hit: frozenset[VehicleId], zero: Instant) -> Iterator[Moment]:
    for at_s, ends in fault.moments():
        yield from ((after(zero, at_s), vehicle, fault.kind, ends) for vehicle in sorted(hit))


def _moved(entry: Fault | Disturbance, by_s: float) -> dict[str, object]:
    """Return an entry's keys with its times since a tick as mission times."""
    keys = dict(entry)
    keys["at_s"] = max(0.0, entry.at_s + by_s)
    if entry.until_s is not None:
        keys["until_s"] = max(1e-9, entry.until_s + by_s)
    return keys

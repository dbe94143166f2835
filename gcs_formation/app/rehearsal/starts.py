"""How long a start takes until the formation is assembled: flown, with several seeds where chance decides it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from airlink.clock import NANOSECONDS
from formation_scenario import Scenario
from gcs_formation.app.rehearsal.flying import flown
from gcs_formation.app.session import Session
from gcs_formation.guidance.leader_guidance import DECISION_S
from gcs_formation.phases import Phase

STARTS: Final = 5
"""Starts that are flown where chance decides how long one takes; one otherwise."""
LONG_RUN_IN_S: Final = 120.0
"""Run-in on which the time to assemble is found where the scenario's is too short."""


class Start(NamedTuple):
    """One start, as it was flown."""

    flown_s: float
    assembled_s: float | None
    """When every follower had kept its slot for long enough, since the first datagram, s; None: not while it was flown.
    """
    used_s: float | None
    """How long a run-in the leader had flown by the tick after that, as its guidance sees it, s; None on another route.
    """
    went_round: bool
    """Whether the leader began a holding pattern before its path."""


class Starts(NamedTuple):
    """The starts that were flown."""

    each: tuple[Start, ...]
    in_air: bool

    def __str__(self) -> str:
        """Return them in words."""
        flown_s, at_s = ", ".join(f"{each.flown_s:.0f}" for each in self.each), self.assembled_s
        came = "not assembled within that" if at_s is None else f"assembled after {at_s:.1f} s"
        return (
            f"{len(self.each)} starts of {flown_s} s: {came}" if len(self.each) > 1 else f"a start, {flown_s} s: {came}"
        )

    @property
    def assembled_s(self) -> float | None:
        """The longest time to assemble, s; None if a start didn't show any."""
        times_s = [start.assembled_s for start in self.each]
        known = [each for each in times_s if each is not None]
        return max(known) if known and len(known) == len(times_s) else None

    @property
    def min_run_in_s(self) -> float | None:
        """The shortest run-in after which the path would have begun at once in each of them, s; None if unknown."""
        used_s = [start.used_s for start in self.each]
        known = [each for each in used_s if each is not None]
        return max(known) + DECISION_S if self.in_air and known and len(known) == len(used_s) else None


def goes_round(scenario: Scenario, found: Starts, pattern_s: float) -> str | None:
    """Return why the leader will fly a holding pattern before the path; None if the run-in suffices, or it waits."""
    run_in_s, min_s = scenario.start.run_in_s, found.min_run_in_s
    if scenario.hovers or not found.in_air or (min_s is not None and run_in_s >= min_s):
        return None
    if min_s is None and not any(each.went_round for each in found.each):
        return None  # not flown for long enough
    late = [each for each in found.each if each.used_s is None or each.used_s + DECISION_S > run_in_s]
    sure = f" ({len(late)} of {len(found.each)} starts flown ahead did not)" if len(found.each) > 1 else ""
    allowed = "longer" if min_s is None else f"{math.ceil(round(10 * min_s, 6)) / 10:g} or more"
    return (
        f"start.run_in_s: found {run_in_s:g}; allowed: {allowed} for the path to begin at once{sure}; else the leader "
        f"goes round first, for about {pattern_s:.0f} s"
    )


def starts(scenario: Scenario, over: Callable[[], bool]) -> Starts:
    """Fly starts until time is `over`, at least the first one's beginning."""
    planned, found = scenario.model_copy(update={"faults": (), "orders": (), "expect": ()}), list[Start]()
    if scenario.start.in_air and scenario.fence is None:
        longer = scenario.start.model_copy(update={"run_in_s": max(scenario.start.run_in_s, LONG_RUN_IN_S)})
        planned = planned.on_same_path({"start": longer})
    for seed in range(scenario.seed, scenario.seed + (STARTS if _by_chance(scenario) else 1)):
        found.append(_start(planned.on_same_path({"seed": seed}), over))
        if over():
            break
    cut = len(found) > 1 and found[-1].assembled_s is None and over()
    return Starts(tuple(found[:-1] if cut else found), scenario.start.in_air)


def _start(scenario: Scenario, over: Callable[[], bool]) -> Start:
    found = Start(0.0, None, None, went_round=False)

    def enough(session: Session) -> bool:
        nonlocal found
        phase, controller = session.station.flight.phase, session.station.controller
        guidance, now_s = controller.guidance, session.clock.now() / NANOSECONDS
        found = found._replace(went_round=guidance.rounds > 0)
        if phase is Phase.CONNECTING or (phase is Phase.ASSEMBLING and not controller.assembly.complete):
            return over()
        used_s = (scenario.run_in_m + guidance.distance_m) / scenario.path.begin_mps + 1.0 / scenario.law.rate_hz
        found = found._replace(assembled_s=now_s, used_s=used_s if guidance.on_path and not found.went_round else None)
        return True

    flown_s = flown(scenario, enough).seconds
    return found._replace(flown_s=flown_s)


def _by_chance(scenario: Scenario) -> bool:
    links = [each for vehicle in scenario.vehicles for each in scenario.link_steps(vehicle)[0][1:]]
    return any(each.loss > 0.0 or each.jitter_ms > 0.0 or each.recording is not None for each in links)

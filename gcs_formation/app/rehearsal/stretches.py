"""Which stretch of a flight is rehearsed: from when gusts, delays and losses are worst, as things stand by then."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from flight_model.path import FlightPath
from formation_scenario import Scenario
from formation_scenario.formation import Formation
from formation_scenario.mean_delays import mean_delays_s
from formation_scenario.planned_progress import planned_end_s, planned_m
from formation_scenario.surroundings import DrydenTurbulence

RUN_IN_S, ROUND_TRIPS, LOST_S = 4.0, 7.0, 60.0
"""Straight flight before a stretch, s, and more for each round trip and for the share that is lost, in which the
station finds the vehicles and asks for their telemetry: with less the leader passes the path's start too soon, and goes
round. Found by flights with four vehicles, 0 to 300 ms and up to 30 % loss."""
SHORTEST_S: Final = 20.0
"""A stretch begins at least so long before the flight's end, s."""


class Severity(NamedTuple):
    """How bad things are at a mission time; they are compared in this order."""

    gusts: float
    """Turbulence along the path, rms, m/s, times the time for which it acts unanswered, s."""
    delay_s: float
    """Longest round trip."""
    loss: float


def worst_s(scenario: Scenario) -> float:
    """Return the mission time from which on a flight is worst, s; 0 if nothing changes for the worse."""
    latest_s = max(0.0, planned_end_s(scenario) - SHORTEST_S)
    changes_s = {each.at_s for each in scenario.links.changes} | {each.at_s for each in scenario.disturbances}
    moments_s = sorted({0.0, *(min(at_s, latest_s) for at_s in changes_s)})
    return max(moments_s, key=lambda at_s: (_severity(scenario, at_s), -at_s))


def gusting(scenario: Scenario, mission_s: float) -> Iterator[tuple[int, DrydenTurbulence]]:
    """Yield the turbulence that acts at a mission time, with its index in `disturbances`."""
    for index, each in enumerate(scenario.disturbances):
        if isinstance(each, DrydenTurbulence) and each.acts(mission_s):
            yield index, each


def _severity(scenario: Scenario, at_s: float) -> Severity:
    height_m = np.array([min(height_m for _, _, height_m in scenario.path.waypoints_m)])
    gusts_mps = sum(float(each.scales(height_m)[0][0, 0]) for _, each in gusting(scenario, at_s))
    steps = [[step for step in scenario.link_steps(vehicle) if step.at_s <= at_s][-1] for vehicle in scenario.vehicles]
    delay_s = max(sum(mean_delays_s(scenario, step)) for step in steps)
    loss = max(each.loss for step in steps for each in step[1:])
    return Severity(gusts_mps * (delay_s + 1.0 / scenario.law.rate_hz), delay_s, loss)


def from_there(scenario: Scenario, at_s: float, min_run_in_s: float = 0.0) -> Scenario:
    """Return the flight from a mission time on: in slots, in the air, by links and air as they are by then.

    Faults and orders are left out: they have expected errors of their own. Multirotors with a timetable of corners fly
    their path from its start. `min_run_in_s`: what a start in the air is known to need.
    """
    found = _severity(scenario, at_s)
    run_in_s = max(RUN_IN_S + ROUND_TRIPS * found.delay_s + LOST_S * found.loss, min_run_in_s)
    begin = {"in_air": True, "run_in_s": run_in_s, "timeout_s": 1e-3, "offset_m": (0.0, 0.0, 0.0)}
    update = {
        "start": scenario.start.model_copy(update=begin),
        "formation": _formation(scenario.formation, at_s),
        "links": scenario.links.model_copy(update={"changes": tuple(_later(scenario.links.changes, at_s))}),
        "disturbances": tuple(_later(scenario.disturbances, at_s)),
        "faults": (),
        "orders": (),
        "expect": (),
    }
    from_m = float(planned_m(scenario, np.array(at_s)))
    if from_m <= 0.0 or scenario.hovers:
        return scenario.on_same_path(update)
    speed_mps = scenario.speeds.at(from_m)[0]
    path = scenario.path.model_copy(update={"speed_mps": speed_mps, "kind": "spline"})
    copied = scenario.model_copy(update={**update, "path": path})
    vars(copied)["written_path"] = _rest(scenario.written_path, from_m)
    return copied


def _later(entries: Sequence[Any], at_s: float) -> Iterator[Any]:
    """Yield what is still to come, or goes on, with its times counted from `at_s`."""
    for each in entries:
        until_s = getattr(each, "until_s", None)
        if until_s is None or until_s > at_s:
            ends = {} if until_s is None else {"until_s": until_s - at_s}
            yield each.model_copy(update={"at_s": max(0.0, each.at_s - at_s), **ends})


def _formation(formation: Formation, at_s: float) -> Formation:
    """Return the formation with the shape and spacing that it has by then, and the changes that are still to come."""
    past = {"changes": tuple(_later([each for each in formation.changes if each.at_s > at_s], at_s))}
    now: dict[str, Any] = {}
    for each in formation.changes:
        if each.at_s > at_s:
            continue
        if each.shape is not None:
            now |= {"shape": each.shape, "spacing_m": each.spacing_m or formation.spacing_m}
        given = {name: getattr(each, name) for name in ("parameters", "spacing_m", "slots_m")}
        now |= {name: value for name, value in given.items() if value is not None}
    return formation.model_copy(update={**now, **past})


def _rest(path: FlightPath, from_m: float) -> FlightPath:
    """Return a path from the node of its curve before `from_m` on."""
    first = max(0, int(np.searchsorted(path.nodes_m, from_m, side="right")) - 1)
    first = min(first, len(path.coefficients) - 1)
    begin_m = float(path.nodes_m[first])
    passed = path.waypoints_at_m[path.waypoints_at_m >= begin_m] - begin_m
    rest = FlightPath(path.nodes_m[first:] - begin_m, passed, path.coefficients[first:])
    rest.turns_in_place = tuple(
        each._replace(at_m=each.at_m - begin_m) for each in path.turns_in_place if each.at_m >= begin_m
    )
    return rest

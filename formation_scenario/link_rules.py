"""Rules between the keys of links: recorded delays, bursts of losses, changes and how many of them."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flight_model.path import PathError
from formation_scenario.fields import FileError, Timed
from formation_scenario.links import (
    DefaultLink,
    Impairment,
    ImpairmentPatch,
    LinkChange,
    Links,
    min_mean_burst,
)
from formation_scenario.model import Scenario
from formation_scenario.orders import read_order
from formation_scenario.source import Finding, KeyPath
from formation_scenario.traces.keys import Trace
from formation_scenario.traces.reading import ALLOWED
from formation_scenario.vehicles import Vehicle

MAX_LINK_STATES = 400_000
"""Changes of links times vehicles: `check` takes some 5 s for as many."""
MAX_SLOT_CHANGES = 10_000
"""Changes of the formation, also by orders, times vehicles and `PLANNING_VEHICLES`: the same, on `USUAL_PATH_M`."""
USUAL_PATH_M = 50e3
"""Each slot is checked all along the path."""
PLANNING_VEHICLES = 13
"""As many vehicles' slots take as long to check as a change without its vehicles."""


def traces(scenario: Scenario) -> Iterator[Finding]:
    """Yield records of delays that can't be read, in both forms, or with two sources of their times."""
    found = dict[Trace, str | None]()
    for path, patch in _link_groups(scenario):
        trace = patch.trace or (None if patch.trace_file is None else Trace(file=patch.trace_file))
        if trace is None:
            continue
        if patch.trace is not None and patch.trace_file is not None:
            yield (*path, "trace_file"), "found it beside trace", "one of them"
        if trace.time is not None and trace.period_s is not None:
            yield (*path, "trace", "period_s"), "found it beside time", "one of them"
        if trace not in found:
            found[trace] = _unreadable(scenario, trace)
        if (error := found[trace]) is not None:
            yield (*path, *(("trace", "file") if patch.trace is not None else ("trace_file",))), error, ALLOWED


def _unreadable(scenario: Scenario, trace: Trace) -> str | None:
    """Return why a record of delays can't be read; None if it can."""
    try:
        scenario.recorded_delays(trace)
    except FileError as error:
        return str(error)
    return None


def _link_groups(scenario: Scenario) -> Iterator[tuple[KeyPath, Impairment | ImpairmentPatch]]:
    """Yield every group of keys with properties of links, and its key path."""
    links = scenario.links
    groups: dict[KeyPath, DefaultLink | Links | LinkChange] = {("links", "default"): links.default, ("links",): links}
    groups |= {("links", "changes", index): change for index, change in enumerate(links.changes)}
    for path, group in groups.items():
        each = {path: group, (*path, "uplink"): group.uplink, (*path, "downlink"): group.downlink}
        yield from ((at, patch) for at, patch in each.items() if isinstance(patch, Impairment | ImpairmentPatch))


def bursts(scenario: Scenario) -> Iterator[Finding]:
    """Yield bursts of losses too short for the share that is lost."""
    refused: set[KeyPath] = set()
    for vehicle, number in scenario.each_link():
        steps = scenario.own_link_steps(vehicle, number)
        for path, step in zip(_step_paths(scenario, vehicle, number), steps, strict=True):
            for direction, link in (("uplink", step.uplink), ("downlink", step.downlink)):
                minimum = min_mean_burst(link.loss)
                if link.mean_burst is not None and link.mean_burst < minimum and path not in refused:
                    refused.add(path)
                    whose = f"{direction} of vehicle {vehicle.vehicle_id}"
                    found = f"found {link.mean_burst:g} with a loss of {link.loss:g} ({whose})"
                    allowed = (
                        f"{minimum:g} or more with that loss" if minimum < math.inf else "a loss below 1 beside it"
                    )
                    yield (*path, "mean_burst"), found, allowed


def _step_paths(scenario: Scenario, vehicle: Vehicle, number: int) -> list[KeyPath]:
    """Return where each step of a vehicle's link is written; the last of several changes at the same time."""
    paths: dict[float, KeyPath] = {0.0: ("links", "default")}
    for index, change in enumerate(scenario.links.changes):
        whose = change.vehicles == "all" or any(ref in change.vehicles for ref in vehicle.refs)
        if whose and change.link in (None, number):
            paths[change.at_s] = ("links", "changes", index)
    return [paths[at_s] for at_s in sorted(paths)]


def link_changes(scenario: Scenario) -> Iterator[Finding]:
    """Yield changes of links that change nothing."""
    for index, change in enumerate(scenario.links.changes):
        given = change.model_dump(exclude={"at_s", "vehicles"}, exclude_none=True)
        if all(value == {} for value in given.values()):
            keys = ", ".join(key for key in LinkChange.model_fields if key not in Timed.model_fields)
            yield ("links", "changes", index), "found a change of nothing", f"one or more of {keys}"


def sizes(scenario: Scenario) -> Iterator[Finding]:
    """Yield changes that are too many for so many vehicles: each is planned or checked for each vehicle."""
    count, length_m = len(scenario.vehicles), _written_m(scenario)
    whose, planned = f"with {count} vehicles", len(scenario.formation.changes)
    ordered = sum(read_order(each.order).change is not None for _, each in scenario.timed_orders)
    longer = max(1.0, length_m / USUAL_PATH_M)
    maximum = int(MAX_SLOT_CHANGES / longer / (count + PLANNING_VEHICLES))
    there = whose if longer == 1.0 else f"{whose} on a path of {length_m / 1e3:.0f} km"
    further = f" beside {planned} changes" if planned else ""
    for path, found, what, allowed, more in (
        (("links", "changes"), len(scenario.links.changes), f"changes {whose}", MAX_LINK_STATES // count, ""),
        (("formation", "changes"), planned, f"changes {there}", maximum, ""),
        (("orders",), ordered, f"orders that change the formation {there}", max(maximum - planned, 0), further),
    ):
        if found > allowed:
            yield path, f"found {found} {what}", f"up to {allowed} with so many{more}"


def _written_m(scenario: Scenario) -> float:
    """Return the path's length; 0 of one that is refused."""
    try:
        return scenario.written_path.length_m
    except PathError:
        return 0.0

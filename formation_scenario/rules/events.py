"""Rules for links, for what happens during a flight, and for what is expected of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

from flight_model.path import PathError
from formation_scenario.environment import PASSING, DrydenTurbulence
from formation_scenario.errors import Problem
from formation_scenario.expectation import RUN_METRICS
from formation_scenario.fields import VehicleSelection
from formation_scenario.flight_time import latest_end_s
from formation_scenario.links import (
    ALLOWED,
    DefaultLink,
    Impairment,
    ImpairmentPatch,
    LinkChange,
    Links,
    TraceError,
    least_mean_burst,
    read_trace_ms,
)
from formation_scenario.model import Scenario
from formation_scenario.rules.vehicles import one_vehicle
from formation_scenario.source import KeyPath, Source
from formation_scenario.vehicles import Vehicle


def traces(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield files of recorded delays that can't be read."""
    for path, patch in _link_groups(scenario):
        if patch.trace_file is not None:
            try:
                read_trace_ms(Path(patch.trace_file))
            except TraceError as error:
                yield source.problem((*path, "trace_file"), str(error), ALLOWED)


def bursts(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield bursts of losses too short for the share that is lost."""
    refused: set[KeyPath] = set()
    for vehicle in scenario.vehicles:
        for path, step in zip(_step_places(scenario, vehicle), scenario.link_steps(vehicle), strict=True):
            for way, link in (("uplink", step.uplink), ("downlink", step.downlink)):
                least = least_mean_burst(link.loss)
                if link.mean_burst is not None and link.mean_burst < least and path not in refused:
                    refused.add(path)
                    whose = f"{way} of vehicle {vehicle.vehicle_id}"
                    found = f"found {link.mean_burst:g} with a loss of {link.loss:g} ({whose})"
                    allowed = f"{least:g} or more with that loss" if least < math.inf else "a loss below 1 beside it"
                    yield source.problem((*path, "mean_burst"), found, allowed)


def _link_groups(scenario: Scenario) -> Iterator[tuple[KeyPath, Impairment | ImpairmentPatch]]:
    """Yield every group of keys that says what a link is like, and its place."""
    links = scenario.links
    above: list[tuple[KeyPath, DefaultLink | Links | LinkChange]] = [(("links", "default"), links.default)]
    above += [(("links",), links)]
    above += [(("links", "changes", index), change) for index, change in enumerate(links.changes)]
    for path, group in above:
        if not isinstance(group, Links):
            yield path, group
        for direction, patch in (("uplink", group.uplink), ("downlink", group.downlink)):
            if patch is not None:
                yield (*path, direction), patch


def _step_places(scenario: Scenario, vehicle: Vehicle) -> list[KeyPath]:
    """Return where each of a vehicle's link steps is written; of several changes at one time, the last."""
    places: dict[float, KeyPath] = {0.0: ("links", "default")}
    for index, change in enumerate(scenario.links.changes):
        if vehicle in scenario.selected(change.vehicles):
            places[change.at_s] = ("links", "changes", index)
    return [places[at_s] for at_s in sorted(places)]


def references(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield vehicles that links, disturbances, faults and expectations name and that don't exist."""
    groups: tuple[tuple[KeyPath, Iterable[VehicleSelection]], ...] = (
        (("links", "changes"), (change.vehicles for change in scenario.links.changes)),
        (("disturbances",), (entry.vehicles for entry in scenario.disturbances)),
        (("faults",), (entry.vehicles for entry in scenario.faults)),
    )
    for path, selections in groups:
        for index, selection in enumerate(selections):
            yield from _unknown(selection, scenario.vehicles, (*path, index, "vehicles"), source)
    for index, entry in enumerate(scenario.expect):
        path = ("expect", index, "followers")
        yield from _unknown(entry.followers, scenario.followers, path, source)


def disturbances(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield disturbances that end before they begin, and turbulence without its intensity."""
    for index, entry in enumerate(scenario.disturbances):
        path: KeyPath = ("disturbances", index)
        if entry.end_s <= entry.at_s:
            yield source.problem((*path, "until_s"), f"found {entry.end_s:g}", f"more than at_s, {entry.at_s:g}")
        if isinstance(entry, DrydenTurbulence):
            given = {name for name in ("wind_6m_mps", "sigma_mps", "length_m") if getattr(entry, name) is not None}
            if given not in ({"wind_6m_mps"}, {"sigma_mps", "length_m"}):
                found = f"found {', '.join(sorted(given)) or 'neither'}"
                yield source.problem(path, found, "wind_6m_mps, or sigma_mps and length_m")


def faults(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield faults with an end or a mode that their kind doesn't have."""
    for index, fault in enumerate(scenario.faults):
        path: KeyPath = ("faults", index)
        if fault.until_s is not None and fault.kind not in PASSING:
            yield source.problem(
                (*path, "until_s"), f"found an end of a {fault.kind}", f"only for {', '.join(PASSING)}"
            )
        elif fault.until_s is not None and fault.until_s <= fault.at_s:
            yield source.problem((*path, "until_s"), f"found {fault.until_s:g}", f"after at_s, {fault.at_s:g}")
        if fault.mode is not None and fault.kind != "pilot":
            yield source.problem((*path, "mode"), f"found a mode for a {fault.kind}", "only for pilot")


def expectations(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield expectations without a bound, with a window that is empty or never flown, or that nothing could meet."""
    end_s = _latest_end_s(scenario)
    for index, entry in enumerate(scenario.expect):
        if entry.below is None and entry.above is None:
            yield source.problem(("expect", index), "found no bound", "below, above or both")
        if entry.from_s >= entry.to_s:
            found = f"found a window from {entry.from_s:g} to {entry.to_s:g} s"
            yield source.problem(("expect", index, "from_s"), found, "from_s before to_s")
        elif entry.from_s >= end_s:
            allowed = f"less than {end_s:.1f} s, when the flight is over at the latest"
            yield source.problem(("expect", index, "from_s"), f"found {entry.from_s:g}", allowed)
        if entry.metric in RUN_METRICS and entry.followers != "all":
            found = f"found followers for {entry.metric}, a figure of the whole run"
            yield source.problem(("expect", index, "followers"), found, "all")
        if (entry.below if entry.below is not None else math.inf) <= (
            entry.above if entry.above is not None else -math.inf
        ):
            found = f"found above {entry.above:g} and below {entry.below:g}"
            yield source.problem(("expect", index, "below"), found, "more than above")


def _latest_end_s(scenario: Scenario) -> float:
    if not any(entry.from_s for entry in scenario.expect):
        return scenario.duration_s
    try:
        return latest_end_s(scenario)
    except PathError:  # which the path's own rule reports
        return math.inf


def _unknown(
    selection: VehicleSelection, vehicles: tuple[Vehicle, ...], path: KeyPath, source: Source
) -> Iterator[Problem]:
    if selection != "all":
        for index, ref in enumerate(selection):
            yield from one_vehicle(ref, vehicles, (*path, index), source)

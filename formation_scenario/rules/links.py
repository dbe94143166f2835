"""Rules between the keys of the links."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from formation_scenario.errors import Problem
from formation_scenario.links import DefaultLink, Impairment, ImpairmentPatch, LinkChange, Links, least_mean_burst
from formation_scenario.model import Scenario
from formation_scenario.source import KeyPath, Source
from formation_scenario.trace import ALLOWED, TraceError, read_trace_ms
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

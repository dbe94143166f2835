"""Rules between keys, for scenarios whose every key holds by itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

from airlink.endpoint import parse_endpoint
from airlink.errors import EndpointError
from formation_scenario import surroundings
from formation_scenario.disturbances import DrydenTurbulence
from formation_scenario.elevation import ALLOWED as ELEVATION_ALLOWED
from formation_scenario.elevation import ElevationError
from formation_scenario.errors import Problem
from formation_scenario.expectation import RUN_METRICS
from formation_scenario.faults import PASSING
from formation_scenario.fields import VehicleRef, VehicleSelection
from formation_scenario.formation import Shape, Slots
from formation_scenario.graph import has_spanning_tree
from formation_scenario.ground import ground_of
from formation_scenario.links import (
    DefaultLink,
    Impairment,
    ImpairmentPatch,
    LinkChange,
    Links,
    least_mean_burst,
)
from formation_scenario.model import Scenario, long_ref
from formation_scenario.orders import parse_order
from formation_scenario.path import PathError, SplinePath
from formation_scenario.source import KeyPath, Source
from formation_scenario.trace import ALLOWED as TRACE_ALLOWED
from formation_scenario.trace import TraceError, read_trace_ms
from formation_scenario.vehicles import Vehicle, VehicleModel

MAX_PATH_M = 1e6
"""Half a day's flight; every few metres of a path are checked against every limit."""


def inconsistencies(scenario: Scenario, source: Source) -> list[Problem]:
    """Return every broken rule between keys of a typed scenario."""
    rules = (
        _identities,
        _roles,
        _endpoints,
        _speeds,
        _references,
        _disturbances,
        _faults,
        _traces,
        _bursts,
        _slots,
        _changes,
        _orders,
        _consensus,
        _path,
        surroundings.places,
        surroundings.wind,
        _terrain,
        _avoidance,
        _expectations,
    )
    return [problem for rule in rules for problem in rule(scenario, source)]


def _identities(scenario: Scenario, source: Source) -> Iterator[Problem]:
    seen: dict[tuple[int, int], int] = {}
    for index, vehicle in enumerate(scenario.vehicles):
        first = seen.setdefault(vehicle.vehicle_id, index)
        if first != index:
            found = f"found {vehicle.id} again on network {vehicle.network}, first at vehicles.{first}"
            yield source.problem(("vehicles", index, "id"), found, "each id once on a network")


def _roles(scenario: Scenario, source: Source) -> Iterator[Problem]:
    leaders = [index for index, vehicle in enumerate(scenario.vehicles) if vehicle.role == "leader"]
    for index in leaders[1:]:
        found = f"found a second leader, first at vehicles.{leaders[0]}"
        yield source.problem(("vehicles", index, "role"), found, "one leader, or none (a virtual one)")


def _endpoints(scenario: Scenario, source: Source) -> Iterator[Problem]:
    networks: dict[str, int] = {}
    refused: set[str] = set()
    for index, vehicle in enumerate(scenario.vehicles):
        if vehicle.endpoint in refused:
            continue
        path: KeyPath = ("vehicles", index, "endpoint")
        try:
            endpoint = str(parse_endpoint(vehicle.endpoint))
        except EndpointError as error:
            refused.add(vehicle.endpoint)
            yield source.problem(path, str(error))
            continue
        if networks.setdefault(endpoint, vehicle.network) != vehicle.network:
            found = f"found {endpoint} for networks {networks[endpoint]} and {vehicle.network}"
            yield source.problem(path, found, "endpoints of its own for each network")


def _speeds(scenario: Scenario, source: Source) -> Iterator[Problem]:
    refused: set[VehicleModel] = set()
    for index, vehicle in enumerate(scenario.vehicles):
        low, high = vehicle.model.speed_min_mps, vehicle.model.speed_max_mps
        if low > high and vehicle.model not in refused:
            refused.add(vehicle.model)
            path: KeyPath = ("vehicles", index, "model", "speed_min_mps")
            yield source.problem(path, f"found {low:g}", f"at most speed_max_mps, {high:g}")


def _references(scenario: Scenario, source: Source) -> Iterator[Problem]:
    groups: dict[str, tuple[KeyPath, Iterable[VehicleSelection]]] = {
        "changes": (("links", "changes"), (change.vehicles for change in scenario.links.changes)),
        "disturbances": (("disturbances",), (entry.vehicles for entry in scenario.disturbances)),
        "faults": (("faults",), (entry.vehicles for entry in scenario.faults)),
    }
    for path, selections in groups.values():
        for index, selection in enumerate(selections):
            yield from _unknown(selection, scenario.vehicles, (*path, index, "vehicles"), source)
    for index, entry in enumerate(scenario.expect):
        path = ("expect", index, "followers")
        yield from _unknown(entry.followers, scenario.followers, path, source)


def _unknown(
    selection: VehicleSelection, vehicles: tuple[Vehicle, ...], path: KeyPath, source: Source
) -> Iterator[Problem]:
    if selection != "all":
        for index, ref in enumerate(selection):
            yield from _one_vehicle(ref, vehicles, (*path, index), source)


def _one_vehicle(ref: VehicleRef, vehicles: tuple[Vehicle, ...], path: KeyPath, source: Source) -> Iterator[Problem]:
    named = [vehicle for vehicle in vehicles if ref in {vehicle.id, long_ref(vehicle)}]
    if not named:
        ids = ", ".join(str(vehicle.vehicle_id) for vehicle in vehicles) or "none"
        yield source.problem(path, f"found {ref}", f"{ids}")
    elif len(named) > 1:
        full = ", ".join(f"'{long_ref(vehicle)}'" for vehicle in named)
        yield source.problem(path, f"found {ref}, the id of {len(named)} vehicles", full)


def _disturbances(scenario: Scenario, source: Source) -> Iterator[Problem]:
    for index, entry in enumerate(scenario.disturbances):
        path: KeyPath = ("disturbances", index)
        if entry.end_s <= entry.at_s:
            yield source.problem((*path, "until_s"), f"found {entry.end_s:g}", f"more than at_s, {entry.at_s:g}")
        if isinstance(entry, DrydenTurbulence):
            given = {name for name in ("wind_6m_mps", "sigma_mps", "length_m") if getattr(entry, name) is not None}
            if given not in ({"wind_6m_mps"}, {"sigma_mps", "length_m"}):
                found = f"found {', '.join(sorted(given)) or 'neither'}"
                yield source.problem(path, found, "wind_6m_mps, or sigma_mps and length_m")


def _faults(scenario: Scenario, source: Source) -> Iterator[Problem]:
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


def _traces(scenario: Scenario, source: Source) -> Iterator[Problem]:
    for path, patch in _link_groups(scenario):
        if patch.trace_file is not None:
            try:
                read_trace_ms(Path(patch.trace_file))
            except TraceError as error:
                yield source.problem((*path, "trace_file"), str(error), TRACE_ALLOWED)


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


def _bursts(scenario: Scenario, source: Source) -> Iterator[Problem]:
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


def _step_places(scenario: Scenario, vehicle: Vehicle) -> list[KeyPath]:
    """Return where each of a vehicle's link steps is written; of several changes at one time, the last."""
    places: dict[float, KeyPath] = {0.0: ("links", "default")}
    for index, change in enumerate(scenario.links.changes):
        if vehicle in scenario.selected(change.vehicles):
            places[change.at_s] = ("links", "changes", index)
    return [places[at_s] for at_s in sorted(places)]


def _slots(scenario: Scenario, source: Source) -> Iterator[Problem]:
    formation = scenario.formation
    steps: list[tuple[KeyPath, Shape | None, Slots | None]] = [(("formation",), formation.shape, formation.slots_m)]
    for index, change in enumerate(formation.changes):
        steps.append((("formation", "changes", index), change.shape, change.slots_m))
    for above, shape, own in steps:
        path: KeyPath = (*above, "slots_m")
        for ref in own or ():
            yield from _one_vehicle(ref, scenario.followers, (*path, ref), source)
        slots = own if own is not None else formation.slots_m
        if shape == "custom" or (shape is None and own is not None):
            known = slots or {}
            missing = [f for f in scenario.followers if f.id not in known and long_ref(f) not in known]
            if missing:
                ids = ", ".join(str(vehicle.vehicle_id) for vehicle in missing)
                yield source.problem(path, f"found no slot for follower {ids}", "a slot for each follower")


def _changes(scenario: Scenario, source: Source) -> Iterator[Problem]:
    for index, change in enumerate(scenario.formation.changes):
        path: KeyPath = ("formation", "changes", index)
        if change.leader is not None:
            yield from _one_vehicle(change.leader, scenario.vehicles, (*path, "leader"), source)
            if scenario.leader is None:
                found = f"found {change.leader}, but a virtual leader flies the path"
                yield source.problem((*path, "leader"), found, "none, or a vehicle with role: leader at the start")
        if change.shape is change.spacing_m is change.slots_m is change.leader is None:
            yield source.problem(path, "found no change", "shape, spacing_m, slots_m or leader")


def _orders(scenario: Scenario, source: Source) -> Iterator[Problem]:
    for index, planned in enumerate(scenario.orders):
        change = parse_order(planned.order).change
        if change is not None and change.leader is not None:
            yield from _one_vehicle(change.leader, scenario.vehicles, ("orders", index, "order"), source)


def _consensus(scenario: Scenario, source: Source) -> Iterator[Problem]:
    graph, count = scenario.law.consensus.graph, len(scenario.vehicles)
    if isinstance(graph, str):
        return
    path: KeyPath = ("law", "consensus", "graph")
    sizes = {len(graph), *(len(row) for row in graph)}
    if sizes != {count}:
        found = f"found {len(graph)} rows of {', '.join(str(len(row)) for row in graph)}"
        yield source.problem(path, found, f"{count} rows of {count} weights, one for each vehicle")
    elif any(graph[index][index] for index in range(count)):
        yield source.problem(path, "found a weight on the diagonal", "0 there: no vehicle hears itself")
    elif not has_spanning_tree(graph):
        allowed = "a vehicle that all hear, directly or through others (a spanning tree)"
        yield source.problem(path, "found nobody whom all hear", allowed)


def _path(scenario: Scenario, source: Source) -> Iterator[Problem]:
    path: KeyPath = ("path", "waypoints_m")
    try:
        length_m = SplinePath(scenario.path.waypoints_m).length_m
    except PathError as error:
        allowed = "waypoints 1 m or more apart, without turning straight back"
        yield source.problem((*path, error.waypoint), str(error), allowed)
    else:
        if length_m > MAX_PATH_M:
            yield source.problem(path, f"found a path of {length_m:.3g} m", f"up to {MAX_PATH_M:g} m")


def _avoidance(scenario: Scenario, source: Source) -> Iterator[Problem]:
    safety = scenario.safety
    if safety.avoidance.enabled and safety.avoidance.distance_m < safety.separation_m:
        found, allowed = f"found {safety.avoidance.distance_m:g}", f"at least separation_m, {safety.separation_m:g}"
        yield source.problem(("safety", "avoidance", "distance_m"), found, allowed)


def _terrain(scenario: Scenario, source: Source) -> Iterator[Problem]:
    terrain = scenario.terrain
    if terrain is None:
        return
    if terrain.file is not None and terrain.hills:
        yield source.problem(("terrain", "hills"), "found hills beside a file", "one of them")
    if scenario.safety.clearance_m > terrain.clearance_m:
        found = f"found {scenario.safety.clearance_m:g}"
        allowed = f"at most terrain.clearance_m, {terrain.clearance_m:g}"
        yield source.problem(("safety", "clearance_m"), found, allowed)
    try:
        ground_of(scenario)
    except ElevationError as error:
        yield source.problem(("terrain", "file"), str(error), ELEVATION_ALLOWED)


def _expectations(scenario: Scenario, source: Source) -> Iterator[Problem]:
    for index, entry in enumerate(scenario.expect):
        if entry.below is None and entry.above is None:
            yield source.problem(("expect", index), "found no bound", "below, above or both")
        if entry.from_s >= entry.to_s:
            found = f"found a window from {entry.from_s:g} to {entry.to_s:g} s"
            yield source.problem(("expect", index, "from_s"), found, "from_s before to_s")
        if entry.metric in RUN_METRICS and entry.followers != "all":
            found = f"found followers for {entry.metric}, a figure of the whole run"
            yield source.problem(("expect", index, "followers"), found, "all")
        if (entry.below if entry.below is not None else math.inf) <= (
            entry.above if entry.above is not None else -math.inf
        ):
            found = f"found above {entry.above:g} and below {entry.below:g}"
            yield source.problem(("expect", index, "below"), found, "more than above")

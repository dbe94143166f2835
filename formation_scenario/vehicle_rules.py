"""Rules between the keys of vehicles and formation: identities, roles, limits, slots, changes, orders, the graph."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

import numpy as np

from airlink.endpoint import EndpointError, parse_endpoint
from formation_scenario.errors import Problem
from formation_scenario.fields import VehicleRef
from formation_scenario.formation import Shape, Slots
from formation_scenario.law import LawType, components
from formation_scenario.model import Scenario, long_ref
from formation_scenario.orders import parse_order
from formation_scenario.source import KeyPath, Source
from formation_scenario.vehicles import Vehicle, VehicleModel, family_of

LEAST_FLYING_MPS = 1e-3


def identities(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield system ids that stand twice on one network."""
    seen: dict[tuple[int, int], int] = {}
    for index, vehicle in enumerate(scenario.vehicles):
        first = seen.setdefault(vehicle.vehicle_id, index)
        if first != index:
            found = f"found {vehicle.id} again on network {vehicle.network}, first at vehicles.{first}"
            yield source.problem(("vehicles", index, "id"), found, "each id once on a network")


def roles(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield leaders beyond the first."""
    leaders = [index for index, vehicle in enumerate(scenario.vehicles) if vehicle.role == "leader"]
    for index in leaders[1:]:
        found = f"found a second leader, first at vehicles.{leaders[0]}"
        yield source.problem(("vehicles", index, "role"), found, "one leader, or none (a virtual one)")


def endpoints(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield endpoints that aren't connection strings, or that two networks share."""
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


def speeds(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield models whose lowest airspeed is above their highest."""
    refused: set[VehicleModel] = set()
    for index, vehicle in enumerate(scenario.vehicles):
        for name, model in (("model", vehicle.model), ("true_model", vehicle.true_model)):
            if model is None or model.speed_min_mps <= model.speed_max_mps or model in refused:
                continue
            refused.add(model)
            path: KeyPath = ("vehicles", index, name, "speed_min_mps")
            allowed = f"at most speed_max_mps, {model.speed_max_mps:g}"
            yield source.problem(path, f"found {model.speed_min_mps:g}", allowed)


def hovering(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield what hovering vehicles can't be: of two kinds, or led by a law for what can't stand."""
    for index, vehicle in enumerate(scenario.vehicles):
        model, at = vehicle.model, ("vehicles", index)
        if model.hovers and vehicle.autopilot == "arduplane":
            yield source.problem((*at, "model", "hovers"), f"found true of {vehicle.autopilot}", "false")
        elif not model.hovers and vehicle.autopilot == "arducopter":
            yield source.problem((*at, "model", "hovers"), "found false of arducopter", "true")
        elif model.prompt_share < 1.0 and family_of(vehicle) == "arduplane":
            found = f"found {model.prompt_share:g} of an ArduPlane"
            yield source.problem((*at, "model", "prompt_share"), found, "1; less of what hovers, and of a PX4")
        elif model.prompt_share < 1.0 and model.airframe is not None:
            found = f"found {model.prompt_share:g} beside an airframe, which has lags of its own"
            yield source.problem((*at, "model", "prompt_share"), found, "1")
        elif not model.hovers and model.speed_min_mps < LEAST_FLYING_MPS:
            found = f"found {model.speed_min_mps:g} of a vehicle that doesn't hover"
            yield source.problem((*at, "model", "speed_min_mps"), found, f"{LEAST_FLYING_MPS:g} m/s or more")
    if not any(vehicle.model.hovers for vehicle in scenario.vehicles):
        return
    if not scenario.hovers:
        yield source.problem(
            ("vehicles",), "found vehicles that hover and others that don't", "one kind in a formation"
        )
    if scenario.formation.frame != "leader_heading":
        found = f"found {scenario.formation.frame} of vehicles that hover"
        yield source.problem(("formation", "frame"), found, "leader_heading")
    if scenario.law.type == "consensus":
        others = ", ".join(law for law in get_args(LawType) if law != "consensus")
        yield source.problem(("law", "type"), "found consensus of vehicles that hover", others)


def one_vehicle(ref: VehicleRef, vehicles: tuple[Vehicle, ...], path: KeyPath, source: Source) -> Iterator[Problem]:
    """Yield the problem of a key that should name one of `vehicles`, if it names none of them, or several."""
    named = [vehicle for vehicle in vehicles if ref in {vehicle.id, long_ref(vehicle)}]
    if not named:
        ids = ", ".join(str(vehicle.vehicle_id) for vehicle in vehicles) or "none"
        yield source.problem(path, f"found {ref}", f"{ids}")
    elif len(named) > 1:
        full = ", ".join(f"'{long_ref(vehicle)}'" for vehicle in named)
        yield source.problem(path, f"found {ref}, the id of {len(named)} vehicles", full)


def slots(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield slots of vehicles that don't exist, and followers without a slot in a custom shape."""
    formation = scenario.formation
    steps: list[tuple[KeyPath, Shape | None, Slots | None]] = [(("formation",), formation.shape, formation.slots_m)]
    for index, change in enumerate(formation.changes):
        steps.append((("formation", "changes", index), change.shape, change.slots_m))
    for above, shape, own in steps:
        path: KeyPath = (*above, "slots_m")
        for ref in own or ():
            yield from one_vehicle(ref, scenario.followers, (*path, ref), source)
        slots = own if own is not None else formation.slots_m
        if shape == "custom" or (shape is None and own is not None):
            known = slots or {}
            missing = [f for f in scenario.followers if f.id not in known and long_ref(f) not in known]
            if missing:
                ids = ", ".join(str(vehicle.vehicle_id) for vehicle in missing)
                yield source.problem(path, f"found no slot for follower {ids}", "a slot for each follower")


def changes(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield changes that change nothing, or name a leader where none can take over."""
    for index, change in enumerate(scenario.formation.changes):
        path: KeyPath = ("formation", "changes", index)
        if change.leader is not None:
            yield from one_vehicle(change.leader, scenario.vehicles, (*path, "leader"), source)
            if scenario.leader is None:
                found = f"found {change.leader}, but a virtual leader flies the path"
                yield source.problem((*path, "leader"), found, "none, or a vehicle with role: leader at the start")
        if change.shape is change.spacing_m is change.slots_m is change.leader is None:
            yield source.problem(path, "found no change", "shape, spacing_m, slots_m or leader")


def orders(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield planned orders that name vehicles which don't exist, or have those turn on the spot that can't stand."""
    for index, planned in enumerate(scenario.orders):
        order = parse_order(planned.order)
        change = order.change
        if order.heading_rad is not None and not scenario.hovers:
            yield source.problem(("orders", index, "order"), f"found '{planned.order}'", "only of vehicles that hover")
        if change is not None and change.leader is not None:
            yield from one_vehicle(change.leader, scenario.vehicles, ("orders", index, "order"), source)


def consensus(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield weights of a graph that don't fit the vehicles, or by which they can't agree."""
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
    elif sum(part.hears_nobody_outside for part in components(np.array(graph))) > 1:
        allowed = "a vehicle that all hear, directly or through others (a spanning tree)"
        yield source.problem(path, "found nobody whom all hear", allowed)


def avoidance(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield a distance to be kept that is below the least one allowed."""
    safety = scenario.safety
    if safety.avoidance.enabled and safety.avoidance.distance_m < safety.separation_m:
        found, allowed = f"found {safety.avoidance.distance_m:g}", f"at least separation_m, {safety.separation_m:g}"
        yield source.problem(("safety", "avoidance", "distance_m"), found, allowed)

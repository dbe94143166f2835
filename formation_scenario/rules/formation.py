"""Rules between the keys of the formation: slots, changes, orders, the consensus graph, the distance kept."""

from __future__ import annotations

from collections.abc import Iterator

from formation_scenario.errors import Problem
from formation_scenario.formation import Shape, Slots
from formation_scenario.graph import has_spanning_tree
from formation_scenario.model import Scenario, long_ref
from formation_scenario.orders import parse_order
from formation_scenario.rules.vehicles import one_vehicle
from formation_scenario.source import KeyPath, Source


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
    """Yield planned orders that name vehicles which don't exist."""
    for index, planned in enumerate(scenario.orders):
        change = parse_order(planned.order).change
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
    elif not has_spanning_tree(graph):
        allowed = "a vehicle that all hear, directly or through others (a spanning tree)"
        yield source.problem(path, "found nobody whom all hear", allowed)


def avoidance(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield a distance to be kept that is below the least one allowed."""
    safety = scenario.safety
    if safety.avoidance.enabled and safety.avoidance.distance_m < safety.separation_m:
        found, allowed = f"found {safety.avoidance.distance_m:g}", f"at least separation_m, {safety.separation_m:g}"
        yield source.problem(("safety", "avoidance", "distance_m"), found, allowed)

"""Checks that the path and every slot can be flown inside the vehicles' limits, in still air at the path's speed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from formation_scenario.arrangement import SlotStep, columns, slot_schedule
from formation_scenario.arrays import Array
from formation_scenario.displaced_path import Rise
from formation_scenario.errors import Problem
from formation_scenario.lifted_path import leader_path
from formation_scenario.model import Scenario
from formation_scenario.path import PathPoints, SplinePath
from formation_scenario.reconfiguration import Route, ahead, column_names, plan_change, take_over
from formation_scenario.slot_motion import Course, SlotMotion, SlotNeeds, slot_needs
from formation_scenario.source import KeyPath, Source
from formation_scenario.terrain_check import check_terrain
from formation_scenario.transition import Transition
from formation_scenario.transition_plan import NotFlyableError
from formation_scenario.vehicles import VehicleModel

SAMPLE_M = 5.0
TOLERANCE = 1e-6
WAYPOINTS: KeyPath = ("path", "waypoints_m")


class _Need(NamedTuple):
    """The largest excess of one vehicle over one limit, over the path and all shapes."""

    excess: float
    place: int
    figure: float
    step: SlotStep | None


def check(scenario: Scenario, source: Source) -> list[Problem]:
    """Return what can't be flown: for each vehicle and limit, the place where it is exceeded most."""
    over_ground = check_terrain(scenario, source)
    if over_ground:
        return over_ground
    path, steps = leader_path(scenario), slot_schedule(scenario)
    standing = _standing(scenario, source, path, steps, _keys(scenario), 0.0)
    return standing or _transitions(scenario, source, path, steps)


def check_ahead(scenario: Scenario, step: SlotStep, path: SplinePath, from_m: float) -> list[str]:
    """Return, in words, what of a formation can't be flown on the path from `from_m` on."""
    source, keys = Source(None, {}, {}), [("formation",)]
    problems = _standing(scenario, source, path, (step,), keys, min(max(from_m, 0.0), path.length_m))
    return [f"{problem.found}; allowed: {problem.allowed}" for problem in problems]


def _standing(
    scenario: Scenario,
    source: Source,
    path: SplinePath,
    steps: tuple[SlotStep, ...],
    keys: Sequence[KeyPath],
    from_m: float,
) -> list[Problem]:
    """Return what can't be flown from `from_m` on while the slots don't change."""
    uniform = np.linspace(from_m, path.length_m, int((path.length_m - from_m) / SAMPLE_M) + 2)
    places = np.unique(np.concatenate((uniform, path.nodes_m[path.nodes_m >= from_m])))
    points = path.at(places)
    return [
        *_leaders(scenario, source, places, points, steps),
        *_followers(scenario, source, places, points, steps),
        *_separation(scenario, source, steps, keys),
        *_ahead_of_leader(scenario, source, steps, keys),
    ]


def _leaders(
    scenario: Scenario, source: Source, places: Array, points: PathPoints, steps: tuple[SlotStep, ...]
) -> Iterator[Problem]:
    speed = scenario.path.speed_mps
    for leader in dict.fromkeys(columns(scenario)[step.arrangement.leader] for step in steps):
        if leader is None:
            continue
        limits = leader.model
        if not limits.speed_min_mps <= speed <= limits.speed_max_mps:
            allowed = f"{_speeds(limits)}, leader {leader.vehicle_id}'s limits"
            yield source.problem(("path", "speed_mps"), f"found {speed:g} m/s", allowed)
        needs = {
            "turn": _worst(np.abs(speed * points.curvature_1pm), limits.turn_rate_max_rps),
            "climb": _worst(np.abs(speed * points.slope), limits.climb_max_mps),
        }
        yield from _report(f"leader {leader.vehicle_id}", needs, limits, source, places, points)


def _followers(
    scenario: Scenario, source: Source, places: Array, points: PathPoints, steps: tuple[SlotStep, ...]
) -> Iterator[Problem]:
    course = Course.along(points, scenario.path.speed_mps)
    needed = [slot_needs(course, SlotMotion.at_rest(step.places_m), scenario.formation.frame) for step in steps]
    for column, vehicle in enumerate(columns(scenario)):
        worst: dict[str, _Need] = {}
        for step, needs in zip(steps, needed, strict=True):
            if vehicle is None or column == step.arrangement.leader:
                continue
            for name, need in _slot_needs(needs, column, vehicle.model, step).items():
                if name not in worst or need.excess > worst[name].excess:
                    worst[name] = need
        if vehicle is not None:
            yield from _report(f"vehicle {vehicle.vehicle_id}'s slot", worst, vehicle.model, source, places, points)


def _slot_needs(needs: SlotNeeds, column: int, limits: VehicleModel, step: SlotStep) -> dict[str, _Need]:
    speed = needs.speed_mps[:, column]
    slow = _worst(-speed, -limits.speed_min_mps, step)
    return {
        "climb": _worst(np.abs(needs.climb_mps[:, column]), limits.climb_max_mps),
        "speed": _worst(speed, limits.speed_max_mps, step),
        "slow": slow._replace(figure=-slow.figure),
        "turn": _worst(np.abs(needs.turn_rate_rps[:, column]), limits.turn_rate_max_rps, step),
        "accel": _worst(np.abs(needs.accel_mps2[:, column]), limits.accel_max_mps2, step),
    }


def _transitions(scenario: Scenario, source: Source, path: SplinePath, steps: tuple[SlotStep, ...]) -> list[Problem]:
    """Return the first change that can't be flown: the start of the later ones isn't known then."""
    speed, way, leader = scenario.path.speed_mps, Transition.standing(steps[0].places_m), 0
    for key, step in zip(_keys(scenario)[1:], steps[1:], strict=True):
        at_m = step.at_s * speed
        if at_m > path.length_m or step.at_s > scenario.duration_s:
            break
        slots = way.at(step.at_s)
        flown: Route = path
        if step.arrangement.leader != leader:
            leader = step.arrangement.leader
            forward_m, right_m, up_m = slots.position_m[leader].tolist()
            at_m, slots = at_m + forward_m, slots.seen_from(leader)
            flown = take_over(scenario, path, at_m, right_m, Rise(up_m), slots.reach_m)
        try:
            way = plan_change(scenario, slots, step.arrangement, step.at_s, ahead(flown, speed, at_m))
        except NotFlyableError as error:
            places = np.array([at_m + error.elapsed_s * speed])
            found = f"{_place(places, path.at(places), 0)}: {error.found}"
            return [source.problem(key, found, error.allowed)]
    return []


def _worst(figures: Array, limit: float, step: SlotStep | None = None) -> _Need:
    index = int(np.argmax(figures))
    return _Need(float(figures[index]) - limit - TOLERANCE * abs(limit), index, float(figures[index]), step)


def _report(
    who: str,
    needs: dict[str, _Need],
    limits: VehicleModel,
    source: Source,
    places: Array,
    points: PathPoints,
) -> Iterator[Problem]:
    words = {
        "speed": ("m/s", _speeds(limits)),
        "slow": ("m/s", _speeds(limits)),
        "turn": ("rad/s of turn", f"up to {limits.turn_rate_max_rps:g} rad/s"),
        "climb": ("m/s of climb", f"up to {limits.climb_max_mps:g} m/s"),
        "accel": ("m/s² of acceleration", f"up to {limits.accel_max_mps2:g} m/s²"),
    }
    for name, need in needs.items():
        if need.excess > 0.0:
            unit, allowed = words[name]
            shape = f" in shape {need.step.shape}" if need.step is not None else ""
            place = _place(places, points, need.place)
            found = f"{place}: {who}{shape} would need {need.figure:.3g} {unit}"
            yield source.problem(WAYPOINTS, found, allowed)


def _place(places: Array, points: PathPoints, index: int) -> str:
    north, east, height = points.north_m[index], points.east_m[index], points.height_m[index]
    return f"path at {places[index]:.0f} m (north {north:.0f}, east {east:.0f}, height {height:.0f})"


def _speeds(limits: VehicleModel) -> str:
    return f"{limits.speed_min_mps:g} to {limits.speed_max_mps:g} m/s"


def _separation(
    scenario: Scenario, source: Source, steps: tuple[SlotStep, ...], keys: Sequence[KeyPath]
) -> Iterator[Problem]:
    allowed = f"{scenario.safety.separation_m:g} m or more (safety.separation_m)"
    everyone = column_names(scenario)
    for path, step in zip(keys, steps, strict=True):
        places = step.places_m
        distances = np.linalg.norm(places[:, None] - places[None, :], axis=-1)
        distances[np.tril_indices(len(places))] = np.inf
        one, other = np.unravel_index(int(np.argmin(distances)), distances.shape)
        nearest = float(distances[one, other])
        if nearest < scenario.safety.separation_m * (1.0 - TOLERANCE):
            pair = " and ".join(_who(step, column, everyone) for column in (one, other))
            found = f"found slots of {pair} {nearest:.3g} m apart in {step.shape}"
            key = "slots_m" if step.shape == "custom" else "spacing_m"
            yield source.problem((*path, key), found, allowed)


def _ahead_of_leader(
    scenario: Scenario, source: Source, steps: tuple[SlotStep, ...], keys: Sequence[KeyPath]
) -> Iterator[Problem]:
    if scenario.formation.frame != "follower_heading":
        return
    for path, step in zip(keys, steps, strict=True):
        before = np.flatnonzero(step.places_m[:, 0] > TOLERANCE)
        if before.size:
            forward = step.places_m[before[0], 0]
            found = (
                f"found shape {step.shape} with {column_names(scenario)[before[0]]}'s slot {forward:.3g} m ahead of "
                "the leader, unstable in follower_heading"
            )
            yield source.problem((*path, "shape"), found, "slots behind, or frame: leader_heading")


def _who(step: SlotStep, column: int | np.intp, everyone: tuple[str, ...]) -> str:
    return "the leader" if column == step.arrangement.leader else everyone[column]


def _keys(scenario: Scenario) -> list[KeyPath]:
    """Return the key of each step of the slot schedule."""
    changes = scenario.formation.changes
    order = sorted(range(len(changes)), key=lambda index: changes[index].at_s)
    return [("formation",), *(("formation", "changes", index) for index in order)]

"""Can the path and every slot be flown inside the vehicles' limits? In still air, at the path's speed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formation_scenario.errors import Problem
from formation_scenario.formation import Frame
from formation_scenario.lifted_path import leader_path
from formation_scenario.model import Scenario
from formation_scenario.path import PathPoints
from formation_scenario.shapes import SlotStep, slot_schedule
from formation_scenario.source import KeyPath, Source
from formation_scenario.terrain_check import check_terrain
from formation_scenario.vehicles import Vehicle, VehicleModel

Array = npt.NDArray[np.float64]

SAMPLE_M = 5.0
TOLERANCE = 1e-6
WAYPOINTS: KeyPath = ("path", "waypoints_m")


class SlotMotion(NamedTuple):
    """What a slot needs at each place of the path: airspeed, turn rate, change of airspeed."""

    speed_mps: Array
    turn_rate_rps: Array
    accel_mps2: Array


class _Need(NamedTuple):
    """The worst need of one vehicle for one limit, over path and shapes."""

    excess: float
    place: int
    figure: float
    step: SlotStep | None


def check(scenario: Scenario, source: Source) -> list[Problem]:
    """Return what can't be flown, the worst place only for each vehicle and limit."""
    over_ground = check_terrain(scenario, source)
    if over_ground:
        return over_ground
    path = leader_path(scenario)
    uniform = np.linspace(0.0, path.length_m, int(path.length_m / SAMPLE_M) + 2)
    places = np.unique(np.concatenate((uniform, path.nodes_m)))
    points = path.at(places)
    steps = slot_schedule(scenario)
    return [
        *_leader(scenario, source, places, points),
        *_followers(scenario, source, places, points, steps),
        *_separation(scenario, source, steps),
        *_ahead_of_leader(scenario, source, steps),
    ]


def slot_motion(points: PathPoints, speed_mps: float, slot_m: Array, frame: Frame) -> SlotMotion:
    """Return what a slot needs at each path point: the velocity of a point fixed in a turning frame.

    `slot_m` (3,) is forward, right and up of the leader. In the leader's frame the slot turns with it. In
    the follower's frame the equilibrium of a steady turn is used: both turn at the leader's rate.
    """
    turn = speed_mps * points.curvature_1pm
    turn_change = speed_mps**2 * points.curvature_rate_1pm2
    forward, right = float(slot_m[0]), float(slot_m[1])
    if frame == "leader_heading":
        along, across = speed_mps - turn * right, turn * forward
        speed = np.hypot(along, across)
        accel = turn_change * (forward * across - right * along) / speed
        return SlotMotion(speed, turn + turn_change * forward * speed_mps / speed**2, accel)
    sine = np.clip(-turn * forward / speed_mps, -0.99, 0.99)
    cosine = np.sqrt(1.0 - sine**2)
    accel = -turn_change * right + turn_change * forward * sine / cosine
    speed = speed_mps * cosine - turn * right
    return SlotMotion(speed, turn, accel)


def _leader(scenario: Scenario, source: Source, places: Array, points: PathPoints) -> Iterator[Problem]:
    leader = scenario.leader
    if leader is None:
        return
    limits, speed = leader.model, scenario.path.speed_mps
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
    speed, frame = scenario.path.speed_mps, scenario.formation.frame
    climb = np.abs(speed * points.slope)
    for column, vehicle in enumerate(scenario.followers):
        limits = vehicle.model
        needs: dict[str, _Need] = {"climb": _worst(climb, limits.climb_max_mps)}
        for step in steps:
            motion = slot_motion(points, speed, step.slots_m[column], frame)
            for name, need in _slot_needs(motion, limits, step).items():
                if name not in needs or need.excess > needs[name].excess:
                    needs[name] = need
        yield from _report(f"vehicle {vehicle.vehicle_id}'s slot", needs, limits, source, places, points)


def _slot_needs(motion: SlotMotion, limits: VehicleModel, step: SlotStep) -> dict[str, _Need]:
    speed = motion.speed_mps
    slow = _worst(-speed, -limits.speed_min_mps, step)
    return {
        "speed": _worst(speed, limits.speed_max_mps, step),
        "slow": slow._replace(figure=-slow.figure),
        "turn": _worst(np.abs(motion.turn_rate_rps), limits.turn_rate_max_rps, step),
        "accel": _worst(np.abs(motion.accel_mps2), limits.accel_max_mps2, step),
    }


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


def _separation(scenario: Scenario, source: Source, steps: tuple[SlotStep, ...]) -> Iterator[Problem]:
    allowed = f"{scenario.safety.separation_m:g} m or more (safety.separation_m)"
    names = ["the leader", *(f"vehicle {vehicle.vehicle_id}" for vehicle in scenario.followers)]
    for path, step in zip(_keys(scenario), steps, strict=True):
        places = np.vstack((np.zeros((1, 3)), step.slots_m))
        distances = np.linalg.norm(places[:, None] - places[None, :], axis=-1)
        distances[np.tril_indices(len(places))] = np.inf
        one, other = np.unravel_index(int(np.argmin(distances)), distances.shape)
        nearest = float(distances[one, other])
        if nearest < scenario.safety.separation_m * (1.0 - TOLERANCE):
            found = f"found slots of {names[one]} and {names[other]} {nearest:.3g} m apart in {step.shape}"
            key = "slots_m" if step.shape == "custom" else "spacing_m"
            yield source.problem((*path, key), found, allowed)


def _ahead_of_leader(scenario: Scenario, source: Source, steps: tuple[SlotStep, ...]) -> Iterator[Problem]:
    if scenario.formation.frame != "follower_heading":
        return
    for path, step in zip(_keys(scenario), steps, strict=True):
        ahead = np.flatnonzero(step.slots_m[:, 0] > TOLERANCE)
        if ahead.size:
            vehicle: Vehicle = scenario.followers[int(ahead[0])]
            forward = step.slots_m[ahead[0], 0]
            found = (
                f"found shape {step.shape} with vehicle {vehicle.vehicle_id}'s slot {forward:.3g} m ahead of "
                "the leader, unstable in follower_heading"
            )
            yield source.problem((*path, "shape"), found, "slots behind, or frame: leader_heading")


def _keys(scenario: Scenario) -> list[KeyPath]:
    """Return the key of each step of the slot schedule."""
    changes = scenario.formation.changes
    order = sorted(range(len(changes)), key=lambda index: changes[index].at_s)
    return [("formation",), *(("formation", "changes", index) for index in order)]

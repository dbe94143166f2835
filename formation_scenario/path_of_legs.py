"""The path of legs of a scenario: what its vehicles, slots, wind and fence make of its waypoints."""

from __future__ import annotations

import math

import numpy as np

from flight_model.arrays import Array, Complex
from flight_model.fence_geometry import CHECKED_M, Drift, Flyers, room_along_m
from flight_model.legs.joining import Lack, TurnRules
from flight_model.legs.path import LegPlan, LegsPath
from formation_scenario.path_plan import PathPlan
from formation_scenario.slot_assignment import Members, SlotStep, column_models, slot_schedule
from formation_scenario.surroundings import Fence
from formation_scenario.turn_limits import climb_limits, turn_limits


def path_of_legs(members: Members, path: PathPlan, drift_mps: tuple[float, float], fence: Fence | None) -> LegsPath:
    """Return the path along a scenario's legs that all its vehicles can fly, clear of the fence where there is room.

    Args:
        members: vehicles and formation.
        path: the keys of the path.
        drift_mps: the wind that drifts the vehicles, north and east.
        fence: within which detours should stay.

    Raises:
        PathError: two successive waypoints less than 1 m apart horizontally.
    """
    steps, wind_mps, legs = slot_schedule(members), math.hypot(*drift_mps), len(path.waypoints_m) - 1
    turns = [turn_limits(members, steps, path.speed_mps, wind_mps)] * legs
    climbs = [climb_limits(members, path.speed_mps, wind_mps)] * legs
    lack = _lack(members, steps, path.speed_mps, drift_mps, fence)
    rules = TurnRules(turns, path.turn_distance_max_m, path.turn == "fly_over", lack)
    return LegsPath(path.waypoints_m, LegPlan(rules, climbs, path.climb == "circle"))


def _lack(
    members: Members,
    steps: tuple[SlotStep, ...],
    speed_mps: float,
    drift_mps: tuple[float, float],
    fence: Fence | None,
) -> Lack | None:
    """Return the measure of the room that a way lacks: the sum over its points of what the worst slot lacks there."""
    if fence is None or not fence.corners_m:
        return None
    corners_m = np.array(fence.corners_m)
    first = 0 if members.leader else 1
    places = np.concatenate([step.places_m[first:] for step in steps])
    turn_rps = np.array([each.turn_rate_max_rps for each in column_models(members)[first:]] * len(steps))
    flyers = Flyers(places[:, 0], places[:, 1], turn_rps)
    drift = Drift(speed_mps, *drift_mps, speed_mps + math.hypot(*drift_mps))

    def lack(way: Complex, course_rad: Array) -> float:
        _, room = room_along_m(corners_m, (way.real, way.imag, course_rad), flyers, drift)
        return float(np.maximum(CHECKED_M - room, 0.0).max(axis=0).sum())

    return lack

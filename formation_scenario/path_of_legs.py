"""The path of legs of a scenario: what its vehicles, slots, wind and fence make of its waypoints."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from flight_model.arrays import Array, Complex
from flight_model.fence_geometry import CHECKED_M, Drift, Flyers, room_along_m
from flight_model.legs.circling import Circles
from flight_model.legs.detour import Detours
from flight_model.legs.joining import Lack, TurnRules
from flight_model.legs.path import LegPlan, LegsPath
from flight_model.legs.speeds import SpeedChanges, SpeedProfile, speed_profile
from flight_model.legs.turn import TurnLimits
from flight_model.path import FlightPath
from flight_model.stops.path import PathWithStops
from formation_scenario.geofence import Geofence
from formation_scenario.path_plan import PathPlan
from formation_scenario.path_with_stops import CHANGE_TAUS, path_with_stops, short_legs, timetable
from formation_scenario.slot_assignment import Members, SlotStep, models_by_index, slot_schedule
from formation_scenario.turn_limits import climb_limits, turn_limits

MAX_ROUNDS = 5
"""How often turns are planned again because legs between them became too short for their speeds."""
CHANGE_SHARE = 0.3
"""Share of the acceleration that changes of speed use; the law needs the rest to hold the slots."""


def path_of_legs(
    members: Members,
    path: PathPlan,
    drift_mps: tuple[float, float],
    fence: Geofence | None,
    known: dict[TurnLimits, Detours] | None = None,
) -> LegsPath:
    """Return the path along a scenario's legs that all its vehicles can fly, clear of the fence where there is room.

    Args:
        members: vehicles and formation.
        path: the keys of the path.
        drift_mps: the wind that drifts the vehicles, north and east.
        fence: within which detours should stay.
        known: detours that were found before, by their limits; those of this path are added.

    Raises:
        PathError: two successive waypoints less than 1 m apart horizontally.
    """
    if all(each.model.hovers for each in members.vehicles):
        return path_with_stops(members, path)
    steps, wind_mps = slot_schedule(members), math.hypot(*drift_mps)
    climbs = {each: climb_limits(members, each, wind_mps) for each in set(path.legs_mps)}
    lack = _lack(members, steps, path.fastest_mps, drift_mps, fence)
    circles = {each.waypoint: Circles(each.turns, each.radius_m) for each in path.circles}
    known = {} if known is None else known
    turns, flown_mps = dict[float, TurnLimits](), [{each} for each in path.legs_mps]
    for _ in range(MAX_ROUNDS):
        for speed_mps in set().union(*flown_mps) - turns.keys():
            turns[speed_mps] = turn_limits(members, steps, speed_mps, wind_mps)
        limits = [_tightest(turns[speed_mps] for speed_mps in each) for each in flown_mps]
        rules = TurnRules(
            limits, path.turn_distance_max_m, path.turn == "fly_over", lack, known, path.detour == "nearest"
        )
        plan = LegPlan(rules, [climbs[each] for each in path.legs_mps], path.climb == "circle", circles)
        found = LegsPath(path.waypoints_m, plan)
        # On a leg too short for its speed, another one is flown in the turn at its end.
        speeds, _ = planned_speeds(members, path, found, wind_mps)
        others = [(each.first - 1, speeds.at(each.begin_m)[0]) for each in found.passed]
        if all(speed_mps in flown_mps[leg] for leg, speed_mps in others):
            break
        for leg, speed_mps in others:
            flown_mps[leg].add(speed_mps)
    return found


def planned_speeds(
    members: Members, path: PathPlan, written: FlightPath, wind_mps: float
) -> tuple[SpeedProfile, dict[int, float]]:
    """Return the airspeed along a scenario's path, and what is reached on legs that are too short for theirs.

    Args:
        members: vehicles, whose acceleration and time constants limit the changes.
        path: the keys of the path.
        written: the path through the waypoints.
        wind_mps: of the wind that drifts the vehicles.
    """
    if isinstance(written, PathWithStops):
        found = timetable(members, path, written)
        return found, short_legs(path, found) if isinstance(path.speed_mps, tuple) else {}
    if not isinstance(written, LegsPath):
        return SpeedProfile(path.begin_mps), {}
    return speed_profile(written.straights_m, path.legs_mps, _changes(members, wind_mps))


def _changes(members: Members, wind_mps: float) -> SpeedChanges:
    models = [each.model for each in members.vehicles]
    accel_mps2 = CHANGE_SHARE * min(each.accel_max_mps2 for each in models)
    return SpeedChanges(accel_mps2, wind_mps, CHANGE_TAUS * max(each.tau_v_s for each in models))


def _tightest(limits: Iterable[TurnLimits]) -> TurnLimits:
    """Return limits that keep to all of some others."""
    curvatures_1pm, rates_1pm2 = zip(*limits, strict=True)
    return TurnLimits(min(curvatures_1pm), min(rates_1pm2))


def _lack(
    members: Members,
    steps: tuple[SlotStep, ...],
    speed_mps: float,
    drift_mps: tuple[float, float],
    fence: Geofence | None,
) -> Lack | None:
    """Return the measure of the room that a curve lacks: the sum over its points of what the worst slot lacks there."""
    sides = None if fence is None else fence.sides
    if sides is None:
        return None
    first = 0 if members.leader else 1
    positions = np.concatenate([step.positions_m[first:] for step in steps])
    turn_rps = np.array([each.turn_rate_max_rps for each in models_by_index(members)[first:]] * len(steps))
    flyers = Flyers(positions[:, 0], positions[:, 1], turn_rps, members.formation.slots_turn)
    drift = Drift(speed_mps, *drift_mps, speed_mps + math.hypot(*drift_mps))

    def lack(points: Complex, course_rad: Array) -> float:
        _, room = room_along_m(sides, (points.real, points.imag, course_rad), flyers, drift)
        return float(np.maximum(CHECKED_M - room, 0.0).max(axis=0).sum())

    return lack

"""The path of a formation that hovers, along legs: where it stops, how fast it passes the other waypoints, and when.

A scenario's vehicles, slots and keys go into `flight_model.stops`.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np

from flight_model.legs.circling import Circles
from flight_model.legs.heights import Climbs
from flight_model.legs.turn import TurnLimits
from flight_model.stops.corners import Corners
from flight_model.stops.pacing import Rates
from flight_model.stops.path import PathWithStops, StopPlan
from flight_model.stops.timetable import Passage, Timetable
from flight_model.stops.turning import MIN_S, turn_s
from formation_scenario.path_plan import PathPlan
from formation_scenario.slot_assignment import Members, slot_schedule
from formation_scenario.turn_limits import climb_limits, turn_limits

ACCELERATION_SHARE: Final = 0.5
"""Share of the acceleration that changes of speed use; the law needs the rest to hold the slots."""
CHANGE_TAUS: Final = 2.0
"""Shortest duration of a change of speed, in time constants of the slowest vehicle's speed."""
CLIMB_SHARE: Final = 0.75
"""Share of the steepest slope that a leg uses which is flown more slowly because it is steep: the rest is rounded."""
SHORT_SHARE: Final = 0.99
"""Share of a leg's speed below which it isn't reached."""
MIN_TURN_RAD: Final = math.radians(0.1)


def path_with_stops(members: Members, path: PathPlan) -> PathWithStops:
    """Return the path along a scenario's legs that all its vehicles, which hover, can fly.

    Args:
        members: vehicles and formation.
        path: the keys of the path.

    Raises:
        PathError: two successive waypoints less than 1 m apart horizontally.
    """
    steps = slot_schedule(members)

    @cache
    def limits_at(speed_mps: float) -> TurnLimits:
        return turn_limits(members, steps, speed_mps, 0.0)

    waypoints, legs_mps = np.array(path.waypoints_m), _legs_mps(members, path)
    inside = range(1, len(waypoints) - 1)
    stops = {each.waypoint for each in path.stops if each.waypoint in inside}
    circles = {each.waypoint: Circles(each.turns, each.radius_m) for each in path.circles if each.turns}
    if path.turn != "fly_by":
        stops |= set(inside) - circles.keys()
    flat = waypoints[:, 0] + 1j * waypoints[:, 1]
    corners = Corners(flat, legs_mps, limits_at, rates(members), path.turn_distance_max_m)
    plan = StopPlan(
        corners.chosen(stops, circles.keys() - stops),
        [climb_limits(members, each, 0.0) for each in legs_mps],
        [limits_at(each) for each in legs_mps],
        path.turn_distance_max_m,
        {index: each for index, each in circles.items() if index not in stops},
    )
    return PathWithStops(path.waypoints_m, plan)


def timetable(members: Members, path: PathPlan, written: PathWithStops) -> Timetable:
    """Return when the leader is where on a path, at the speeds of a plan's legs; stops and corners are the path's."""
    turns = {each.at_m: each for each in written.turns_in_place}
    holds_s, passages = {each.waypoint: each.hold_s for each in path.stops}, list[Passage]()
    for first, _, kind, begin_m, length_m in written.passed:
        if kind == "stop":
            turn = turns[begin_m]
            turning_s = _turn_s(members, turn.by_rad)
            hold_s = holds_s.get(first, 0.0)
            passages.append(Passage(begin_m, begin_m, 0.0, hold_s, turning_s, turn.from_rad, turn.by_rad, first))
        else:
            speed_mps = written.passes[first - 1].speed_mps if first <= len(written.passes) else math.inf
            passages.append(Passage(begin_m, begin_m + length_m, speed_mps, waypoint=first))
    legs_mps = _legs_mps(members, path)
    last = len(legs_mps) - 1
    each_mps = [legs_mps[0], *(legs_mps[min(each.waypoint, last)] for each in passages)]
    return Timetable(path.begin_mps, each_mps, passages, written.length_m, rates(members))


def short_legs(path: PathPlan, planned: Timetable) -> dict[int, float]:
    """Return the legs that are too short for their speed, by their index, and the highest speed on each."""
    legs = [0, *(min(each.waypoint, len(path.legs_mps) - 1) for each in planned.passages)]
    return {
        leg: cruise_mps
        for leg, cruise_mps in zip(legs, planned.cruises_mps, strict=True)
        if cruise_mps < SHORT_SHARE * path.legs_mps[leg]
    }


def rates(members: Members) -> Rates:
    """Return how fast the speed of a formation may change."""
    models = [each.model for each in members.vehicles]
    accel_mps2 = ACCELERATION_SHARE * min(each.accel_max_mps2 for each in models)
    return Rates(accel_mps2, CHANGE_TAUS * max(each.tau_v_s for each in models))


def _turn_s(members: Members, by_rad: float) -> float:
    """Return how long a turn in place takes, and until followers have ended theirs; 0 for none."""
    if abs(by_rad) < MIN_TURN_RAD:
        return 0.0
    reach_m = 0.0
    if members.formation.slots_turn:
        reach_m = max(float(np.hypot(*step.positions_m[:, :2].T).max()) for step in slot_schedule(members))
    models = [each.model for each in members.vehicles]
    speed_mps, accel_mps2 = min(each.speed_max_mps for each in models), min(each.accel_max_mps2 for each in models)
    return turn_s(by_rad, reach_m, speed_mps, accel_mps2) + MIN_S


def _legs_mps(members: Members, path: PathPlan) -> tuple[float, ...]:
    """Return the speed of each leg; with `climb: circle` one that is too steep for it is flown more slowly."""
    if path.climb == "refuse":
        return path.legs_mps
    slopes = [_slope(*legs) for legs in zip(path.waypoints_m, path.waypoints_m[1:], strict=False)]
    return tuple(
        _slower(climb_limits(members, speed_mps, 0.0), speed_mps, slope)
        for speed_mps, slope in zip(path.legs_mps, slopes, strict=True)
    )


def _slope(begin: tuple[float, float, float], end: tuple[float, float, float]) -> float:
    return abs(end[2] - begin[2]) / max(math.hypot(end[0] - begin[0], end[1] - begin[1]), 1e-9)


def _slower(limits: Climbs, speed_mps: float, slope: float) -> float:
    return speed_mps * min(1.0, CLIMB_SHARE * limits.slope / max(slope, 1e-9))

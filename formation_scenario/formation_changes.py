"""Changes of the formation: transitions between slots, and a new leader's route onto the path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import cbrt, ceil, sqrt

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.offset_curve import STEP_M
from flight_model.path import FlightPath, PathPoints, Route
from flight_model.path_offsets import (
    PEAK_CHANGE,
    PEAK_JERK,
    PEAK_RATE,
    SLOPE_CHANGE,
    SLOPE_JERK,
    DisplacedPath,
    Rise,
    min_offset,
    sample_distances,
)
from formation_scenario.model import Scenario
from formation_scenario.slot_assignment import Arrangement, assigned, models_by_index, names_by_index
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, Transition
from formation_scenario.terrain import LEADER_SHARE, Ground
from formation_scenario.transition_plan import (
    MARGIN_M,
    MEAN_SPEED_MPS,
    Conditions,
    Limits,
    NotFlyableError,
    paths_meet,
    plan_transition,
)

TURN_SHARE = 0.5
"""Share of the turn rate at which all slots keep up that a new leader uses in its turns onto the path."""
ACCELERATION_SHARE = 0.5
"""Share of the acceleration limit that the outermost slots may need at the beginning of such a turn; a new leader often
changes its speed too."""
CLIMB_SHARE = 0.3
"""Share of the climb limit that a new leader uses on its climb or descent to the path."""
MIN_S, MIN_MPS = 10.0, 1.0
WORTH_WAITING = 1.25
"""Joining up waits for the leader's straight and level flight if it is this many times as fast there."""
NEAR_M = 20.0
"""A vehicle within this distance of its slot needs no planned transition, unless it would meet another vehicle."""
LEVEL_OUT_STEPS = 50
"""Number of steps by which a clearance offset extends beyond that route: a kilometre for the descent."""


def plan_change(
    scenario: Scenario,
    start: SlotMotion,
    arrangement: Arrangement,
    at_s: float,
    flight: Callable[[Array], LeaderFlight],
    present: Mask | None = None,
) -> Transition:
    """Return the transition of all columns to an arrangement.

    Slots of absent vehicles are put at their goals at once, since nothing flies in them.

    Args:
        scenario: vehicles, limits, frame and separation.
        start: (C, 3) present slots, in the frame of the arrangement's leader.
        arrangement: the arrangement to reach.
        at_s: when the transition begins.
        flight: the leader's flight, as a function of the seconds since then.
        present: (C,) which vehicles are present; default: all.

    Raises:
        NotFlyableError: the transition can't be flown there.
    """
    there = np.ones(len(start.position_m), dtype=np.bool_) if present is None else present
    goal_m = assigned(scenario, arrangement, start.position_m, there)
    conditions = _conditions(scenario, arrangement.leader, flight, there)
    return plan_transition(start.standing(~there, goal_m), goal_m, at_s, conditions)


def plan_joining_up(
    scenario: Scenario,
    start: SlotMotion,
    goal_m: Array,
    leader: int,
    at_s: float,
    flight: Callable[[Array], LeaderFlight],
    present: Mask,
) -> Transition | None:
    """Return the transition of vehicles from where they are to their slots; None if all are near.

    All are near if each is within `NEAR_M` of its slot and their straight paths there keep the separation rule's
    distance. Arguments as of `plan_change`, but `goal_m`: (C, 3) the slots.

    Raises:
        NotFlyableError: it can't be flown there, or would last far longer than on a straight and level course.
    """
    kept_m = scenario.safety.kept_m
    conditions = _conditions(scenario, leader, flight, present)
    conditions = replace(conditions, separation_m=kept_m, spacing_share=0.0, height_offset_m=kept_m + MARGIN_M)
    begin = start.standing(~present, goal_m)
    farthest_m = float(np.linalg.norm(begin.position_m - goal_m, axis=1).max())
    if farthest_m < NEAR_M and not paths_meet(begin.position_m, goal_m, conditions):
        return None
    at_rest = SlotMotion.at_rest(begin.position_m)
    level = plan_transition(at_rest, goal_m, at_s, replace(conditions, flight=_level(flight)))
    transition = plan_transition(begin, goal_m, at_s, conditions)
    if transition.duration_s > WORTH_WAITING * level.duration_s:
        raise NotFlyableError(
            f"{transition.duration_s:.0f} s to gather", f"up to {WORTH_WAITING * level.duration_s:.0f} s", 0.0
        )
    return transition


def _level(flight: Callable[[Array], LeaderFlight]) -> Callable[[Array], LeaderFlight]:
    """Return a straight and level flight at a leader's speed."""

    def level(elapsed_s: Array) -> LeaderFlight:
        still = np.zeros_like(elapsed_s)
        begin = flight(elapsed_s[:1])
        return LeaderFlight(begin.speed_mps, still, still, still, still, still + begin.course_rad)

    return level


def _conditions(scenario: Scenario, leader: int, flight: Callable[[Array], LeaderFlight], present: Mask) -> Conditions:
    return Conditions(
        flight=flight,
        frame=scenario.formation.frame,
        limits=Limits.of(models_by_index(scenario), scenario.path.begin_mps),
        separation_m=scenario.safety.separation_m,
        leader=leader,
        present=present,
        names=names_by_index(scenario),
    )


def take_over(
    scenario: Scenario,
    path: FlightPath,
    from_m: float,
    right_m: float,
    above: Rise,
    reach_m: float,
    ground: Ground | None = None,
    *,
    right_slope: float = 0.0,
) -> DisplacedPath:
    """Return the route onto the path of a new leader that is abreast of `from_m`, `right_m` to the right and above.

    Its turns are gentle enough for slots up to `reach_m` away to keep up. It continues the vehicle's climb, and its
    lateral motion: `right_slope` to the right for each metre along the path. A given ground is cleared by an offset.
    """
    speed, models = max(scenario.path.begin_mps, MIN_MPS), models_by_index(scenario)
    reach_m = reach_m if scenario.formation.slots_turn else 0.0
    turn_rps = TURN_SHARE * keepable_turn_rps(scenario, reach_m)
    slot_mps2 = ACCELERATION_SHARE * min(model.accel_max_mps2 for model in models)
    climb_mps = CLIMB_SHARE * min(model.climb_max_mps for model in models)
    over_s = max(
        MIN_S,
        abs(right_m) / MEAN_SPEED_MPS,
        sqrt(PEAK_CHANGE * abs(right_m) / (speed * turn_rps)) + SLOPE_CHANGE * abs(right_slope) / turn_rps,
        cbrt(PEAK_JERK * abs(right_m) * reach_m / (speed * slot_mps2))
        + sqrt(SLOPE_JERK * abs(right_slope) * reach_m / slot_mps2),
        PEAK_RATE * abs(above.height_m) / climb_mps,
    )
    begin = path, from_m, over_s * speed, right_m, above
    displaced = DisplacedPath(*begin, right_slope=right_slope)
    if scenario.terrain is None or ground is None:
        return displaced
    distances_m = sample_distances(from_m, ceil(over_s * speed / STEP_M) + LEVEL_OUT_STEPS)
    points = PathPoints(*np.array([displaced.at(distance).values() for distance in distances_m.tolist()]).T)
    needed_m = ground.height(points.north_m, points.east_m) + scenario.terrain.clearance_m - points.height_m
    bounds = scenario.rise_bounds(LEADER_SHARE)
    clearance_offset = min_offset(from_m, needed_m, points.slope, bounds, np.zeros(3))
    return DisplacedPath(*begin, clearance_offset, right_slope=right_slope)


def keepable_turn_rps(scenario: Scenario, reach_m: float) -> float:
    """Return the highest turn rate of a leader at which slots `reach_m` away keep up, outside and inside the turn."""
    reach_m = reach_m if scenario.formation.slots_turn else 0.0
    speed, models = scenario.path.begin_mps, models_by_index(scenario)
    spare_mps = min(abs(bound - speed) for model in models for bound in model.soon_mps(speed))
    return max(min(*(model.turn_rate_max_rps for model in models), spare_mps / max(reach_m, 1.0)), 1e-3)


def ahead(route: Route, speed_mps: float, from_m: float) -> Callable[[Array], LeaderFlight]:
    """Return the flight of a leader along a route from `from_m`, as a function of the elapsed seconds."""

    def flight(elapsed_s: Array) -> LeaderFlight:
        points = [route.at(distance_m) for distance_m in (from_m + speed_mps * elapsed_s).tolist()]
        return LeaderFlight.along(PathPoints(*np.array([point.values() for point in points]).T), speed_mps)

    return flight

"""Slots over time and over terrain, and the leader's column.

Over terrain slots are lifted. The leader's height along its route is known in advance, and with it the track of every
slot. For the next two kilometres every slot gets the least lift that keeps its clearance, within the climb that the
leader's own climb leaves. The lift continues the previous one, and is computed again as the leader advances and
whenever the route or the plan changes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from flight_model.arrays import Array, Mask, beside
from flight_model.autopilot_model import FlightState
from flight_model.lift_curve import STEP_M, LiftCurve
from flight_model.path import Route
from flight_model.path_lift_and_displacement import SAMPLES, Bounds, least_lift, sample_places
from flight_model.slot import Slot, Triple
from formation_scenario import Scenario
from formation_scenario.fields import Frame
from formation_scenario.formation import FormationChange
from formation_scenario.slot_assignment import Arrangement, assigned, slot_schedule
from formation_scenario.slot_frame import axis_rad
from formation_scenario.slot_motion import SlotMotion, Transition
from formation_scenario.terrain import Ground

APART_S: Final = 0.05
"""Interval of the moments at which slots are evaluated; between them they are extrapolated at constant acceleration."""
AHEAD_STEPS: Final = 100
"""Steps of the lifts' splines: 2 km, on which a climb at the formation's limit gains 190 m."""
ADVANCE_M: Final = 100.0
"""Distance that the leader flies before lifts are computed again."""
ACROSS: Final = np.array([1.0, -1.0, 0.0])
LEVEL: Final = np.array([1.0, 1.0, 0.0])
WAITS_S: Final = 30.0
"""Longest total delay of moving slots that wait for vehicles."""
PATH_VALUES: Final = 8
SLOPE: Final = 6
"""How many values a path's point has, and which of them is its slope (`PathPoint.values`)."""
KEPT_M: Final = 40.0
"""Distance around the present position within which a lift isn't changed, since setpoints act at different times."""


class FormationPlan:
    """The slots of all columns, (C, 3); before the path begins they are displaced by `start.offset_m`."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin with the scenario's first shape and leader."""
        first = slot_schedule(scenario)[0]
        self.arrangement = first.arrangement
        self.scheduled: deque[FormationChange] = deque(sorted(scenario.formation.changes, key=lambda each: each.at_s))
        """The scenario's changes that haven't begun yet."""
        self._way = way = Transition.standing(first.places_m)
        self._over_s: float = way.at_s + way.duration_s
        """Time from which all slots are at rest."""
        self._rest: SlotMotion | None = None
        """The resting slots returned last, and whether the path had begun then."""
        self._rest_begun = False
        self.goal_m = first.places_m
        """(C, 3) the slots of the arrangement, where all come to rest."""
        self.offset_m = np.tile(scenario.start.offset_m, (len(first.places_m), 1))
        self.offset_m[0] = 0.0
        self.kept_m = scenario.safety.kept_m
        """Distance that slots are planned to keep from each other while they move."""
        self.beside: Mask = np.zeros(len(first.places_m), dtype=np.bool_)
        """(C,) which columns fly beside the turning leader at its speed and heading: slots far aside can't be held."""
        self._anybody_beside = False
        self._slots_turn = scenario.formation.frame != "north"
        self._beside_m, self._beside_s, self._turn_rps = first.places_m, 0.0, 0.0
        """Their positions, (C, 3), at a time of the station's clock, and the leader's turn rate since then."""
        self._apart_m: Array | None = None
        self._planned_m: Array | None = None
        self._apart_of = self.goal_m
        """The result of `apart_m`, and the planned distances and goals that it was made from."""
        self._pace, self._late_s = 1.0, 0.0
        """Share of their planned speed at which slots move, and their delay from having waited."""

    def resume(self, scenario: Scenario, arrangement: Arrangement, slots_m: Array, mission_s: float) -> None:
        """Begin with an arrangement, assigned nearest to `slots_m` (C, 3), and the changes due after a mission time."""
        self.arrangement = arrangement
        self.goal_m = assigned(scenario, arrangement, slots_m)
        self.offset_m = self.offset_m - self.offset_m[arrangement.leader]
        self._fly(Transition.standing(self.goal_m))
        while self.scheduled and self.scheduled[0].at_s <= mission_s:
            self.scheduled.popleft()

    @property
    def leader(self) -> int:
        """The column that leads."""
        return self.arrangement.leader

    def at(self, now_s: float, *, begun: bool) -> SlotMotion:
        """Return the slots at a time of the station's clock, s; `begun`: whether the path has begun."""
        over = self.at_rest(now_s)
        if over and self._rest is not None and self._rest_begun == begun:
            return self._rest
        slots = self._moving(now_s, begun=begun)
        if over:
            self._rest, self._rest_begun = slots, begun
        return slots

    def _moving(self, now_s: float, *, begun: bool) -> SlotMotion:
        slots = self._way.at(now_s)
        if self._pace < 1.0:
            slots = SlotMotion(
                slots.position_m, self._pace * slots.velocity_mps, self._pace**2 * slots.acceleration_mps2
            )
        if self._anybody_beside:
            slots = self._with_those_beside(slots, now_s)
        if begun or not self.offset_m.any():
            return slots
        return SlotMotion(slots.position_m + self.offset_m, slots.velocity_mps, slots.acceleration_mps2)

    def _with_those_beside(self, slots: SlotMotion, now_s: float) -> SlotMotion:
        """Return slots with those beside the leader: fixed in direction over ground, they turn in its frame."""
        turn_rps, place_m = self._turn_rps, self._turned_m(now_s)
        motion = (
            (place_m, slots.position_m),
            (turn_rps * place_m[:, [1, 0, 2]] * ACROSS, slots.velocity_mps),
            (-(turn_rps**2) * place_m * LEVEL, slots.acceleration_mps2),
        )
        return SlotMotion(*(np.where(self.beside[:, None], theirs, others) for theirs, others in motion))

    def _turned_m(self, now_s: float) -> Array:
        swing_rad = self._turn_rps * (now_s - self._beside_s)
        return SlotMotion.at_rest(self._beside_m).seen_from(self.leader, swing_rad).position_m

    def turn(self, now_s: float, turn_rps: float) -> None:
        """Set the leader's turn rate from now on, clockwise, rad/s: the frame's, unless it is fixed to north."""
        if self._anybody_beside:
            self._beside_m = self._turned_m(now_s)
        self._beside_s, self._turn_rps = now_s, turn_rps if self._slots_turn else 0.0

    def at_each(self, each_s: list[float], *, begun: bool) -> SlotMotion:
        """Return every slot at a time of its own, (C,)."""
        if self.at_rest(min(each_s)):
            return self.at(each_s[0], begun=begun)
        times_s = np.array(each_s)
        coarse = np.round(times_s / APART_S)
        moments = sorted(set(coarse.tolist()))
        motions = [self.at(moment * APART_S, begun=begun) for moment in moments]
        each = np.array([(m.position_m, m.velocity_mps, m.acceleration_mps2) for m in motions])
        rows = np.searchsorted(moments, coarse)
        near = SlotMotion(*(each[rows, i, np.arange(rows.size)] for i in range(3)))
        return near.after(times_s - coarse * APART_S)

    def seen_from(self, leader: int, swing_rad: float, now_s: float) -> SlotMotion:
        """Return the slots now, relative to another leader that heads `swing_rad` clockwise of the present one."""
        return self._way.seen_from(leader, swing_rad).at(now_s)

    def hand_over(self, leader: int, swing_rad: float) -> None:
        """Make another column the leader; all positions stay the same."""
        way = self._way.seen_from(leader, swing_rad)
        self.goal_m = SlotMotion.at_rest(self.goal_m).seen_from(leader, swing_rad).position_m
        self.arrangement = self.arrangement._replace(leader=leader)
        self.offset_m = self.offset_m - self.offset_m[leader]
        self._fly(way)

    def adopt(self, arrangement: Arrangement, way: Transition) -> None:
        """Change to another arrangement, along a planned transition."""
        self.arrangement, self.goal_m, self._late_s = arrangement, way.goal_m, 0.0
        self._fly(way)

    def _fly(self, way: Transition) -> None:
        self._way, self._over_s, self._rest = way, way.at_s + way.duration_s, None
        self.beside, self._anybody_beside = np.zeros_like(self.beside), False

    def wait(self, pace: float, elapsed_s: float) -> None:
        """Move all slots at a share `pace` of their planned speed from now on; `elapsed_s`: since the last call.

        Slowed down together they keep the planned distances. Once they are `WAITS_S` late they wait no longer: a
        vehicle that can't reach a slot far outside a turn can reach the one that the slot moves to.
        """
        if self._late_s >= WAITS_S:
            pace = 1.0
        if pace < 1.0:
            late_s = (1.0 - pace) * elapsed_s
            self._way, self._over_s = replace(self._way, at_s=self._way.at_s + late_s), self._over_s + late_s
            self._late_s += late_s
        self._pace = pace

    def fly_beside(self, which: Mask, place_m: Array) -> None:
        """Let the columns in a mask (C,) fly beside the leader, from positions (C, 3), until the next change."""
        self._beside_m = np.where(self.beside[:, None], self._beside_m, place_m)
        self.beside = self.beside | which
        self._anybody_beside = bool(self.beside.any())

    def at_rest(self, now_s: float) -> bool:
        """Return whether all slots are at rest from a time on."""
        return now_s >= self._over_s and not self._anybody_beside

    def apart_m(self, now_s: float) -> Array | None:
        """Return the least planned distances of slots (C, C) while they move; None once all rest in the arrangement.

        Without a planned motion, as for vehicles beside the leader, they are those of the arrangement. The array is the
        same object for as long as nothing changes.
        """
        if self.settled(now_s):
            return None
        planned_m = self._way.apart_m if now_s < self._over_s else None
        if self._apart_m is None or planned_m is not self._planned_m or self._apart_of is not self.goal_m:
            self._planned_m, self._apart_of = planned_m, self.goal_m
            apart_m = np.linalg.norm(self.goal_m[:, None] - self.goal_m, axis=-1)
            self._apart_m = apart_m if planned_m is None else np.minimum(apart_m, planned_m)
        return self._apart_m

    def settled(self, now_s: float) -> bool:
        """Return whether all slots are at rest in the arrangement."""
        if not self.at_rest(now_s):
            return False
        return self._way.goal_m is self.goal_m or np.array_equal(self._way.goal_m, self.goal_m)


@dataclass(frozen=True)
class TrackAhead:
    """The future track of the leader and of the slots."""

    route: Route
    leader: FlightState
    leading: int
    """Index of the leader's own slot among the N; it is never lifted."""
    distance_m: float
    along_mps: float
    slots: Callable[[float], Array]
    """Seconds from now -> slots (N, 3)."""
    plan: Arrangement
    """Identifies the plan of the slots: a different object if the plan has changed."""


class SlotClearance:
    """The lifts of N slots, and the route and plan for which they were computed."""

    def __init__(self, ground: Ground, clearance_m: float, bounds: Callable[[float], Bounds], frame: Frame) -> None:
        """Keep `clearance_m` above the ground.

        `bounds`: of the leader's route and the lift together, at the leader's speed over ground, m/s.
        """
        self._ground, self._clearance_m = ground, clearance_m
        self._bounds, self._frame = bounds, frame
        self._route: Route | None = None
        self._plan: Arrangement | None = None
        self._first, self._made_at_m = 0, 0.0
        self._control_m = np.zeros((0, 4))
        self._curves = list[LiftCurve]()
        self._held = list[Triple]()
        """Each lift of the last tick, its slope and its curvature."""
        self._sampled, self._sampled_first = np.zeros((0, PATH_VALUES)), 0
        """The route's points (K, 8) at the samples, and the step at which they begin."""

    def look_ahead(self, outlook: TrackAhead, at_m: list[float]) -> None:
        """Compute the lifts again if they are due; `at_m` (N,) is the leader's distance at each follower's instant.

        On the same route they continue the present splines. On another route, possibly with another leader, they
        continue the last tick's values.
        """
        going_on = outlook.route is self._route
        due = outlook.plan is not self._plan or outlook.distance_m >= self._made_at_m + ADVANCE_M
        if due or not going_on:
            self._compute(outlook, at_m, going_on=going_on)
        self._held = self.lift(at_m)

    def _compute(self, outlook: TrackAhead, at_m: list[float], *, going_on: bool) -> None:
        first = int((min(at_m) - KEPT_M) // STEP_M)
        if going_on:
            first = max(first, self._first)
            kept = int(np.ceil((max(at_m) + KEPT_M) / STEP_M)) - first + 3
            begun = list(self._control_m[:, first - self._first :][:, :kept])
        else:
            begun = self._as_they_were(outlook.leading, first, at_m)
        places = sample_places(first * STEP_M, AHEAD_STEPS)
        points = self._points(outlook.route, first, places)
        needed = self._needed(outlook, places, points)
        needed[outlook.leading] = 0.0
        bounds, slope = self._bounds(outlook.along_mps), points[:, SLOPE].copy()
        made = (least_lift(first * STEP_M, row, slope, bounds, own) for row, own in zip(needed, begun, strict=True))
        self._control_m = np.stack([lift.control_m for lift in made])
        self._curves = [LiftCurve(row) for row in self._control_m.tolist()]
        self._route, self._plan = outlook.route, outlook.plan
        self._first, self._made_at_m = first, outlook.distance_m

    def _points(self, route: Route, first: int, places: Array) -> Array:
        """Return the route's points (K, 8) at `places` (K,), which begin at the step `first`.

        Samples lie at multiples of their distance, so most of them are those of the last time.
        """
        passed = SAMPLES * (first - self._sampled_first)
        known = self._sampled[passed:] if route is self._route and passed >= 0 else self._sampled[:0]
        added = [route.at(distance).values() for distance in places[len(known) :].tolist()]
        self._sampled = np.concatenate((known, np.array(added).reshape(-1, PATH_VALUES)))
        self._sampled_first = first
        return self._sampled

    def lifted(self, slots: list[Slot], at_m: list[float], along_mps: float) -> list[Slot]:
        """Return N slots lifted clear of the ground; `at_m`: the leader's distance for each, `along_mps`: its speed."""
        each = zip(slots, self.lift(at_m), strict=True)
        return [
            slot.raised(lift_m, along_mps * slope, along_mps**2 * curvature)
            for slot, (lift_m, slope, curvature) in each
        ]

    def _as_they_were(self, leading: int, first: int, at_m: list[float]) -> list[Array]:
        """Return the first control points of lifts that continue those of the last tick, relative to the leader's own.

        Height, slope and curvature are continuous. A new leader continues from its own lifted height, so followers that
        were lifted less are below their slots at first.
        """
        if self._route is None:
            return [np.zeros(0)] * len(at_m)
        own, begun = self._held[leading], list[Array]()
        for held, distance_m in zip(self._held, at_m, strict=True):
            lift_m, slope, curvature = held[0] - own[0], held[1] - own[1], held[2] - own[2]
            ahead = distance_m / STEP_M - first
            x_m = (np.arange(int(ahead) + 4) - 1.0 - ahead) * STEP_M
            # Control points of a quadratic, which a cubic B-spline represents exactly.
            begun.append(lift_m + slope * x_m + curvature * (x_m**2 / 2.0 - STEP_M**2 / 6.0))
        return begun

    def lift(self, at_m: list[float]) -> list[Triple]:
        """Return N lifts, their slopes and their curvatures by the leader's distance, at N distances."""
        first = self._first
        return [curve.at(each / STEP_M - first) for curve, each in zip(self._curves, at_m, strict=True)]

    def _needed(self, outlook: TrackAhead, places: Array, points: Array) -> Array:
        """Return the required lifts (N, K) for the leader at distances `places` (K,), the route's `points` (K, 8)."""
        north, east, height, course, curvature = points.T[:5]
        leader = outlook.leader
        aside_mps = leader.wind_east_mps * np.cos(course) - leader.wind_north_mps * np.sin(course)
        heading = course - np.arcsin(np.clip(aside_mps / max(leader.airspeed_mps, 1.0), -1.0, 1.0))
        later_s = (places - outlook.distance_m) / max(outlook.along_mps, 1.0)
        knots = np.stack([outlook.slots(seconds) for seconds in later_s[::SAMPLES].tolist()], axis=1)
        forward, right, up = np.moveaxis(_between(knots), -1, 0)
        own = heading + np.arcsin(np.clip(curvature * forward, -0.99, 0.99))
        axis = axis_rad(self._frame, np.broadcast_to(heading, forward.shape), own)
        ground_m = self._ground.height(*beside(north, east, axis, forward, right))
        return ground_m + self._clearance_m - (height + up)


def _between(knots: Array) -> Array:
    """Return positions (N, K, 3) at every sample, linearly interpolated from those at every knot (N, S, 3)."""
    share = (np.arange(SAMPLES) / SAMPLES)[:, None]
    steps = knots[:, :-1, None] + share * np.diff(knots, axis=1)[:, :, None]
    return np.concatenate((steps.reshape(knots.shape[0], -1, 3), knots[:, -1:]), axis=1)

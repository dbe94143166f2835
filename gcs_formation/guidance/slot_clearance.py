"""Slots over terrain: the terrain-clearance offset of each slot that keeps its clearance.

The leader's height along its route is known in advance, and with it the track of every slot. For the next two
kilometres every slot gets the smallest offset that keeps its clearance, within the climb that the leader's own climb
leaves. The offset continues the previous one. It is computed again where it no longer serves, and whenever the route or
the plan changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from flight_model.arrays import Array, offset_points
from flight_model.flight_state import FlightState
from flight_model.offset_curve import STEP_M, OffsetCurve
from flight_model.path import Route
from flight_model.path_offsets import (
    SAMPLES,
    TRIFLE_M,
    Bounds,
    ClearanceOffset,
    min_offset,
    sample_distances,
)
from flight_model.slot import Slot, Vector3
from formation_scenario.fields import Frame
from formation_scenario.slot_assignment import Arrangement
from formation_scenario.slot_frame import axis_rad
from formation_scenario.terrain import Ground

AHEAD_STEPS: Final = 140
"""Steps of the offsets' splines. Tuned: steps; `MIN_AHEAD_STEPS` to 300; shown by `pytest
tests/gcs_formation/guidance`."""
MIN_AHEAD_STEPS: Final = 100
"""Of these, how many must be left: 2 km, on which a climb at the formation's limit gains 190 m. Tuned: steps; 50 to
200; shown by `pytest tests/gcs_formation/guidance`."""
ADVANCE_M: Final = 100.0
"""Distance that the leader flies before offsets are checked again, and computed again unless they still serve. Tuned:
m; 50 to 300; shown by `pytest tests/gcs_formation/guidance`."""
SAME_BOUNDS: Final = 0.01
"""Share by which the bound of slope may differ from that for which offsets were computed. Tuned: share; 0.005 to 0.05;
shown by `pytest tests/gcs_formation/guidance`."""
PATH_VALUES: Final = 8
SLOPE: Final = 6
"""How many values a path's point has, and which of them is its slope (`PathPoint.values`)."""
KEPT_M: Final = 40.0
"""Distance around the present position within which an offset isn't changed, since setpoints act at different times.
Tuned: m; 20 to 80; shown by `pytest tests/gcs_formation/guidance`."""


@dataclass(frozen=True)
class TrackAhead:
    """The future track of the leader and of the slots."""

    route: Route
    leader: FlightState
    leading: int
    """Index of the leader's own slot among the N; it has no offset."""
    distance_m: float
    along_mps: float
    slots: Callable[[float], Array]
    """Seconds from now -> slots (N, 3)."""
    plan: Arrangement
    """Identifies the plan of the slots: a different object if the plan has changed."""


class SlotClearance:
    """The terrain-clearance offsets of N slots, and the route and plan for which they were computed."""

    def __init__(self, ground: Ground, clearance_m: float, bounds: Callable[[float], Bounds], frame: Frame) -> None:
        """Keep `clearance_m` above the ground.

        `bounds`: of the leader's route and the offset together, at the leader's speed over ground, m/s.
        """
        self._ground, self._clearance_m = ground, clearance_m
        self._bounds, self._frame = bounds, frame
        self._route: Route | None = None
        self._plan: Arrangement | None = None
        self._slope = 0.0
        """The bound of slope for which the offsets were computed."""
        self._first, self._made_at_m = 0, 0.0
        self._control_m = np.zeros((0, 4))
        self._curves = list[OffsetCurve]()
        self._held = list[Vector3]()
        """Each offset of the last tick, its slope and its curvature."""
        self._sampled, self._sampled_first = np.zeros((0, PATH_VALUES)), 0
        """The route's points (K, 8) at the samples, and the step at which they begin."""

    def look_ahead(self, outlook: TrackAhead, at_m: list[float]) -> None:
        """Compute the offsets again if they are due; `at_m` (N,) is the leader's distance at each follower's instant.

        On the same route they continue the present splines. On another route, possibly with another leader, they
        continue the last tick's values.
        """
        going_on = outlook.route is self._route
        changed = not going_on or outlook.plan is not self._plan
        if changed or outlook.distance_m >= self._made_at_m + ADVANCE_M:
            if changed or not self._serve(outlook, at_m):
                self._compute(outlook, at_m, going_on=going_on)
            self._made_at_m = outlook.distance_m
        self._held = self.offsets(at_m)

    def _serve(self, outlook: TrackAhead, at_m: list[float]) -> bool:
        """Return whether the present offsets reach far enough ahead, within bounds as now, and clear the ground.

        The ground is the same as ever; where the slots will be above it varies with the wind, by millimetres in calm.
        """
        first = max(int((min(at_m) - KEPT_M) // STEP_M), self._first)
        steps = self._control_m.shape[1] - 3 - (first - self._first)
        slope = self._bounds(outlook.along_mps).slope
        if steps < MIN_AHEAD_STEPS or abs(slope - self._slope) > SAME_BOUNDS * self._slope:
            return False
        places = sample_distances(first * STEP_M, steps)
        needed = self._needed(outlook, places, self._points(outlook.route, first, places))
        offsets_m = [ClearanceOffset(self._first * STEP_M, row).at(places)[0] for row in self._control_m]
        short = needed > np.stack(offsets_m) + TRIFLE_M
        short[outlook.leading] = False
        return not short.any()

    def _compute(self, outlook: TrackAhead, at_m: list[float], *, going_on: bool) -> None:
        first = int((min(at_m) - KEPT_M) // STEP_M)
        if going_on:
            first = max(first, self._first)
            kept = int(np.ceil((max(at_m) + KEPT_M) / STEP_M)) - first + 3
            begun = list(self._control_m[:, first - self._first :][:, :kept])
        else:
            begun = self._as_they_were(outlook.leading, first, at_m)
        places = sample_distances(first * STEP_M, AHEAD_STEPS)
        points = self._points(outlook.route, first, places)
        needed = self._needed(outlook, places, points)
        needed[outlook.leading] = 0.0
        bounds, slope = self._bounds(outlook.along_mps), points[:, SLOPE].copy()
        made = (min_offset(first * STEP_M, row, slope, bounds, own) for row, own in zip(needed, begun, strict=True))
        self._control_m = np.stack([each.control_m for each in made])
        self._curves = [OffsetCurve(row) for row in self._control_m.tolist()]
        self._route, self._plan = outlook.route, outlook.plan
        self._first, self._slope = first, bounds.slope

    def _points(self, route: Route, first: int, places: Array) -> Array:
        """Return the route's points (K, 8) at `places` (K,), which begin at the step `first`.

        Samples lie at multiples of their distance, so most of them are those of the last time.
        """
        passed = SAMPLES * (first - self._sampled_first)
        known = self._sampled[passed:] if route is self._route and passed >= 0 else self._sampled[:0]
        added = [route.at(distance).values() for distance in places[len(known) :].tolist()]
        self._sampled = np.concatenate((known, np.array(added).reshape(-1, PATH_VALUES)))
        self._sampled_first = first
        return self._sampled[: len(places)]

    def raised(self, slots: list[Slot], at_m: list[float], along_mps: float) -> list[Slot]:
        """Return N slots raised clear of the ground; `at_m`: the leader's distance for each, `along_mps`: its speed."""
        each = zip(slots, self.offsets(at_m), strict=True)
        return [
            slot.raised(offset_m, along_mps * slope, along_mps**2 * curvature)
            for slot, (offset_m, slope, curvature) in each
        ]

    def _as_they_were(self, leading: int, first: int, at_m: list[float]) -> list[Array]:
        """Return the first control points of offsets that continue the last tick's, relative to the leader's own.

        Height, slope and curvature are continuous. A new leader continues from its own raised height, so followers that
        were raised less are below their slots at first.
        """
        if self._route is None:
            return [np.zeros(0)] * len(at_m)
        own, begun = self._held[leading], list[Array]()
        for held, distance_m in zip(self._held, at_m, strict=True):
            offset_m, slope, curvature = held[0] - own[0], held[1] - own[1], held[2] - own[2]
            ahead = distance_m / STEP_M - first
            x_m = (np.arange(int(ahead) + 4) - 1.0 - ahead) * STEP_M
            # Control points of a quadratic, which a cubic B-spline represents exactly.
            begun.append(offset_m + slope * x_m + curvature * (x_m**2 / 2.0 - STEP_M**2 / 6.0))
        return begun

    def offsets(self, at_m: list[float]) -> list[Vector3]:
        """Return N offsets, their slopes and their curvatures by the leader's distance, at N distances."""
        first = self._first
        return [curve.at(each / STEP_M - first) for curve, each in zip(self._curves, at_m, strict=True)]

    def _needed(self, outlook: TrackAhead, places: Array, points: Array) -> Array:
        """Return the required offsets (N, K) for the leader at distances `places` (K,), the route's `points` (K, 8)."""
        north, east, height, course, curvature = points.T[:5]
        leader = outlook.leader
        crosswind_mps = leader.wind_east_mps * np.cos(course) - leader.wind_north_mps * np.sin(course)
        heading = course - np.arcsin(np.clip(crosswind_mps / max(leader.airspeed_mps, 1.0), -1.0, 1.0))
        later_s = (places - outlook.distance_m) / max(outlook.along_mps, 1.0)
        knots = np.stack([outlook.slots(seconds) for seconds in later_s[::SAMPLES].tolist()], axis=1)
        forward, right, up = np.moveaxis(_between(knots), -1, 0)
        own = heading + np.arcsin(np.clip(curvature * forward, -0.99, 0.99))
        axis = axis_rad(self._frame, np.broadcast_to(heading, forward.shape), own)
        ground_m = self._ground.height(*offset_points(north, east, axis, forward, right))
        return ground_m + self._clearance_m - (height + up)


def _between(knots: Array) -> Array:
    """Return positions (N, K, 3) at every sample, linearly interpolated from those at every knot (N, S, 3)."""
    share = (np.arange(SAMPLES) / SAMPLES)[:, None]
    steps = knots[:, :-1, None] + share * np.diff(knots, axis=1)[:, :, None]
    return np.concatenate((steps.reshape(knots.shape[0], -1, 3), knots[:, -1:]), axis=1)

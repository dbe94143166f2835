"""Repair by the path's points: waypoints are moved, added or left out, as few of them by as little as possible.

Each round takes what `check` found:

- waypoints less than a metre apart: the second one is left out;
- too low, or too high for the fence: such waypoints get bounds, and `heights.min_changes` the rest;
- too steep: the rise of that leg is bounded, likewise;
- outside the fence: the nearest waypoints move inwards by as much;
- a spline's bend that is too tight: the points of a turn that all slots can fly, as of a path of legs, take the place
  of its waypoint.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from flight_model.legs.path import LegsPath, Passed
from formation_scenario.model import Scenario
from formation_scenario.path_of_legs import path_of_legs
from formation_scenario.repair.draft import Draft, Waypoint
from formation_scenario.repair.heights import min_changes
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.turn_limits import climb_limits, turns_well
from formation_scenario.violations import Violation

BENDS = ("turn", "slot turn", "slot speed", "slot acceleration", "slot setpoint")
HELPED = ("waypoints", "climb", "clearance", "fence", "fence height", "circles", *BENDS)
"""Kinds of violations against which points may help."""
MAX_ROUNDS = 14
MAX_ADDED = 12
"""Number of points that are added to a spline before other means are tried: legs turn by themselves."""
MARGIN_M = 0.02
"""By so much more than lacks waypoints are raised: they are rounded to centimetres."""
INSIDE_M = 0.5
TOGETHER_M = 1.0
"""Waypoints that are passed within less have one height."""
GENTLER, GENTLEST = 0.97, 0.6
"""Factors of the allowed rise of a leg that is too steep: below what it was, and at least, from round to round."""
DENSITIES = (1.0, 0.6, 0.35)
"""Distances of a turn's points, in its radii; the next is tried where the one before is too coarse for the spline."""


class Points:
    """The waypoints of a draft, what is known of their bounds, and which are replaced by turns."""

    def __init__(self, draft: Draft, move_max_m: float, *, far: bool = False) -> None:
        """Take a draft and the farthest that a waypoint may be moved, m; `far`: in turns of any width, too."""
        waypoints = np.array(draft.scenario.path.waypoints_m, dtype=np.float64)
        count = len(waypoints)
        self._far = far
        self._draft, self._move_max_m, self._spline = draft, move_max_m, draft.scenario.path.kind == "spline"
        self._given, self._flat, self._heights = waypoints, waypoints[:, :2].copy(), waypoints[:, 2].copy()
        self._low, self._high = np.full(count, -np.inf), np.full(count, np.inf)
        self._rises = np.full(count - 1, np.inf)
        self._kept = np.ones(count, dtype=np.bool_)
        self._rounded = dict[int, int]()
        self._base = list(range(count))
        """The given waypoint of each point of the latest draft."""

    def drafts(self) -> Iterator[Draft]:
        """Yield drafts, each with what was found in the one before repaired; ends when that isn't possible."""
        draft = self._draft
        for _ in range(MAX_ROUNDS):
            self._learn(draft)
            found = self._built()
            if found is None or found.source.data == draft.source.data:
                return
            draft = found
            yield draft
            if draft.badness() == math.inf or not draft.has(*HELPED):
                return

    def _learn(self, draft: Draft) -> None:
        """Take up what was found in a draft."""
        near = set[int]()
        for each in draft.violations:
            at = None if each.waypoint is None else self._base[each.waypoint]
            if each.kind == "waypoints":
                self._leave_out(at)
            elif each.kind == "climb":
                self._flatten(draft, each)
            elif each.kind in BENDS and self._spline and at is not None:
                near.add(at)
            for waypoint, move in each.moves.items():
                self._move(self._base[waypoint], move)
        for at in near:
            self._rounded[at] = self._rounded.get(at, -1) + 1

    def _leave_out(self, at: int | None) -> None:
        """Leave out a waypoint that is as good as the one before; the last one stays, the one before it goes."""
        if at is None or self._kept.sum() <= 2:
            return
        if at == len(self._kept) - 1:
            at = int(np.flatnonzero(self._kept)[-2])
        self._kept[at] = False

    def _move(self, at: int, move: Waypoint) -> None:
        north_m, east_m, up_m = move
        height_m = self._heights[at]
        if up_m > 0.0:
            self._low[at] = max(self._low[at], height_m + up_m + MARGIN_M)
        elif up_m < 0.0:
            self._high[at] = min(self._high[at], height_m + up_m - MARGIN_M)
        size_m = math.hypot(north_m, east_m)
        if size_m > 0.0:
            by_m = self._flat[at] + np.array([north_m, east_m]) * (1.0 + INSIDE_M / size_m) - self._given[at, :2]
            within = min(1.0, self._move_max_m / max(float(np.hypot(*by_m)), 1e-9))
            self._flat[at] = self._given[at, :2] + within * by_m

    def _flatten(self, draft: Draft, steep: Violation) -> None:
        """Bound the rise of a leg that is too steep: what may be flown on it, and less from round to round."""
        at_m = draft.scenario.written_path.waypoints_at_m
        end = int(np.clip(np.searchsorted(at_m, steep.at_m), 1, at_m.size - 1))
        begin = end - 1
        while begin > 0 and at_m[end - 1] - at_m[begin - 1] < TOGETHER_M:  # passed at once, in one turn
            begin -= 1
        first, last = self._base[begin], max(self._base[end], self._base[begin] + 1)
        if self._spline and math.isfinite(self._rises[first]):  # the legs beside it make it swing
            first, last = max(first - 1, 0), min(last + 1, len(self._rises))
        factor = max(GENTLEST, GENTLER / (1.0 + max(steep.excess, 0.0)))
        for leg in range(first, last):
            rise_m, known_m = abs(self._heights[leg + 1] - self._heights[leg]), self._rises[leg]
            if self._spline or math.isfinite(known_m) or last - first > 1:
                self._rises[leg] = min(known_m, factor * rise_m)
            else:
                # A detour between two legs is flown level: a leg has no more room than between its own waypoints.
                leg_m = float(np.hypot(*(self._flat[leg + 1] - self._flat[leg])))
                max_m = _flown_m(draft.scenario, end, min(leg_m, float(at_m[end] - at_m[begin])))
                self._rises[leg] = min(max_m, rise_m)

    def _built(self) -> Draft | None:
        """Return the draft with all that is known, None if heights contradict each other."""
        heights_m, kept = self._given[:, 2].copy(), np.flatnonzero(self._kept)
        if np.isfinite(self._low).any() or np.isfinite(self._high).any() or np.isfinite(self._rises).any():
            rises_m = np.array([self._rises[a:b].min() for a, b in pairwise(kept.tolist())])
            low = np.maximum(self._low, heights_m - self._move_max_m)[kept]
            high = np.minimum(self._high, heights_m + self._move_max_m)[kept]
            found = min_changes(heights_m[kept], (np.minimum(low, high), high), rises_m)
            if found is None:
                return None
            heights_m[kept] = found
        self._heights = heights_m
        points = [(float(n), float(e), float(h)) for (n, e), h in zip(self._flat, heights_m, strict=True)]
        return self._rounded_off([points[each] for each in kept], kept.tolist())

    def _rounded_off(self, points: list[Waypoint], kept: list[int]) -> Draft:
        """Return the draft through points, with turns in place of those that are too sharp for a spline."""
        draft, self._base = self._draft.with_waypoints(points, [self._draft.origins[each] for each in kept]), kept
        if not self._rounded:
            return draft
        scenario = draft.scenario
        steps, wind_mps = slot_schedule(scenario), math.hypot(*scenario.drift_mps)
        if not self._far and not turns_well(scenario, steps, scenario.path.begin_mps, wind_mps):
            return draft
        plan = scenario.path.model_copy(update={"kind": "legs"})
        legs = path_of_legs(scenario, plan, scenario.drift_mps, scenario.fence, draft.detours)
        found, base, at = [points[0]], [kept[0]], 1
        for passed in legs.passed:
            inside = range(passed.first, passed.last + 1)
            sharp = [self._rounded[kept[each]] for each in inside if kept[each] in self._rounded]
            turn = _turn(legs, passed, max(sharp)) if sharp else [points[each] for each in inside]
            found += turn
            base += [kept[min(inside, key=lambda each: math.dist(points[each][:2], point[:2]))] for point in turn]
            at = passed.last + 1
        if len(found) + len(points) - at > len(points) + MAX_ADDED and not self._far:
            return draft
        found, self._base = found + points[at:], base + kept[at:]
        return self._draft.with_waypoints(found, self._origins(found))

    def _origins(self, found: list[Waypoint]) -> list[int | None]:
        """Return the origin of the point that is nearest to each waypoint; the others are added ones."""
        nearest = dict[int, tuple[float, int]]()
        for index, (point, base) in enumerate(zip(found, self._base, strict=True)):
            nearest[base] = min(nearest.get(base, (math.inf, 0)), (math.dist(point, self._given[base]), index))
        return [
            self._draft.origins[base] if nearest[base][1] == index else None for index, base in enumerate(self._base)
        ]


def _flown_m(scenario: Scenario, waypoint: int, length_m: float) -> float:
    """Return the most by which the leg to a waypoint may rise, with its rounding."""
    limits = climb_limits(scenario, scenario.path.legs_mps[waypoint - 1], math.hypot(*scenario.drift_mps))
    return max(limits.slope * (length_m - limits.shortest_rounding_m), 0.0)


def _turn(legs: LegsPath, passed: Passed, density: int) -> list[Waypoint]:
    """Return points of a turn, its begin and end among them."""
    step_m = legs.tightest_m * DENSITIES[min(density, len(DENSITIES) - 1)]
    count = max(2, math.ceil(passed.length_m / step_m))
    at_m = passed.begin_m + passed.length_m * np.arange(count + 1) / count
    points = legs.at(at_m)
    rows = np.stack((points.north_m, points.east_m, points.height_m), axis=1).tolist()
    return [(n, e, h) for n, e, h in rows]

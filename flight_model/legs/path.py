"""The path of legs: straights and joints one after another, as one curve by arc length."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from flight_model.arrays import TURN, Array, Indices
from flight_model.legs.circling import Circles, Circling, Nodes, nodes
from flight_model.legs.heights import Climbs, Heights, eased, profile
from flight_model.legs.joining import Joiner, Placed, TurnRules
from flight_model.legs.joint import SAMPLES, Joint, courses_rad, points
from flight_model.legs.turn import NEGLIGIBLE_M, Stretch, TurnLimits, turn_length_m, turn_stretches, turned_m
from flight_model.path import FlightPath, PathError, hermite_pieces

MIN_LEG_M = 1.0
PIECE_RAD = 0.1
"""Largest angle of a curved piece; the error of its quintic is far below a millimetre."""
PIECE_M = 2000.0
MIN_CURVED = 4
SEPARATION_M = 0.5
"""Nodes for heights are moved to others that are nearer than this, so that no piece is tiny."""
TINY_M = 1.0
"""Length of pieces below which they are cubics."""
MAX_CIRCLES = 200
BETWEEN_SHARE = 0.5
"""Share of the leg between two waypoints by which their points on one turn that passes both are separated at least."""
_ABSCISSAE, _WEIGHTS = np.polynomial.legendre.leggauss(8)


class LegPlan(NamedTuple):
    """Limits of the n - 1 legs, and what becomes of one that is too steep."""

    turns: TurnRules
    climbs: Sequence[Climbs]
    circle: bool = False
    """Whether a leg that is too steep ends in circles; else it is too steep."""
    circles: Mapping[int, Circles] = MappingProxyType({})
    """Circles at waypoints, by their index."""


class Passed(NamedTuple):
    """How one or several waypoints, `first` to `last`, are passed: what is flown, where, and how far from them."""

    first: int
    last: int
    kind: str
    begin_m: float
    length_m: float


class LegsPath(FlightPath):
    """Straight legs through waypoints, joined by turns; begins and ends at the first and the last waypoint.

    Attributes:
        passed: how each waypoint but the first and the last is passed.
        tightest_m: radius of the tightest turn, infinite without turns.
        steep: what is too steep, by the index of the waypoint at which that ends.
        circle_radii_m: of the circles that are asked for, by their waypoint.
        crowded_m: waypoints whose leg has no room for their circles, and the straight that they need there.
        nodes: of the legs that are asked for, (k,) north + i east; circles have two, where their tangents touch them.
        nodes_at_m: (k,) where these are passed.
        circling_m: where circles that are asked for begin and end.
    """

    def __init__(self, waypoints_m: Sequence[Sequence[float]] | Array, plan: LegPlan) -> None:
        """Take (n, 3) north, east and height in m, n >= 2, and the limits.

        Raises:
            PathError: two successive waypoints less than 1 m apart horizontally.
        """
        waypoints = np.asarray(waypoints_m, dtype=np.float64)
        flat = waypoints[:, 0] + 1j * waypoints[:, 1]
        short = np.flatnonzero(np.abs(np.diff(flat)) < MIN_LEG_M)
        if short.size:
            found = f"found a waypoint {abs(flat[short[0] + 1] - flat[short[0]]):.3g} m from the one before it"
            raise PathError(found, int(short[0]) + 1)
        nodes_ = nodes(flat, plan.circles, plan.turns.limits)
        line = _Line(nodes_, waypoints[:, 2], plan)
        limits = [plan.turns.limits[waypoint - 1] for waypoint in nodes_.waypoints[1:]]
        line.lay(Joiner(nodes_.flat, replace(plan.turns, limits=limits), line.given).joints())
        self.crowded_m, self.circle_radii_m = line.crowded_m, line.circle_radii_m
        self.nodes, self.nodes_at_m, self.circling_m = nodes_.flat, np.array(line.nodes_at_m), line.circling_m
        self._circled_m = line.circled_m
        self.passed, at_m = line.passed, np.array(line.knots_m)
        heights, steep = profile(at_m, np.array(line.heights_m), line.climbs)
        self.steep = {line.ends_at[each.interval]: each for each in steep}
        course_rad = float(np.angle(nodes_.flat[1] - flat[0]))
        nodes_m, coefficients = _curve(flat[0], course_rad, line.stretches, heights)
        curvature_1pm = max(abs(each.to_1pm) for each in line.stretches)
        self.tightest_m = 1.0 / curvature_1pm if curvature_1pm else math.inf
        super().__init__(nodes_m, np.array(line.waypoints_at_m), coefficients)

    @property
    def straights_m(self) -> list[tuple[int, float, float]]:
        """The legs that are flown straight: index, and the distances between the turns at their ends, m."""
        begins = [(0, 0.0), *((each.last, each.begin_m + each.length_m) for each in self.passed)]
        ends_m = [*(each.begin_m for each in self.passed), self.length_m]
        ends_m = [
            min(end_m, self._circled_m.get(leg, math.inf)) for (leg, _), end_m in zip(begins, ends_m, strict=True)
        ]
        legs = len(self.waypoints_at_m) - 1
        return [(leg, begin_m, end_m) for (leg, begin_m), end_m in zip(begins, ends_m, strict=True) if leg < legs]


class _Line:
    """The stretches of a path as they are laid out, and the distances at which waypoints' heights are due."""

    def __init__(self, nodes_: Nodes, heights_m: Array, plan: LegPlan) -> None:
        self._nodes, self._flat = nodes_, nodes_.flat
        self._legs_m: list[float] = np.abs(np.diff(nodes_.flat)).tolist()
        self._wanted_m, self._plan = heights_m.tolist(), plan
        around = {nodes_.waypoints[node] for node in nodes_.turns}
        self._touching = {index: each for index, each in plan.circles.items() if index not in around}
        self.stretches = list[Stretch]()
        self.length_m = 0.0
        self.passed = list[Passed]()
        self.waypoints_at_m, self.knots_m, self.heights_m = [0.0], [0.0], [float(heights_m[0])]
        self.climbs, self.ends_at = list[Climbs](), list[int]()
        self.circled_m, self.crowded_m = dict[int, float](), dict[int, float]()
        self.circle_radii_m = dict[int, float]()
        self.nodes_at_m, self.circling_m = [0.0], list[tuple[float, float]]()

    @property
    def given(self) -> dict[int, Joint]:
        """The turns around circled waypoints, by their first node, without the circles of a climb."""
        return {node: _around(*turn) for node, turn in self._nodes.turns.items()}

    def lay(self, joints: list[Placed]) -> None:
        """Lay out all legs and joints."""
        leg, taken_m, names = 0, 0.0, self._nodes.waypoints
        for first, last, joint, *_ in joints:
            straight_m = self._legs_m[leg] - taken_m - joint.before_m
            if first in self._nodes.turns:
                self._circle(first, straight_m)
            else:
                self._joint(names[first], names[last], joint, self._passing(first, last, joint), straight_m)
            leg, taken_m = last, joint.after_m
        self._straight(names[-1], self._legs_m[leg] - taken_m, 0.0)
        self.nodes_at_m.append(self.length_m)
        if len(self.waypoints_at_m) < len(self._wanted_m):
            self.waypoints_at_m.append(self.length_m)
        self._due(names[-1], self.length_m)

    def _joint(self, first: int, last: int, joint: Joint, passing_m: list[float], straight_m: float) -> None:
        """Lay out the straight before a joint of waypoints `first` to `last`, and the joint."""
        self._straight(first, straight_m, passing_m[0])
        begin_m, self.length_m = self.length_m, self.length_m + joint.length_m
        self.stretches += joint.stretches
        for inside in range(first + 1, last + 1):
            if self._touching.get(inside, Circles(0)).turns:
                self.crowded_m[inside] = float(turned_m(np.asarray(TURN), self._limits(inside, None)).real)
        self.passed.append(Passed(first, last, joint.kind, begin_m, joint.length_m))
        for waypoint, after_m in zip(range(first, last + 1), passing_m, strict=True):
            self.waypoints_at_m.append(begin_m + after_m)
            self.nodes_at_m.append(begin_m + after_m)
            self._due(waypoint, begin_m + after_m)
        if joint.kind == "detour" and first == last:
            self._due(last, self.length_m)

    def _circle(self, node: int, straight_m: float) -> None:
        """Lay out the straight before circles around a waypoint, and the circles: level, or as a climb to it takes."""
        waypoint, (angle_rad, around) = self._nodes.waypoints[node], self._nodes.turns[node]
        self._straight(waypoint, straight_m, 0.0)
        begin_m, joint = self.length_m, _around(angle_rad, around)
        if around.turns:
            self._due(waypoint, begin_m)
        rise_m, climbs = self._wanted_m[waypoint] - self.heights_m[-1], self._plan.climbs[waypoint - 1]
        for more in range(MAX_CIRCLES):
            joint = _around(angle_rad + math.copysign(more * TURN, angle_rad), around)
            whole_m = begin_m - self.knots_m[-1] + joint.length_m
            if around.turns or eased(whole_m, rise_m, (0.0, 0.0), climbs) is not None:
                break
        self.stretches += joint.stretches
        self.length_m += joint.length_m
        self.passed.append(Passed(waypoint, waypoint, joint.kind, begin_m, joint.length_m))
        self.circle_radii_m[waypoint] = 1.0 / around.limits.curvature_1pm
        self.waypoints_at_m.append(self.length_m)
        self.nodes_at_m += [begin_m, self.length_m]
        self.circling_m.append((begin_m, self.length_m))
        self._due(waypoint, self.length_m)

    def _passing(self, first: int, last: int, joint: Joint) -> list[float]:
        """Return the distances along a joint at which its waypoints are passed."""
        count = last - first
        if joint.kind in ("detour", "over"):
            return [joint.length_m * each / max(count, 1) for each in range(count + 1)]
        if count == 0 and joint.kind == "turn":
            return [joint.length_m / 2.0]
        axis = self._flat[first] - self._flat[first - 1]
        axis = axis / abs(axis)
        curve = self._flat[first] - joint.before_m * axis + axis * points(joint.stretches, SAMPLES)
        nearest = np.abs(self._flat[first : last + 1, None] - curve).argmin(axis=1)
        gaps_m = BETWEEN_SHARE * np.array(self._legs_m[first:last])
        return _separated(joint.length_m * nearest / SAMPLES, gaps_m, joint.length_m)

    def _due(self, waypoint: int, at_m: float) -> None:
        """Note a waypoint's height at a distance; the higher limit of slopes is that of the leg before it."""
        if at_m - self.knots_m[-1] > NEGLIGIBLE_M:
            self.knots_m.append(at_m)
            self.heights_m.append(self._wanted_m[waypoint])
            self.climbs.append(self._plan.climbs[max(waypoint - 1, 0)])
            self.ends_at.append(waypoint)

    def _straight(self, waypoint: int, length_m: float, due_m: float) -> None:
        """Lay out the rest of the leg to a waypoint, whose height is due `due_m` later; with circles if it is steep."""
        asked = self._touching.get(waypoint, Circles(0) if self._plan.circle else None)
        limits = self._limits(waypoint, asked)
        circles = () if asked is None else self._circles(waypoint, length_m, due_m, asked)
        if circles:
            length_m -= float(turned_m(np.asarray(TURN), limits).real)
        if length_m > NEGLIGIBLE_M:
            self.stretches.append(Stretch(length_m))
            self.length_m += length_m
        if circles:
            self.circled_m[waypoint - 1] = self.length_m
            self.circle_radii_m[waypoint] = 1.0 / limits.curvature_1pm
            if asked is not None and asked.turns:  # asked for at the waypoint's height
                self._due(waypoint, self.length_m)
            begin_m, self.length_m = self.length_m, self.length_m + sum(each.length_m for each in circles)
            self.circling_m.append((begin_m, self.length_m))
        self.stretches += circles

    def _limits(self, waypoint: int, asked: Circles | None) -> TurnLimits:
        """Return the limits of circles before a waypoint, widened to the radius that is asked for."""
        limits = self._plan.turns.limits[waypoint - 1]
        return limits if asked is None else limits.widened(max(1.0, abs(asked.radius_m) * limits.curvature_1pm))

    def _circles(self, waypoint: int, length_m: float, due_m: float, asked: Circles) -> tuple[Stretch, ...]:
        """Return the circles at the end of a leg: those asked for, or the fewest that make it flat enough.

        None if there is no room for one.
        """
        limits, climbs = self._limits(waypoint, asked), self._plan.climbs[waypoint - 1]
        rise_m = self._wanted_m[waypoint] - self.heights_m[-1]
        forward_m = float(turned_m(np.asarray(TURN), limits).real)
        if asked.turns and forward_m > length_m:
            self.crowded_m[waypoint] = forward_m - length_m
        if forward_m > length_m or (not asked.turns and rise_m == 0.0):
            return ()
        if asked.turns:
            return self._to_side(waypoint, asked, limits, length_m - forward_m)
        for count in range(MAX_CIRCLES):
            whole_m = self.length_m - self.knots_m[-1] + length_m + due_m
            if count:
                whole_m += float(turn_length_m(np.asarray(count * TURN), limits)) - forward_m
            if eased(whole_m, rise_m, (0.0, 0.0), climbs) is not None:
                break
        return self._to_side(waypoint, asked._replace(turns=count), limits, length_m - forward_m)

    def _to_side(self, waypoint: int, circles: Circles, limits: TurnLimits, after_m: float) -> tuple[Stretch, ...]:
        angle_rad = circles.turns * TURN
        if circles.radius_m:
            return turn_stretches(math.copysign(angle_rad, circles.radius_m), limits)
        return self._to_roomier_side(waypoint, angle_rad, limits, after_m)

    def _to_roomier_side(
        self, waypoint: int, angle_rad: float, limits: TurnLimits, after_m: float
    ) -> tuple[Stretch, ...]:
        node = self._nodes.waypoints.index(waypoint)
        lack, leg = self._plan.turns.lack, self._flat[node] - self._flat[node - 1]
        both = [turn_stretches(side * angle_rad, limits) for side in (1.0, -1.0)]
        if lack is None or not both[0]:
            return both[0]
        begin = self._flat[node] - leg / abs(leg) * (abs(leg) - after_m if after_m < 0.0 else 0.0)
        course = float(np.angle(leg))
        return min(
            both,
            key=lambda each: lack(begin + np.exp(1j * course) * points(each, 100), course + courses_rad(each, 100)),
        )


def _separated(at_m: Array, gaps_m: Array, length_m: float) -> list[float]:
    """Return rising distances (n,) near to others along a curve, with gaps (n - 1,) between them as far as it has room.

    Each waypoint that one turn passes so has a position of its own, and so a height.
    """
    gaps_m = gaps_m * min(1.0, length_m / max(float(gaps_m.sum()), NEGLIGIBLE_M))
    before_m = np.concatenate((np.zeros(1), np.cumsum(gaps_m)))
    latest_m = length_m - (before_m[-1] - before_m)
    return np.minimum(np.maximum.accumulate(at_m - before_m) + before_m, latest_m).tolist()


def _around(angle_rad: float, circling: Circling) -> Joint:
    """Return circles around a waypoint as a joint."""
    return Joint(circling.lead_m, circling.lead_m, turn_stretches(angle_rad, circling.limits), "circle")


def _curve(start: complex, course_rad: float, stretches: list[Stretch], heights: Heights) -> tuple[Array, Array]:
    """Return nodes (m + 1,) and coefficients (m, 3, 6) of the whole."""
    lengths, begun, ended = np.array(stretches).T
    ends = np.concatenate((np.zeros(1), np.cumsum(lengths)))
    angle = np.maximum(np.abs(begun), np.abs(ended)) * lengths
    bent = angle > 0.0
    counts = np.where(bent, np.maximum(np.ceil(angle / PIECE_RAD), MIN_CURVED), np.ceil(lengths / PIECE_M))
    within = [np.linspace(a, b, int(n), endpoint=False) for a, b, n in zip(ends, ends[1:], counts, strict=False)]
    nodes = np.append(np.concatenate(within), ends[-1])
    nodes = _with_nodes(nodes, heights.begin_m)
    index = np.clip(np.searchsorted(ends, nodes[:-1], side="right") - 1, 0, lengths.size - 1)
    before = np.concatenate((np.zeros(1), np.cumsum((begun + ended) / 2.0 * lengths)))

    def bearing(at_m: Array, index: Indices) -> tuple[Array, Array]:
        """Return courses and curvatures at distances on stretches."""
        along, by = at_m - ends[index], (ended - begun)[index]
        u = along / lengths[index]
        course = course_rad + before[index] + begun[index] * along + by * lengths[index] * u**3 * (1.0 - u / 2.0)
        return course, begun[index] + by * u**2 * (3.0 - 2.0 * u)

    half = np.diff(nodes) / 2.0
    inner, _ = bearing(nodes[:-1, None] + half[:, None] * (1.0 + _ABSCISSAE), index[:, None])
    steps = half * (np.exp(1j * inner) @ _WEIGHTS)
    flat = start + np.concatenate((np.zeros(1), np.cumsum(steps)))
    course, curvature = bearing(nodes, np.append(index, lengths.size - 1))
    height, slope, slope_rate = heights.at(nodes)
    axis = np.exp(1j * course)
    values = np.stack((flat.real, flat.imag, height), axis=1)
    first = np.stack((axis.real, axis.imag, slope), axis=1)
    second = np.stack((-curvature * axis.imag, curvature * axis.real, slope_rate), axis=1)
    coefficients, length = hermite_pieces(values, first, second, np.diff(nodes)), np.diff(nodes)[:, None]
    # On tiny pieces the rounding of both positions would be a large third derivative.
    tiny = length[:, 0] < TINY_M
    coefficients[tiny, :, 3] = (np.diff(second, axis=0) / (6.0 * length))[tiny]
    coefficients[tiny, :, 4:] = 0.0
    return nodes, coefficients


def _with_nodes(nodes: Array, others: Array) -> Array:
    """Return nodes with those others that aren't near to any of them."""
    found = nodes.tolist()
    for each in others.tolist():
        at = int(np.searchsorted(nodes, each))
        near = nodes[max(at - 1, 0) : at + 1]
        if np.abs(near - each).min() > SEPARATION_M:
            found.append(each)
    merged = np.sort(np.array(found))
    return merged[np.concatenate(([True], np.diff(merged) > NEGLIGIBLE_M / 10.0))]

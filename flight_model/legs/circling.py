"""Circles around waypoints: the legs before and after them are tangents, as autopilots fly to a loiter and leave it.

A turn begins with a transition, so that the straight before it passes outside its circle: `Circling.away_m` from the
centre, and the turn begins `Circling.lead_m` before the foot of the centre on it. A circled waypoint becomes two nodes
of the legs: its feet on the straights before and after it, with the turn in place of both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import TURN, Complex
from flight_model.legs.turn import TurnLimits, turned_m

ALMOST_RAD = 1e-6
"""A part of a circle that is none."""


class Circles(NamedTuple):
    """Whole circles around a waypoint; without turns as many as the leg's climb takes.

    The radius is widened to what all can fly; positive: clockwise, 0: the tightest, to the side of the next leg.
    """

    turns: int
    radius_m: float = 0.0


class Circling(NamedTuple):
    """Circles to a side, 1 clockwise or -1, within limits of turns."""

    turns: int
    side: float
    limits: TurnLimits

    @property
    def away_m(self) -> float:
        """The distance of the centre from the straights before and after the turn."""
        return float(turned_m(np.asarray(1.5 * TURN), self.limits).imag) / 2.0

    @property
    def lead_m(self) -> float:
        """The distance from where the turn begins to the foot of its centre on the straight before it."""
        return float(turned_m(np.asarray(TURN), self.limits).real) / 2.0


class Nodes(NamedTuple):
    """Nodes of legs (m,), north + i east, and the waypoint of each; the circled waypoints have two, at `turns`.

    `turns`: the angle, clockwise positive, and the circling, by the first of both nodes; climbs add whole circles.
    """

    flat: Complex
    waypoints: tuple[int, ...]
    turns: Mapping[int, tuple[float, Circling]]


def nodes(waypoints: Complex, circles: Mapping[int, Circles], limits: Sequence[TurnLimits]) -> Nodes:
    """Return the nodes of waypoints (n,) with circles around some of them.

    Those to which no tangent leads, since the waypoint before or after is too near, have no turn: one node, as others.

    Args:
        waypoints: (n,) north + i east, m.
        circles: by the index of their waypoint, from 1 on.
        limits: of each leg (n - 1,).
    """
    given = {index: each for index, each in circles.items() if 0 < index < len(waypoints)}
    chosen = {index: _circling(waypoints, index, each, limits[index - 1]) for index, each in given.items()}
    while True:
        courses = [_course_rad(waypoints, chosen, index) for index in range(len(waypoints) - 1)]
        impossible = {end for leg, course in enumerate(courses) if course is None for end in (leg, leg + 1)}
        if not impossible & chosen.keys():
            break
        chosen = {index: each for index, each in chosen.items() if index not in impossible}
    flat, names, turns = list[complex](), list[int](), dict[int, tuple[float, Circling]]()
    for index, waypoint in enumerate(waypoints.tolist()):
        if index not in chosen:
            flat.append(waypoint)
            names.append(index)
            continue
        around, arrives = chosen[index], courses[index - 1]
        leaves = courses[index] if index < len(courses) else arrives
        assert arrives is not None
        assert leaves is not None
        part_rad = (around.side * (leaves - arrives)) % TURN
        part_rad = 0.0 if part_rad > TURN - ALMOST_RAD else part_rad
        whole = around.turns or int(part_rad < around.limits.transition_rad)
        turns[len(flat)] = around.side * (part_rad + whole * TURN), around
        flat += [waypoint - around.side * around.away_m * 1j * np.exp(1j * course) for course in (arrives, leaves)]
        names += [index, index]
    if len(waypoints) - 1 in chosen:  # the path ends with its circles
        flat.append(flat[-1] + chosen[len(waypoints) - 1].lead_m * np.exp(1j * (courses[-1] or 0.0)))
        names.append(len(waypoints) - 1)
    return Nodes(np.array(flat), tuple(names), turns)


def _circling(waypoints: Complex, index: int, circles: Circles, limits: TurnLimits) -> Circling:
    wider = limits.widened(max(1.0, abs(circles.radius_m) * limits.curvature_1pm))
    if circles.radius_m:
        return Circling(circles.turns, math.copysign(1.0, circles.radius_m), wider)
    after = waypoints[min(index + 1, len(waypoints) - 1)] - waypoints[index]
    right = (after * np.conj(waypoints[index] - waypoints[index - 1])).imag >= 0.0
    return Circling(circles.turns, 1.0 if right else -1.0, wider)


def _course_rad(waypoints: Complex, chosen: Mapping[int, Circling], leg: int) -> float | None:
    """Return the course of the tangent from one waypoint or circle to the next one; None if there is none.

    With the centres D apart, and the distances of both to the right of it a and b, D sin(bearing - course) = b - a.
    """
    ends = chosen.get(leg), chosen.get(leg + 1)
    before_m, after_m = (0.0 if each is None else each.side * each.away_m for each in ends)
    between = complex(waypoints[leg + 1] - waypoints[leg])
    offset_m = after_m - before_m
    if abs(offset_m) >= abs(between):
        return None
    needed_m = sum(each.lead_m for each in ends if each is not None)
    if math.sqrt(abs(between) ** 2 - offset_m**2) < needed_m:
        return None
    return math.atan2(between.imag, between.real) - math.asin(offset_m / abs(between))

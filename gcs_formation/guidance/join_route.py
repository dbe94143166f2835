"""The shortest route to a run-in: a turn, a straight and a turn.

Source: L. E. Dubins, American Journal of Mathematics 79 (1957): shortest paths with a minimum radius between two
points.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from flight_model.curve import PathPoint

TURN: Final = 2 * math.pi


class Leg(NamedTuple):
    """A piece of constant curvature: positive to the right."""

    start: PathPoint
    length_m: float
    curvature_1pm: float

    def at(self, distance_m: float) -> PathPoint:
        """Return the point at a distance from the leg's start, at the start's height."""
        start = self.start
        if self.curvature_1pm == 0.0:
            return start.straight_on(distance_m)
        turned = start.course_rad + distance_m * self.curvature_1pm
        return PathPoint(
            start.north_m + (math.sin(turned) - math.sin(start.course_rad)) / self.curvature_1pm,
            start.east_m - (math.cos(turned) - math.cos(start.course_rad)) / self.curvature_1pm,
            start.height_m,
            turned,
        )


class JoinRoute:
    """Legs, and a height that changes from that of the first point to that of the last at `slope`."""

    def __init__(self, legs: tuple[Leg, ...], begin_height_m: float, end_height_m: float, slope: float) -> None:
        """Take the legs, the heights at both ends, and the slope between them."""
        self.legs = legs
        self.begin_height_m = begin_height_m
        self.end_height_m = end_height_m
        self.slope = slope
        self.length_m = 0.0
        """Horizontal length, m."""
        for leg in legs:
            self.length_m += leg.length_m

    def at(self, distance_m: float) -> PathPoint:
        """Return the point at a distance from the start; beyond its ends the route is straight."""
        leg, along_m = self._leg(distance_m)
        point = leg.at(along_m)
        climb_m = self.end_height_m - self.begin_height_m
        climbed_m = math.copysign(min(abs(climb_m), max(distance_m, 0.0) * self.slope), climb_m)
        climbing = distance_m >= 0.0 and abs(climbed_m) < abs(climb_m)
        return PathPoint(
            point.north_m,
            point.east_m,
            self.begin_height_m + climbed_m,
            point.course_rad,
            leg.curvature_1pm if 0.0 <= distance_m <= self.length_m else 0.0,
            0.0,
            math.copysign(self.slope, climb_m) if climbing else 0.0,
            0.0,
        )

    def _leg(self, distance_m: float) -> tuple[Leg, float]:
        if distance_m < 0.0:
            return Leg(self.legs[0].start, math.inf, 0.0), distance_m
        for leg in self.legs:
            if distance_m <= leg.length_m:
                return leg, distance_m
            distance_m -= leg.length_m
        last = self.legs[-1]
        return Leg(last.at(last.length_m), math.inf, 0.0), distance_m


def join(start: PathPoint, end: PathPoint, radius_m: float, slope: float) -> JoinRoute:
    """Return the shortest of the four routes turn, straight, turn; turns have `radius_m`."""
    return joins(start, end, radius_m, slope)[0]


def joins(start: PathPoint, end: PathPoint, radius_m: float, slope: float) -> list[JoinRoute]:
    """Return the routes turn, straight, turn, the shortest one first; turns have `radius_m`."""
    found = (_legs(start, end, radius_m, first, last) for first in (1, -1) for last in (1, -1))
    routes = [JoinRoute(legs, start.height_m, end.height_m, slope) for legs in found if legs]
    return sorted(routes, key=lambda route: route.length_m)


def _legs(start: PathPoint, end: PathPoint, radius_m: float, first: int, last: int) -> tuple[Leg, ...]:
    """Return the legs for turns to the right (1) or left (-1); none if the circles are too near for opposite turns."""
    from_north, from_east = _centre(start, radius_m * first)
    to_north, to_east = _centre(end, radius_m * last)
    between_m = math.hypot(to_north - from_north, to_east - from_east)
    bearing = math.atan2(to_east - from_east, to_north - from_north)
    if first == last:
        course, straight_m = bearing, between_m
    elif between_m >= 2 * radius_m:
        course = bearing + first * math.asin(2 * radius_m / between_m)
        straight_m = math.sqrt(between_m**2 - 4 * radius_m**2)
    else:
        return ()
    turn = Leg(start, radius_m * ((first * (course - start.course_rad)) % TURN), first / radius_m)
    straight = Leg(turn.at(turn.length_m), straight_m, 0.0)
    final_m = radius_m * ((last * (end.course_rad - course)) % TURN)
    return turn, straight, Leg(straight.at(straight_m), final_m, last / radius_m)


def _centre(point: PathPoint, to_the_right_m: float) -> tuple[float, float]:
    return (
        point.north_m - to_the_right_m * math.sin(point.course_rad),
        point.east_m + to_the_right_m * math.cos(point.course_rad),
    )

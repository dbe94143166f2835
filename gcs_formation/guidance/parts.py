"""The parts of a path between its turns in place, and which of them a vehicle flies along.

Where the course jumps the nearest point of the whole path could lie on either leg: of one that turns straight back
every point does.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Final, NamedTuple

from flight_model.curve import PathPoint
from flight_model.path import FlightPath, Route
from gcs_formation.guidance.tracking import nearest, project

BEFORE_M: Final = 1e-3
"""Distance before a turn in place at which the course is that of the leg before."""
ARRIVED_M: Final = 1.0
"""Distance before a turn in place from which on a vehicle may be on the part after it. Tuned: m; 0.5 to 2; shown by
`pytest tests/gcs_formation/guidance`."""
LEFT_M: Final = 0.1
"""Distance after it from which on it is, if it moves on. Tuned: m; 0.05 to 0.5; shown by `pytest
tests/gcs_formation/guidance`."""


class Part(NamedTuple):
    """A route between two distances along it, and straight on and level from both."""

    route: Route
    begin_m: float
    end_m: float

    @property
    def length_m(self) -> float:
        """Length of the whole route, m."""
        return self.route.length_m

    def at(self, distance_m: float, /) -> PathPoint:
        """Return the point at a distance from the route's start."""
        if distance_m < self.begin_m:
            return self.route.at(self.begin_m).straight_on(distance_m - self.begin_m)
        last_m = self.end_m - BEFORE_M
        if distance_m > last_m:
            return self.route.at(last_m).straight_on(distance_m - last_m)
        return self.route.at(distance_m)


class AlongPath:
    """Follows a vehicle along a path from its start: the distance of the point nearest to it."""

    def __init__(self, path: FlightPath) -> None:
        """Begin at the path's start."""
        self._path, self._passed = path, 0
        self._turns_m = [each.at_m for each in path.turns_in_place]
        self.distance_m = 0.0
        self._arrived, self._after_m = False, math.inf
        """Whether it has been at the end of its part, and where it was then on the one after it."""

    @property
    def part(self) -> Part:
        """The part on which the vehicle is."""
        return self._part(self._passed)

    def project(self, north_m: float, east_m: float) -> float:
        """Take a position near to the last one; return the distance along the path."""
        if not self._turns_m:
            self.distance_m = project(self._path, north_m, east_m, self.distance_m)
            return self.distance_m
        part = self.part
        self.distance_m = project(part, north_m, east_m, self.distance_m)
        self._arrived = self._arrived or self.distance_m > part.end_m - ARRIVED_M
        if self._arrived and self._passed < len(self._turns_m):
            self._go_on(part.end_m, north_m, east_m)
        return self.distance_m

    def _go_on(self, turn_m: float, north_m: float, east_m: float) -> None:
        """Go on to the part after the present one once the vehicle moves away from the turn along it."""
        before_m = self._after_m
        self._after_m = project(self._part(self._passed + 1), north_m, east_m, turn_m)
        if self._after_m > max(turn_m + LEFT_M, before_m):
            self.distance_m, self._passed = self._after_m, self._passed + 1
            self._arrived, self._after_m = False, math.inf

    def search(self, north_m: float, east_m: float, reach_m: float) -> float:
        """Take a position anywhere up to `reach_m` farther along the path; return the distance."""
        self.distance_m = nearest(self._path, north_m, east_m, self.distance_m, self.distance_m + reach_m)
        self._passed, self._arrived = bisect_right(self._turns_m, self.distance_m), False
        return self.distance_m

    def _part(self, passed: int) -> Part:
        ends_m = [-math.inf, *self._turns_m, math.inf]
        return Part(self._path, ends_m[passed], ends_m[passed + 1])

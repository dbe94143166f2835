"""A curve over the ground, evaluated point by point on plain numbers: quintic pieces by horizontal arc length."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

NORTH: Final = 0
EAST: Final = 6
HEIGHT: Final = 12
"""Index of each axis's first coefficient in those of a piece."""
atan2: Final = math.atan2


class PathPoint:
    """The path at one arc length: position in m, course in rad clockwise from north in (-pi, pi].

    Curvature is positive in a right turn; `slope` is the rise per metre of horizontal distance.
    """

    __slots__ = (
        "course_rad",
        "curvature_1pm",
        "curvature_rate_1pm2",
        "east_m",
        "height_m",
        "north_m",
        "slope",
        "slope_rate_1pm",
    )

    def __init__(
        self,
        north_m: float,
        east_m: float,
        height_m: float,
        course_rad: float,
        curvature_1pm: float = 0.0,
        curvature_rate_1pm2: float = 0.0,
        slope: float = 0.0,
        slope_rate_1pm: float = 0.0,
    ) -> None:
        """Take the position, the course, and their derivatives: straight and level by default."""
        self.north_m = north_m
        self.east_m = east_m
        self.height_m = height_m
        self.course_rad = course_rad
        self.curvature_1pm = curvature_1pm
        self.curvature_rate_1pm2 = curvature_rate_1pm2
        self.slope = slope
        self.slope_rate_1pm = slope_rate_1pm

    def values(self) -> tuple[float, float, float, float, float, float, float, float]:
        """Return the quantities in the order of the constructor's arguments."""
        return (
            self.north_m,
            self.east_m,
            self.height_m,
            self.course_rad,
            self.curvature_1pm,
            self.curvature_rate_1pm2,
            self.slope,
            self.slope_rate_1pm,
        )

    def lateral_and_up_m(self, north_m: float, east_m: float, height_m: float) -> tuple[float, float]:
        """Return the offsets to the right of the path and above it of a position abreast of this point, m."""
        north, east = north_m - self.north_m, east_m - self.east_m
        return east * math.cos(self.course_rad) - north * math.sin(self.course_rad), height_m - self.height_m

    def straight_on(self, beyond_m: float) -> PathPoint:
        """Return the point at a distance from this one, straight on and level."""
        return PathPoint(
            self.north_m + beyond_m * math.cos(self.course_rad),
            self.east_m + beyond_m * math.sin(self.course_rad),
            self.height_m,
            self.course_rad,
        )

    def raised(self, height_m: float, slope: float, slope_rate_1pm: float) -> PathPoint:
        """Return the point raised by an offset of this height, slope and slope rate."""
        return PathPoint(
            self.north_m,
            self.east_m,
            self.height_m + height_m,
            self.course_rad,
            self.curvature_1pm,
            self.curvature_rate_1pm2,
            self.slope + slope,
            self.slope_rate_1pm + slope_rate_1pm,
        )


class Curve:
    """A curve of successive quintic pieces."""

    def __init__(self, starts_m: list[float], pieces: list[list[list[float]]]) -> None:
        """Take each piece's start, m, and its coefficients for north, east and height, lowest power first."""
        self._starts_m = starts_m
        self._pieces = [vec[float](piece[0] + piece[1] + piece[2]) for piece in pieces]
        self._begin_m = self._end_m = 0.0
        """Ends of the piece used last, which is mostly the next one needed."""
        self._piece = self._pieces[0]

    def at(self, s: float) -> PathPoint:
        """Return the point at an arc length."""
        if not self._begin_m <= s < self._end_m:
            index = max(bisect_right(self._starts_m, s) - 1, 0)
            self._piece, self._begin_m = self._pieces[index], self._starts_m[index]
            self._end_m = self._starts_m[index + 1] if index + 1 < len(self._starts_m) else math.inf
        t, piece = s - self._begin_m, self._piece
        n, n1, n2, n3 = quintic(piece, NORTH, t)
        e, e1, e2, e3 = quintic(piece, EAST, t)
        h, h1, h2, _ = quintic(piece, HEIGHT, t)
        return PathPoint(n, e, h, atan2(e1, n1), n1 * e2 - e1 * n2, n1 * e3 - e1 * n3, h1, h2)


def quintic(c: vec[float], begin: i64, t: float) -> tuple[float, float, float, float]:
    """Return a quintic and its first three derivatives at t; c holds its coefficients from `begin` on."""
    c0, c1, c2, c3, c4, c5 = c[begin], c[begin + 1], c[begin + 2], c[begin + 3], c[begin + 4], c[begin + 5]
    return (
        c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
        c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
        2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
        6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5),
    )

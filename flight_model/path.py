"""What a path is to everything that flies or checks it: positions, courses, curvature and slopes by arc length.

`SplinePath` (flight_model/spline.py) and `LegsPath` (flight_model/legs/) are the two kinds; `ClearPath`
(formation_scenario/terrain.py) is one of them, raised clear of the ground.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, cast, overload

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.curve import Curve, PathPoint

# Rows: position, first and second derivative at the piece's start, then at its end, over a piece of length 1.
_HERMITE = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
        [-10.0, -6.0, -1.5, 10.0, -4.0, 0.5],
        [15.0, 8.0, 1.5, -15.0, 7.0, -1.0],
        [-6.0, -3.0, -0.5, 6.0, -3.0, 0.5],
    ]
)


class PathError(ValueError):
    """Waypoints that no vehicle can fly through; `waypoint` is the index of the first of them."""

    def __init__(self, message: str, waypoint: int) -> None:
        super().__init__(message)
        self.waypoint = waypoint


class PathPoints(NamedTuple):
    """`PathPoint` at many arc lengths: each field an array of their shape."""

    north_m: Array
    east_m: Array
    height_m: Array
    course_rad: Array
    curvature_1pm: Array
    curvature_rate_1pm2: Array
    slope: Array
    slope_rate_1pm: Array

    def only(self, which: Mask) -> PathPoints:
        """Return the points in a mask of their shape."""
        return PathPoints(*(each[which] for each in self))


class TurnInPlace(NamedTuple):
    """A turn on the spot at a distance along a path: from a course by an angle, clockwise positive."""

    at_m: float
    from_rad: float
    by_rad: float


class Route(Protocol):
    """A curve to fly along, parametrised by horizontal arc length."""

    @property
    def length_m(self) -> float:
        """Horizontal length, m."""
        ...

    def at(self, distance_m: float, /) -> PathPoint:
        """Return the point at a distance from the start."""
        ...


class FlightPath:
    """A curve over the ground of quintic pieces, by horizontal arc length in m.

    It is as continuous as what its nodes are given: position, course, curvature and slope don't jump, but the course
    does at `turns_in_place`, where it is the later one. Before 0 and beyond `length_m` the path is straight and level.

    Attributes:
        length_m: horizontal length.
        nodes_m: (m + 1,) arc lengths of the pieces' ends.
        waypoints_at_m: (n,) arc lengths of the waypoints, or of the points nearest to them.
    """

    turns_in_place: tuple[TurnInPlace, ...] = ()

    def __init__(self, nodes_m: Array, waypoints_at_m: Array, coefficients: Array) -> None:
        """Take the pieces' ends, the waypoints' arc lengths, and (m, 3, 6) coefficients as of `hermite_pieces`."""
        self.nodes_m = nodes_m
        self.length_m = float(nodes_m[-1])
        self.waypoints_at_m = waypoints_at_m
        self._coefficients = coefficients
        # For scalars, plain floats are faster than numpy, and the guidance asks for scalars.
        self._curve = Curve(self.nodes_m[:-1].tolist(), cast("list[list[list[float]]]", self._coefficients.tolist()))
        self._ends = self._curve.at(0.0), self._curve.at(self.length_m)

    @property
    def coefficients(self) -> Array:
        """(m, 3, 6) coefficients of the pieces, as of `hermite_pieces`."""
        return self._coefficients

    @overload
    def at(self, s: float) -> PathPoint: ...
    @overload
    def at(self, s: Array) -> PathPoints: ...
    def at(self, s: float | Array) -> PathPoint | PathPoints:
        """Return the path at an arc length in m, or at an array of them."""
        if not isinstance(s, np.ndarray):
            if s < 0.0:
                return self._ends[0].straight_on(s)
            return self._ends[1].straight_on(s - self.length_m) if s > self.length_m else self._curve.at(s)
        inside = np.clip(s, 0.0, self.length_m)
        index = np.clip(np.searchsorted(self.nodes_m, inside, side="right") - 1, 0, len(self._coefficients) - 1)
        pieces = self._coefficients[index]
        t = inside - self.nodes_m[index]
        n, n1, n2, n3 = _quintics(pieces[..., 0, :], t)
        e, e1, e2, e3 = _quintics(pieces[..., 1, :], t)
        h, h1, h2, _ = _quintics(pieces[..., 2, :], t)
        beyond = s - inside
        on_path = beyond == 0.0
        curves = (n1 * e2 - e1 * n2, n1 * e3 - e1 * n3, h1, h2)
        course, changes = np.arctan2(e1, n1), (np.where(on_path, each, 0.0) for each in curves)
        return PathPoints(n + beyond * np.cos(course), e + beyond * np.sin(course), h, course, *changes)


def hermite_pieces(values: Array, first: Array, second: Array, lengths: Array) -> Array:
    """Return quintics (m, 3 axes, 6 powers of the distance along the piece) that match both ends."""
    scale = lengths[:, None]
    begins, ends = ((values[at], first[at] * scale, second[at] * scale**2) for at in (slice(-1), slice(1, None)))
    both = np.stack((*begins, *ends), axis=-1)
    return np.asarray(both @ _HERMITE.T / (scale[..., None] ** np.arange(6)))


def _quintics(c: Array, t: Array) -> tuple[Array, Array, Array, Array]:
    """Return the same as `quintic`, for arrays of coefficients (..., 6) and arguments."""
    c0, c1, c2, c3, c4, c5 = np.moveaxis(c, -1, 0)
    return (
        c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
        c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
        2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
        6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5),
    )

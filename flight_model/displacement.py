"""The displacement of a way onto a path from beside it.

It fades out by the minimum-jerk step (Flash and Hogan, "The coordination of arm movements", J. Neuroscience 5, 1985).
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin
from typing import NamedTuple

from flight_model.arrays import T
from flight_model.curve import PathPoint
from flight_model.path import SplinePath
from flight_model.path_over_terrain import Lift

PEAK_RATE = 1.875
"""Largest first derivative, at u = 1/2."""
PEAK_CHANGE = 5.77
"""Largest second derivative, 10 / sqrt(3)."""
PEAK_JERK = 60.0
"""Largest third derivative, at both ends."""
SLOPE_CHANGE, SLOPE_JERK = 3.94, 36.0
"""Largest second and third derivatives of the quintic that begins at 0 with a slope of 1 and ends at 0 and at rest."""


def minimum_jerk(u: T) -> tuple[T, T, T]:
    """Return the step at u, 0 to 1, and its first two derivatives by u."""
    return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2, 60 * u * (1 - u) * (1 - 2 * u)


class Rise(NamedTuple):
    """Height of a vehicle above a path, with its first two derivatives by the path's own length."""

    height_m: float = 0.0
    slope: float = 0.0
    curvature_1pm: float = 0.0


class DisplacedPath:
    """A path with a displacement that fades out from `from_m` on, over `over_m`, as a minimum-jerk step.

    A slope of it, to the right or upwards, is continued by the quintic that begins with it and ends at rest.

    It can be lifted in addition, to clear the ground. Distances are those along the path itself. A curve of curvature k
    that is displaced by o along its normal n has the tangent (1 - k o) t + o' n; the rate at which its curvature
    changes is approximated by the derivatives of o.
    """

    def __init__(
        self,
        path: SplinePath,
        from_m: float,
        over_m: float,
        right_m: float,
        above: Rise,
        lift: Lift | None = None,
        *,
        right_slope: float = 0.0,
    ) -> None:
        """Displace `path` to the right by `right_m`, growing by `right_slope` at first, and in height by `above`."""
        self.path = path
        self.length_m = path.length_m
        self._from_m, self._over_m = from_m, over_m
        self._right_m, self._right_slope, self._above, self._lift = right_m, right_slope, above, lift

    def at(self, distance_m: float) -> PathPoint:
        """Return the point at a distance along the path."""
        point = self._beside(distance_m)
        return point if self._lift is None else point.lifted(*self._lift.at_one(distance_m))

    def _beside(self, distance_m: float) -> PathPoint:
        point = self.path.at(distance_m)
        if distance_m >= self._from_m + self._over_m:
            return point
        o, o1, o2, o3 = self._right(distance_m)
        up = self._up(distance_m)
        k, k1 = point.curvature_1pm, point.curvature_rate_1pm2
        along, along_rate = 1.0 - k * o, -k1 * o - k * o1
        stretch = hypot(along, o1)
        bent = k + (along * o2 - o1 * along_rate) / stretch**2
        return PathPoint(
            point.north_m - o * sin(point.course_rad),
            point.east_m + o * cos(point.course_rad),
            point.height_m + up.height_m,
            point.course_rad + atan2(o1, along),
            bent / stretch,
            k1 + o3,
            (point.slope + up.slope) / stretch,
            point.slope_rate_1pm + up.curvature_1pm,
        )

    def _right(self, distance_m: float) -> tuple[float, float, float, float]:
        """Return the remaining displacement to the right, and its first three derivatives by distance."""
        length, p, q = self._over_m, self._right_m, self._right_slope
        u = max(distance_m - self._from_m, 0.0) / length
        gone, rate, change = minimum_jerk(u)
        jerk, slope_jerk = (60 * (1 - 6 * u + 6 * u**2), 192 * u - 180 * u**2 - 36) if u > 0.0 else (0.0, 0.0)
        return (
            p * (1.0 - gone) + q * length * (u - 6 * u**3 + 8 * u**4 - 3 * u**5),
            -p * rate / length + q * (1.0 - 18 * u**2 + 32 * u**3 - 15 * u**4),
            -p * change / length**2 + q * (96 * u**2 - 36 * u - 60 * u**3) / length,
            -p * jerk / length**3 + q * slope_jerk / length**2,
        )

    def _up(self, distance_m: float) -> Rise:
        """Return the remaining height: the quintic that continues `above` and ends level at 0."""
        length = self._over_m
        u = max(distance_m - self._from_m, 0.0) / length
        p, q, r = self._above.height_m, self._above.slope * length, self._above.curvature_1pm * length**2 / 2.0
        third, fourth, fifth = -10 * p - 6 * q - 3 * r, 15 * p + 8 * q + 3 * r, -6 * p - 3 * q - r
        return Rise(
            p + u * (q + u * (r + u * (third + u * (fourth + u * fifth)))),
            (q + u * (2 * r + u * (3 * third + u * (4 * fourth + u * 5 * fifth)))) / length,
            (2 * r + u * (6 * third + u * (12 * fourth + u * 20 * fifth))) / length**2,
        )

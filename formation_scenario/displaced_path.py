"""A path as a vehicle joins it from beside: displaced at first, smoothly less and less, at last the path itself."""

from __future__ import annotations

from math import atan2, cos, hypot, sin

from formation_scenario.path import PathPoint, SplinePath


class DisplacedPath:
    """A path, `right_m` and `up_m` aside of itself at `from_m`, and of least jerk from there over `over_m`.

    Distances are those along the path itself. With the tangent (1 - k o) t + o' n of a curve of curvature k displaced
    by o along its normal n; how fast its own curvature changes is taken from o alone.
    """

    def __init__(self, path: SplinePath, from_m: float, over_m: float, right_m: float, up_m: float) -> None:
        """Displace `path`."""
        self.path = path
        self.length_m = path.length_m
        self._from_m, self._over_m = from_m, over_m
        self._right_m, self._up_m = right_m, up_m

    def at(self, distance_m: float) -> PathPoint:
        """Return the point beside the path's own at a distance."""
        point = self.path.at(distance_m)
        if distance_m >= self._from_m + self._over_m:
            return point
        kept, rate, change, jerk = self._kept(distance_m)
        o, o1, o2, o3 = (self._right_m * each for each in (kept, rate, change, jerk))
        k, k1 = point.curvature_1pm, point.curvature_rate_1pm2
        along, along_rate = 1.0 - k * o, -k1 * o - k * o1
        stretch = hypot(along, o1)
        bent = k + (along * o2 - o1 * along_rate) / stretch**2
        return PathPoint(
            point.north_m - o * sin(point.course_rad),
            point.east_m + o * cos(point.course_rad),
            point.height_m + self._up_m * kept,
            point.course_rad + atan2(o1, along),
            bent / stretch,
            k1 + o3,
            (point.slope + self._up_m * rate) / stretch,
            point.slope_rate_1pm + self._up_m * change,
        )

    def _kept(self, distance_m: float) -> tuple[float, float, float, float]:
        """Return the share of the displacement that is left and its first three derivatives by distance."""
        length = self._over_m
        u = max(distance_m - self._from_m, 0.0) / length
        made = u**3 * (10 - 15 * u + 6 * u**2)
        rate, change = 30 * u**2 * (1 - u) ** 2, 60 * u * (1 - u) * (1 - 2 * u)
        jerk = 60 * (1 - 6 * u + 6 * u**2) if u > 0.0 else 0.0
        return 1.0 - made, -rate / length, -change / length**2, -jerk / length**3

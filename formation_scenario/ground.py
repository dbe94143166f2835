"""The height of the ground, and the leader's path lifted where it would be too near to it."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Protocol, overload

import numpy as np

from flight_model.arrays import Array
from flight_model.displacement import STEP_M, Bounds, Lift, blend, least_lift, sample_places
from flight_model.elevation import read_elevation
from flight_model.path import PathPoint, PathPoints, SplinePath
from formation_scenario.environment import Hill, Terrain

LEADER_SHARE = 0.7
"""Share of the climb limit that the lifted path uses; followers and disturbances need the rest."""
FOLLOWER_SHARE = 0.85
"""Share of the climb limit that the path and a follower's own lift use together."""


class Ground(Protocol):
    """Ground heights in m above the scenario's origin; arrays of north and east in m have any common shape."""

    def height(self, north_m: Array, east_m: Array) -> Array:
        """Return the ground's height; NaN where it isn't known."""
        ...


class Hills:
    """Level ground with hills, which add up, by the formulas of `terrain.Hill`."""

    def __init__(self, base_m: float, hills: Sequence[Hill]) -> None:
        """Take H hills."""
        self._base_m = base_m
        self._north_m = np.array([hill.north_m for hill in hills])
        self._east_m = np.array([hill.east_m for hill in hills])
        self._height_m = np.array([hill.height_m for hill in hills])
        self._radius_m = np.array([hill.radius_m for hill in hills])
        self._half_m = np.array([hill.length_m / 2.0 for hill in hills])
        self._gaussian = np.array([hill.shape == "gaussian" for hill in hills], dtype=bool)
        bearing = np.array([radians(hill.bearing_deg) for hill in hills])
        self._cosine, self._sine = np.cos(bearing), np.sin(bearing)

    def height(self, north_m: Array, east_m: Array) -> Array:
        """Return the ground's height."""
        north, east = north_m[..., None] - self._north_m, east_m[..., None] - self._east_m
        along = north * self._cosine + east * self._sine
        across = east * self._cosine - north * self._sine
        beyond = np.maximum(np.abs(along) - self._half_m, 0.0)  # the ends of the crest line
        squared = (beyond**2 + across**2) / self._radius_m**2
        cosine = np.cos(np.pi / 2 * np.sqrt(np.minimum(squared, 1.0))) ** 2
        share = np.where(self._gaussian, np.exp(-squared / 2), cosine)
        return self._base_m + share @ self._height_m


def ground_of(terrain: Terrain | None, origin: tuple[float, float, float], waypoints_m: Array) -> Ground:
    """Return the ground around waypoints (n, 3); without terrain, a plain at the origin's height.

    `origin` is latitude and longitude in degrees, and height above sea level in m.

    Raises:
        ElevationError: the elevation file can't be read.
    """
    if terrain is None:
        return Hills(0.0, ())
    if terrain.file is None:
        return Hills(terrain.base_m, terrain.hills)
    return read_elevation(terrain.file, *origin, waypoints_m[:, :2])


class LiftedPath(SplinePath):
    """A path with a lift. It begins at the height that is written; the straight run-in before it is level."""

    def __init__(self, written: SplinePath, lift: Lift) -> None:
        """Take the path as it is written, and the lift from 0 to its length."""
        vars(self).update(vars(written))  # the same curve, which isn't fitted again
        self.lift = lift
        self._control_m: list[float] = lift.control_m.tolist()

    @overload
    def at(self, s: float) -> PathPoint: ...
    @overload
    def at(self, s: Array) -> PathPoints: ...
    def at(self, s: float | Array) -> PathPoint | PathPoints:
        """Return the lifted path at an arc length in m, or at an array of them."""
        if isinstance(s, np.ndarray):
            return self._raised(s, super().at(s))
        point = super().at(s)
        steps = min(max(s, 0.0), self.length_m) / STEP_M
        index = min(int(steps), len(self._control_m) - 4)
        lift_m, slope, curvature = blend(self._control_m[index : index + 4], steps - index)
        if s < 0.0 or s > self.length_m:
            return point._replace(height_m=point.height_m + lift_m)
        return point._replace(
            height_m=point.height_m + lift_m,
            slope=point.slope + slope,
            slope_rate_1pm=point.slope_rate_1pm + curvature,
        )

    def _raised(self, s: Array, points: PathPoints) -> PathPoints:
        inside = np.clip(s, 0.0, self.length_m)
        lift_m, slope, curvature = self.lift.at(inside)
        on_path = s == inside
        return points._replace(
            height_m=points.height_m + lift_m,
            slope=points.slope + np.where(on_path, slope, 0.0),
            slope_rate_1pm=points.slope_rate_1pm + np.where(on_path, curvature, 0.0),
        )


def lifted(written: SplinePath, ground: Ground, clearance_m: float, bounds: Bounds) -> LiftedPath:
    """Return a path lifted to `clearance_m` above the ground, as far as `bounds` allow."""
    places = sample_places(0.0, max(1, int(np.ceil(written.length_m / STEP_M))))
    points = written.at(places)
    needed = ground.height(points.north_m, points.east_m) + clearance_m - points.height_m
    return LiftedPath(written, least_lift(0.0, needed, points.slope, bounds, np.zeros(3)))

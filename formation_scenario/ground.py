"""The height of the ground, and the leader's path lifted where it would be too near to it."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, radians
from typing import NamedTuple, Protocol, overload

import numpy as np

from flight_model.arrays import Array
from flight_model.displacement import STEP_M, Bounds, Lift, blend, least_lift, sample_places
from flight_model.elevation import read_elevation
from flight_model.path import PathPoint, PathPoints, SplinePath
from formation_scenario.environment import Hill
from formation_scenario.model import Scenario

LEADER_SHARE = 0.7
"""Share of the climb limit that the lifted path uses; followers and disturbances need the rest."""
FOLLOWER_SHARE = 0.85
"""Share of the climb limit that the path and a follower's own lift use together."""


class Ground(Protocol):
    """Ground heights in m above the scenario's origin; arrays of north and east in m have any common shape."""

    def height(self, north_m: Array, east_m: Array) -> Array:
        """Return the ground's height; NaN where it isn't known."""
        ...

    def gradient(self, north_m: Array, east_m: Array) -> tuple[Array, Array]:
        """Return the rise per metre to the north and to the east; NaN where it isn't known."""
        ...


class _Distance(NamedTuple):
    """Distances of points from hills' crest lines: along them beyond their ends, across them, in total and squared."""

    along_m: Array
    across_m: Array
    squared_m2: Array


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
        squared = self._distance(north_m, east_m).squared_m2 / self._radius_m**2
        cosine = np.cos(np.pi / 2 * np.sqrt(np.minimum(squared, 1.0))) ** 2
        share = np.where(self._gaussian, np.exp(-squared / 2), cosine)
        return self._base_m + share @ self._height_m

    def gradient(self, north_m: Array, east_m: Array) -> tuple[Array, Array]:
        """Return the rise per metre to the north and to the east."""
        distance = self._distance(north_m, east_m)
        squared = distance.squared_m2 / self._radius_m**2
        cosine = np.where(squared < 1.0, -(np.pi**2) / 4 * np.sinc(np.sqrt(squared)), 0.0)
        rate = np.where(self._gaussian, -np.exp(-squared / 2) / 2, cosine) * 2 * self._height_m / self._radius_m**2
        along, across = rate * distance.along_m, rate * distance.across_m
        north = (along * self._cosine - across * self._sine).sum(axis=-1)
        return north, (along * self._sine + across * self._cosine).sum(axis=-1)

    def _distance(self, north_m: Array, east_m: Array) -> _Distance:
        north, east = north_m[..., None] - self._north_m, east_m[..., None] - self._east_m
        along = north * self._cosine + east * self._sine
        across = east * self._cosine - north * self._sine
        beyond = np.copysign(np.maximum(np.abs(along) - self._half_m, 0.0), along)
        return _Distance(beyond, across, beyond**2 + across**2)


def ground_of(scenario: Scenario) -> Ground:
    """Return the scenario's ground; without terrain, a plain at the origin's height.

    Raises:
        ElevationError: the elevation file can't be read.
    """
    terrain, origin = scenario.terrain, scenario.origin
    if terrain is None:
        return Hills(0.0, ())
    if terrain.file is None:
        return Hills(terrain.base_m, terrain.hills)
    waypoints = np.array(scenario.path.waypoints_m)
    return read_elevation(terrain.file, origin.lat_deg, origin.lon_deg, origin.alt_m, waypoints[:, :2])


class LiftedPath(SplinePath):
    """A path with a lift. It begins at the height that is written; the straight run-in before it is level."""

    def __init__(self, waypoints_m: Sequence[Sequence[float]] | Array, lift: Lift) -> None:
        """Take the waypoints as for `SplinePath`, and the lift from 0 to the path's length."""
        super().__init__(waypoints_m)
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


def leader_path(scenario: Scenario, ground: Ground | None = None) -> SplinePath:
    """Return the path that the leader flies: lifted where the scenario has terrain, as written otherwise.

    Raises:
        ElevationError: no ground was given, and the elevation file can't be read.
    """
    waypoints, terrain = scenario.path.waypoints_m, scenario.terrain
    path = SplinePath(waypoints)
    if terrain is None:
        return path
    ground = ground_of(scenario) if ground is None else ground
    places = sample_places(0.0, max(1, int(np.ceil(path.length_m / STEP_M))))
    points = path.at(places)
    needed = ground.height(points.north_m, points.east_m) + terrain.clearance_m - points.height_m
    lift = least_lift(0.0, needed, points.slope, rise_bounds(scenario, LEADER_SHARE), np.zeros(3))
    return LiftedPath(waypoints, lift)


def rise_bounds(scenario: Scenario, share: float) -> Bounds:
    """Return bounds of a path that every vehicle can follow with a share of its climb limit, in a tailwind.

    The climb rate may change by its limit within twice the sum of the height's time constants in (7).
    """
    models = [vehicle.model for vehicle in scenario.vehicles]
    climb_mps = min(model.climb_max_mps for model in models)
    lag_s = max(model.tau_ha_s + model.tau_hb_s for model in models)
    wind = scenario.wind.velocity_mps
    speed_mps = scenario.path.speed_mps + hypot(wind[0], wind[1])
    return Bounds(share * climb_mps / speed_mps, climb_mps / (2.0 * lag_s) / speed_mps**2)

"""The height of the ground as a function of the position."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import NamedTuple, Protocol

import numpy as np

from formation_scenario.arrays import Array
from formation_scenario.elevation import read_elevation
from formation_scenario.model import Scenario
from formation_scenario.terrain import Hill


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

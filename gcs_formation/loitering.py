"""Heights for circling vehicles: clear of the ground around them, and separated where circles may meet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np

from airlink.identity import VehicleId
from formation_scenario import Scenario, ground_of

STACK_M = 15.0
"""Vertical distance of circles that may meet."""
CIRCLES_MEET_M = 400.0
"""Circles whose vehicles start this far apart don't meet: twice the diameter of a circle of 100 m radius."""

AROUND_M = CIRCLES_MEET_M / 2
"""Largest distance of a circle from where it was commanded."""
SAMPLE_M = 10.0


class Top(NamedTuple):
    """The lowest height that clears the ground around a position, and where that ground is highest."""

    height_m: float
    north_m: float
    east_m: float


class Place(Protocol):
    """A position: NED from the scenario's origin, height upwards."""

    @property
    def north_m(self) -> float:
        """North of the origin, m."""
        ...

    @property
    def east_m(self) -> float:
        """East of the origin, m."""
        ...

    @property
    def height_m(self) -> float:
        """Above the origin, m."""
        ...


class GroundFloor:
    """The lowest heights at which vehicles may circle over the scenario's ground."""

    def __init__(self, scenario: Scenario) -> None:
        """Keep the terrain's clearance; without terrain, circles may be at any height."""
        self._ground = ground_of(scenario) if scenario.terrain else None
        self._clearance_m = scenario.terrain.clearance_m if scenario.terrain else 0.0
        across = np.arange(-AROUND_M, AROUND_M + SAMPLE_M, SAMPLE_M)
        north, east = (each.ravel() for each in np.meshgrid(across, across))
        within = np.hypot(north, east) <= AROUND_M
        self._north_m, self._east_m = north[within], east[within]

    def top(self, north_m: float, east_m: float) -> Top:
        """Return the lowest height of a circle that begins at a position."""
        if self._ground is None:
            return Top(-math.inf, north_m, east_m)
        north, east = north_m + self._north_m, east_m + self._east_m
        height_m = np.nan_to_num(self._ground.height(north, east), nan=-math.inf)
        highest = int(np.argmax(height_m))
        return Top(float(height_m[highest]) + self._clearance_m, float(north[highest]), float(east[highest]))

    def highest_m(self, north_m: float, east_m: float, around_m: float) -> float:
        """Return the highest ground within `around_m` of a position, m; minus infinity without terrain."""
        if self._ground is None:
            return -math.inf
        across = np.arange(-around_m, around_m + SAMPLE_M, SAMPLE_M)
        north, east = np.meshgrid(across, across)
        height_m = self._ground.height(north_m + north, east_m + east)[np.hypot(north, east) <= around_m]
        return float(np.nan_to_num(height_m, nan=-math.inf).max())

    def over_way_home(self, north_m: float, east_m: float) -> float:
        """Return the lowest height for flying straight home from a position and circling there, m."""
        if self._ground is None:
            return -math.inf
        steps = np.linspace(0.0, 1.0, 2 + int(math.hypot(north_m, east_m) / AROUND_M))
        return max(self.top(north_m * step, east_m * step).height_m for step in steps.tolist())


def loiter_heights(places: Mapping[VehicleId, Place], floor_m: float = -math.inf) -> dict[VehicleId, float]:
    """Return a height above the origin for each vehicle, m, none below the lowest vehicle or `floor_m`.

    From the lowest vehicle up, each takes the lowest level that no neighbour has, so that vehicles cross as few of the
    others' heights as possible.
    """
    levels: dict[VehicleId, int] = {}
    ordered = sorted(places, key=lambda identity: (places[identity].height_m, identity))
    for identity in ordered:
        near = [other for other in levels if _distance_m(places[identity], places[other]) < CIRCLES_MEET_M]
        taken = {levels[other] for other in near}
        levels[identity] = next(level for level in range(len(ordered)) if level not in taken)
    base_m = max(min((place.height_m for place in places.values()), default=0.0), floor_m)
    return {identity: base_m + level * STACK_M for identity, level in levels.items()}


def _distance_m(one: Place, other: Place) -> float:
    return math.hypot(one.north_m - other.north_m, one.east_m - other.east_m)

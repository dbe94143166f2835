"""Heights for circling vehicles: clear of the ground around them, and separated where circles may meet."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from airlink.endpoint import VehicleId
from formation_scenario import Scenario
from gcs_formation.vehicle.telemetry import ReportedMotion

STACK_M = 15.0
"""Vertical distance of circles that may meet."""
CIRCLES_MEET_M = 400.0
"""Circles whose vehicles start this far apart don't meet: twice the diameter of a circle of 100 m radius."""
OPENING_LIMIT_S = 30.0
"""For how long vehicles are kept from circling at least, if not all get to their heights before."""
OPENING_RESERVE_S = 15.0
"""How much longer than the climb to the highest level takes they are kept from it."""
AROUND_M = CIRCLES_MEET_M / 2
"""Largest distance of a circle from where it was commanded."""
SAMPLE_M = 10.0
Band = tuple[float, float]
"""The lowest and the highest of the heights at one of which a vehicle is that nobody can move, m."""


class HighestGround(NamedTuple):
    """The lowest height that clears the ground around a position, and where that ground is highest."""

    height_m: float
    north_m: float
    east_m: float


class GroundFloor:
    """The lowest heights at which vehicles may circle over the scenario's ground."""

    def __init__(self, scenario: Scenario) -> None:
        """Keep the terrain's clearance; without terrain, circles may be at any height."""
        self._ground = scenario.ground if scenario.terrain else None
        self._clearance_m = scenario.terrain.clearance_m if scenario.terrain else 0.0
        across = np.arange(-AROUND_M, AROUND_M + SAMPLE_M, SAMPLE_M)
        north, east = (each.ravel() for each in np.meshgrid(across, across))
        within = np.hypot(north, east) <= AROUND_M
        self._north_m, self._east_m = north[within], east[within]

    def top(self, north_m: float, east_m: float) -> HighestGround:
        """Return the lowest height of a circle that begins at a position."""
        if self._ground is None:
            return HighestGround(-math.inf, north_m, east_m)
        north, east = north_m + self._north_m, east_m + self._east_m
        height_m = np.nan_to_num(self._ground.height(north, east), nan=-math.inf)
        highest = int(np.argmax(height_m))
        return HighestGround(float(height_m[highest]) + self._clearance_m, float(north[highest]), float(east[highest]))

    def highest(self, places: Iterable[tuple[float, float]]) -> HighestGround:
        """Return the highest `top` of several positions; those that can't have it aren't looked at."""
        begins, best = list(places), HighestGround(-math.inf, math.nan, math.nan)
        if self._ground is None or not begins:
            return best
        north_m, east_m = np.array([north for north, _ in begins]), np.array([east for _, east in begins])
        bounds_m = self._ground.bound_m(north_m, east_m, AROUND_M) + self._clearance_m
        likely: list[int] = np.argsort(-bounds_m).tolist()
        for index in likely:
            if bounds_m[index] < best.height_m:
                break
            best = max(best, self.top(*begins[index]))
        return best

    def unknown(self, north_m: float, east_m: float) -> tuple[float, float] | None:
        """Return a place north and east, m, below a circle that begins at a position, of which no height is known."""
        if self._ground is None:
            return None
        north, east = north_m + self._north_m, east_m + self._east_m
        void = np.flatnonzero(np.isnan(self._ground.height(north, east)))
        return (float(north[void[0]]), float(east[void[0]])) if void.size else None

    def highest_m(self, north_m: float, east_m: float, around_m: float) -> float:
        """Return the highest ground within `around_m` of a position, m; minus infinity without terrain."""
        if self._ground is None:
            return -math.inf
        across = np.arange(-around_m, around_m + SAMPLE_M, SAMPLE_M)
        north, east = np.meshgrid(across, across)
        height_m = self._ground.height(north_m + north, east_m + east)[np.hypot(north, east) <= around_m]
        return float(np.nan_to_num(height_m, nan=-math.inf).max())

    def over_way(self, begin_m: tuple[float, float], end_m: tuple[float, float]) -> float:
        """Return the lowest height for flying straight from one place to another, and circling there, m."""
        if self._ground is None:
            return -math.inf
        (north_m, east_m), north_by_m, east_by_m = begin_m, end_m[0] - begin_m[0], end_m[1] - begin_m[1]
        steps = np.linspace(0.0, 1.0, 2 + int(math.hypot(north_by_m, east_by_m) / AROUND_M)).tolist()
        return self.highest((north_m + north_by_m * step, east_m + east_by_m * step) for step in steps).height_m


def loiter_heights(
    places: Mapping[VehicleId, ReportedMotion],
    floor_m: float,
    taken: Sequence[Band] = (),
    apart_m: float = STACK_M,
    *,
    together: bool = False,
) -> dict[VehicleId, float]:
    """Return a height above the origin for each vehicle, m; none below its own or `floor_m`.

    From the lowest vehicle up, each takes the lowest height that is `apart_m` from those of its neighbours, and from
    what is taken: nobody sinks, and as few as possible cross another's height. `together`: all circle at one place.
    """
    heights: dict[VehicleId, float] = {}
    for identity in sorted(places, key=lambda each: (places[each].height_m, each)):
        near = [(heights[i], heights[i]) for i in heights if together or may_meet(places[identity], places[i])]
        heights[identity] = _free_m(max(places[identity].height_m, floor_m), (*near, *taken), apart_m)
    return heights


def opening_limit_s(climb_m: float, climb_mps: float) -> float:
    """Return for how long vehicles are kept from circling at most, the highest of which have to climb this far."""
    return max(OPENING_LIMIT_S, climb_m / climb_mps + OPENING_RESERVE_S)


def may_meet(one: ReportedMotion, other: ReportedMotion) -> bool:
    """Return whether circles that begin at two places may meet."""
    return math.hypot(one.north_m - other.north_m, one.east_m - other.east_m) < CIRCLES_MEET_M


def _free_m(height_m: float, taken: Sequence[Band], apart_m: float) -> float:
    """Return the lowest height from `height_m` up that is `apart_m` from everything that's taken."""
    for low_m, high_m in sorted(taken):
        if low_m - apart_m < height_m < high_m + apart_m:
            height_m = high_m + apart_m
    return height_m

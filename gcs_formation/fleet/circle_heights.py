"""Heights for circling vehicles: clear of the ground, and separated where circles may meet."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario
from gcs_formation.vehicle.reported_motion import ReportedMotion

STACK_M = 15.0
"""Vertical separation of circles that may meet."""
CIRCLES_MEET_M = 400.0
"""Distance between starting positions from which circles don't meet: twice the diameter of a 100 m radius circle."""
AROUND_M = CIRCLES_MEET_M / 2
"""Largest distance of a circle's points from the commanded position."""
SAMPLE_M = 10.0
NO_ORDER: Mapping[VehicleId, frozenset[VehicleId]] = {}
NO_HEIGHTS: Mapping[VehicleId, float] = {}
Band = tuple[float, float]
"""Lowest and highest of the heights at one of which a vehicle that can't be commanded may be, m."""


class HighestGround(NamedTuple):
    """The lowest height that clears the ground around a position, and the point where that ground is highest."""

    height_m: float
    north_m: float
    east_m: float


class GroundFloor:
    """Lowest circling heights over the scenario's ground."""

    def __init__(self, scenario: Scenario) -> None:
        """Keep the terrain's clearance; without terrain there is no lower limit."""
        self._ground = scenario.ground if scenario.terrain else None
        self._clearance_m = scenario.terrain.clearance_m if scenario.terrain else 0.0
        self._north_m, self._east_m = _disc(AROUND_M)

    def top(self, north_m: float, east_m: float) -> HighestGround:
        """Return the lowest height of a circle that starts at a position."""
        if self._ground is None:
            return HighestGround(-math.inf, north_m, east_m)
        north, east = north_m + self._north_m, east_m + self._east_m
        height_m = np.nan_to_num(self._ground.height(north, east), nan=-math.inf)
        highest = int(np.argmax(height_m))
        return HighestGround(float(height_m[highest]) + self._clearance_m, float(north[highest]), float(east[highest]))

    def highest(self, positions: Iterable[tuple[float, float]]) -> HighestGround:
        """Return the highest `top` of several positions; an upper bound excludes most without evaluation."""
        begins, best = list(positions), HighestGround(-math.inf, math.nan, math.nan)
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
        """Return a point north and east, m, below a circle from a position where the terrain has no data, if any."""
        if self._ground is None:
            return None
        north, east = north_m + self._north_m, east_m + self._east_m
        void = np.flatnonzero(np.isnan(self._ground.height(north, east)))
        return (float(north[void[0]]), float(east[void[0]])) if void.size else None

    def highest_m(self, north_m: float, east_m: float, around_m: float) -> float:
        """Return the highest ground within `around_m` of a position, m; -inf without terrain."""
        if self._ground is None:
            return -math.inf
        north, east = _disc(around_m)
        return float(np.nan_to_num(self._ground.height(north_m + north, east_m + east), nan=-math.inf).max())

    def over_leg(self, begin_m: tuple[float, float], end_m: tuple[float, float]) -> float:
        """Return the lowest height for flying straight between two positions and circling at the second, m."""
        if self._ground is None:
            return -math.inf
        (north_m, east_m), north_by_m, east_by_m = begin_m, end_m[0] - begin_m[0], end_m[1] - begin_m[1]
        steps = np.linspace(0.0, 1.0, 2 + int(math.hypot(north_by_m, east_by_m) / AROUND_M)).tolist()
        return self.highest((north_m + north_by_m * step, east_m + east_by_m * step) for step in steps).height_m


def _disc(radius_m: float) -> tuple[Array, Array]:
    """Return points (N,) north and east, `SAMPLE_M` apart, that cover a disc around the origin."""
    across = np.arange(-radius_m, radius_m + SAMPLE_M, SAMPLE_M)
    north, east = (each.ravel() for each in np.meshgrid(across, across))
    within = np.hypot(north, east) <= radius_m
    return north[within], east[within]


def loiter_heights(
    motions: Mapping[VehicleId, ReportedMotion],
    floor_m: float,
    taken: Sequence[Band] = (),
    separation_m: float = STACK_M,
    *,
    together: bool = False,
    first: Mapping[VehicleId, frozenset[VehicleId]] = NO_ORDER,
    kept_m: Mapping[VehicleId, float] = NO_HEIGHTS,
) -> dict[VehicleId, float]:
    """Return a height above the origin for each vehicle, m; none below its present height or `floor_m`.

    From the lowest vehicle up, each gets the lowest height that is `separation_m` from its neighbours' and from the
    `taken` ones. So no vehicle descends, and few cross another's height. `together`: all circle at one position;
    `first`: those that leave downwards before each, and so are below it; `kept_m`: heights of other vehicles, which
    keep them.
    """
    heights, taken = dict[VehicleId, float](), [*taken, *((height_m, height_m) for height_m in kept_m.values())]
    for identity in _upwards(motions, first):
        near = [(heights[i], heights[i]) for i in heights if together or may_meet(motions[identity], motions[i])]
        below = (each[i] for i in first.get(identity, ()) for each in (heights, kept_m) if i in each)
        heights[identity] = _free_m(max(motions[identity].height_m, floor_m, *below), (*near, *taken), separation_m)
    return heights


def _upwards(
    motions: Mapping[VehicleId, ReportedMotion], first: Mapping[VehicleId, frozenset[VehicleId]]
) -> list[VehicleId]:
    """Return vehicles by their heights, but those that leave downwards before others before these."""
    waiting, found = sorted(motions, key=lambda each: (motions[each].height_m, each)), list[VehicleId]()
    while waiting:
        following = next((each for each in waiting if not first.get(each, frozenset()) & set(waiting)), waiting[0])
        waiting.remove(following)
        found.append(following)
    return found


def may_meet(one: ReportedMotion, other: ReportedMotion) -> bool:
    """Return whether circles that start at two positions may meet."""
    return math.hypot(one.north_m - other.north_m, one.east_m - other.east_m) < CIRCLES_MEET_M


def _free_m(height_m: float, taken: Sequence[Band], separation_m: float) -> float:
    """Return the lowest height from `height_m` up that is `separation_m` from all taken ones."""
    for low_m, high_m in sorted(taken):
        if low_m - separation_m < height_m < high_m + separation_m:
            height_m = high_m + separation_m
    return height_m

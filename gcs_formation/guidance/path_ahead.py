"""The leader's path of the next moments, as points."""

from __future__ import annotations

import math
from typing import Final

from flight_model.path import Route

AHEAD_M: Final = 165.0
"""Interval of the points along the leader's path around which the ground is checked."""


def path_ahead(route: Route, begin_m: float, ahead_m: float) -> list[tuple[float, float]]:
    """Return points of a route's next `ahead_m`, m north and east of its point at `begin_m`.

    A longer path has the same points, and more.
    """
    here = route.at(begin_m)
    points = [route.at(begin_m + AHEAD_M * each) for each in range(1 + math.ceil(ahead_m / AHEAD_M))]
    return [(point.north_m - here.north_m, point.east_m - here.east_m) for point in points]

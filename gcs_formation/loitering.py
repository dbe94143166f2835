"""Heights for vehicles that end up circling: those whose circles may meet are stacked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from airlink.identity import VehicleId

STACK_M = 15.0
"""Between the heights of circles that may meet."""
CIRCLES_MEET_M = 400.0
"""Two circles this far apart don't meet: twice a diameter of 100 m radius, entered from anywhere."""


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


def loiter_heights(places: Mapping[VehicleId, Place]) -> dict[VehicleId, float]:
    """Return a height above the origin for each vehicle, none below the lowest vehicle.

    From the lowest vehicle up, each takes the lowest level that no neighbour has: nobody crosses more of the others'
    heights than it must.
    """
    levels: dict[VehicleId, int] = {}
    ordered = sorted(places, key=lambda identity: (places[identity].height_m, identity))
    for identity in ordered:
        near = [other for other in levels if _distance_m(places[identity], places[other]) < CIRCLES_MEET_M]
        taken = {levels[other] for other in near}
        levels[identity] = next(level for level in range(len(ordered)) if level not in taken)
    base_m = min((place.height_m for place in places.values()), default=0.0)
    return {identity: base_m + level * STACK_M for identity, level in levels.items()}


def _distance_m(one: Place, other: Place) -> float:
    return math.hypot(one.north_m - other.north_m, one.east_m - other.east_m)

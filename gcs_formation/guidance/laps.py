"""Which laps before the path have room in the fence."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array
from flight_model.curve import PathPoint
from flight_model.fence_geometry import CHECKED_M, Drift, Flyers, room_along_m
from gcs_formation.guidance.tracking import JoinRoute

STEP_M = 20.0
"""Distance of the places of a lap that are looked at."""


class Lack(NamedTuple):
    """What a lap lacks of the room that it is to leave to the fence, (F, S) for everybody at each place."""

    places: Array
    """(F, S, 2) north and east."""
    lack_m: Array


@dataclass(frozen=True)
class LapFence:
    """The fence, the path's start, and who flies there."""

    corners_m: Array
    start: PathPoint
    flyers: Flyers

    def roomiest(
        self, ways: Iterable[JoinRoute], speed_mps: float, wind_north_mps: float, wind_east_mps: float
    ) -> JoinRoute:
        """Return the first way on which everybody has the room that paths are to leave, or else which lacks least."""
        through_air_mps = speed_mps + math.hypot(wind_north_mps, wind_east_mps)
        drift, least = Drift(speed_mps, wind_north_mps, wind_east_mps, through_air_mps), math.inf
        found: JoinRoute | None = None
        for way in ways:
            lack = float(self.lack(way, drift).lack_m.sum())
            if lack < least:
                found, least = way, lack
            if lack == 0.0:
                break
        assert found is not None, "there is always a way with turns to the same side"
        return found

    def lack(self, way: JoinRoute, drift: Drift) -> Lack:
        """Return what a way to the straight before the path, and that straight, lack."""
        end = way.at(way.length_m)
        straight_m = math.hypot(end.north_m - self.start.north_m, end.east_m - self.start.east_m)
        whole_m = way.length_m + straight_m
        points = [way.at(at_m) for at_m in np.linspace(0.0, whole_m, 2 + int(whole_m / STEP_M)).tolist()]
        north_m, east_m, course_rad = np.array([(each.north_m, each.east_m, each.course_rad) for each in points]).T
        places, room = room_along_m(self.corners_m, (north_m, east_m, course_rad), self.flyers, drift)
        return Lack(places, np.maximum(CHECKED_M - room, 0.0))

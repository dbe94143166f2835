"""The landing in a fixed wing's mission, as a ground station writes it there: item by item."""

from __future__ import annotations

import math
from typing import NamedTuple

from flight_model.earth import GeodeticOrigin
from formation_scenario.landing import StoredLanding
from formation_scenario.start_states import StartState

NAV_WAYPOINT, NAV_LAND, DO_LAND_START = 16, 21, 189
"""Of MAV_CMD."""
E7 = 1e7
REACHED_M = 30.0
"""Acceptance radius of the waypoint where the approach begins: the landing begins aligned with the runway."""
LEADS_M = 400.0
"""The waypoint before that one is this far back, so that the turn to the approach is over by then."""


class LandingPosition(NamedTuple):
    """Where it lands, north and east of the origin, m; its approach's course, rad, length and height, m."""

    north_m: float
    east_m: float
    course_rad: float
    approach_m: float
    height_m: float


class LandingItem(NamedTuple):
    """An item of the mission."""

    command: int
    position_e7: tuple[int, int] | None = None
    """Latitude and longitude, 1e-7 degrees; None for a command without a position."""
    height_m: float = 0.0
    """Above home."""
    reached_m: float = 0.0
    """Acceptance radius."""


def landing_position(keys: StoredLanding, start: StartState) -> LandingPosition:
    """Return where a vehicle lands by its keys, and otherwise where and as it stands at the start."""
    north_m, east_m = keys.touchdown_m or (start.north_m, start.east_m)
    course_rad = start.heading_rad if keys.course_deg is None else math.radians(keys.course_deg)
    return LandingPosition(north_m, east_m, course_rad, keys.approach_m, keys.height_m)


def items_of(landing: LandingPosition, origin: GeodeticOrigin) -> tuple[LandingItem, ...]:
    """Return DO_LAND_START, two waypoints in line with the runway, and NAV_LAND."""

    def item(command: int, back_m: float, height_m: float, reached_m: float = 0.0) -> LandingItem:
        north_m = landing.north_m - back_m * math.cos(landing.course_rad)
        east_m = landing.east_m - back_m * math.sin(landing.course_rad)
        lat_rad, lon_rad, _ = origin.from_ned(north_m, east_m, 0.0)
        lat_e7, lon_e7 = (round(math.degrees(each) * E7) for each in (lat_rad, lon_rad))
        return LandingItem(command, (lat_e7, lon_e7), height_m, reached_m)

    return (
        LandingItem(DO_LAND_START),
        item(NAV_WAYPOINT, landing.approach_m + LEADS_M, landing.height_m, REACHED_M * 2.0),
        item(NAV_WAYPOINT, landing.approach_m, landing.height_m, REACHED_M),
        item(NAV_LAND, 0.0, 0.0),
    )

"""The landing in a fixed wing's mission, as a ground station writes it there: item by item."""

from __future__ import annotations

import math
from typing import NamedTuple

from airlink import mavlink as m
from airlink.messages.mission import MissionItemInt
from flight_model.earth import GeodeticOrigin
from formation_scenario.landing import StoredLanding
from formation_scenario.start_states_and_end_times import StartState

E7 = 1e7
REACHED_M = 30.0
"""Acceptance radius of the waypoint where the approach begins: the landing begins aligned with the runway."""
LEADS_M = 400.0
"""The waypoint before that one is this far back, so that the turn to the approach is over by then."""


class LandingPlace(NamedTuple):
    """Where it lands, north and east of the origin, m; its approach's course, rad, length and height, m."""

    north_m: float
    east_m: float
    course_rad: float
    approach_m: float
    height_m: float


def place_of(keys: StoredLanding, start: StartState) -> LandingPlace:
    """Return where a vehicle lands by its keys, and otherwise where and as it stands at the start."""
    north_m, east_m = keys.touchdown_m or (start.north_m, start.east_m)
    course_rad = start.heading_rad if keys.course_deg is None else math.radians(keys.course_deg)
    return LandingPlace(north_m, east_m, course_rad, keys.approach_m, keys.height_m)


def items_of(system: int, landing: LandingPlace, origin: GeodeticOrigin) -> tuple[MissionItemInt, ...]:
    """Return DO_LAND_START, two waypoints in line with the runway, and NAV_LAND; heights are above home."""
    above_home, autopilot = m.MAV_FRAME_GLOBAL_RELATIVE_ALT, m.MAV_COMP_ID_AUTOPILOT1

    def item(seq: int, command: int, back_m: float, height_m: float, reached_m: float = 0.0) -> MissionItemInt:
        north_m = landing.north_m - back_m * math.cos(landing.course_rad)
        east_m = landing.east_m - back_m * math.sin(landing.course_rad)
        lat_rad, lon_rad, _ = origin.from_ned(north_m, east_m, 0.0)
        x, y = (round(math.degrees(each) * E7) for each in (lat_rad, lon_rad))
        given = 0.0, reached_m, 0.0, 0.0
        return MissionItemInt(system, autopilot, seq, above_home, command, 0, 1, *given, x, y, height_m)

    # PX4 takes commands without a position in this frame alone.
    begins = MissionItemInt(
        system, autopilot, 0, m.MAV_FRAME_MISSION, m.MAV_CMD_DO_LAND_START, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0
    )
    return (
        begins,
        item(1, m.MAV_CMD_NAV_WAYPOINT, landing.approach_m + LEADS_M, landing.height_m, REACHED_M * 2.0),
        item(2, m.MAV_CMD_NAV_WAYPOINT, landing.approach_m, landing.height_m, REACHED_M),
        item(3, m.MAV_CMD_NAV_LAND, 0.0, 0.0),
    )

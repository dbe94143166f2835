"""Reading the landing of a stored mission, by the MAVLink guide's "Mission Protocol"."""

from __future__ import annotations

import math

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages.mission import MissionAck, MissionCount, MissionItemInt, MissionRequestInt, MissionRequestList
from flight_model.earth import GeodeticOrigin
from gcs_formation.vehicle.stored_mission import TRIES, LandingSequence, StoredMission

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 20.0)
START = Instant(0)
WAYPOINT, LAND, MARK, TAKEOFF = 16, 21, 189, 22
RELATIVE, ABOVE_SEA = 3, 0


def item(seq: int, command: int, north_m: float = 0.0, east_m: float = 0.0, z: float = 0.0, frame: int = RELATIVE):
    lat_rad, lon_rad, _ = ORIGIN.from_ned(north_m, east_m, 0.0)
    place = round(math.degrees(lat_rad) * 1e7), round(math.degrees(lon_rad) * 1e7)
    return MissionItemInt(255, 190, seq, frame, command, 0, 1, 0.0, 0.0, 0.0, 0.0, *place, z)


def read(*items: MissionItemInt, needs_mark: bool = True) -> StoredMission:
    """Return a mission that was read without a loss."""
    mission = StoredMission(7, ORIGIN, needs_mark=needs_mark)
    assert isinstance(mission.requests(START)[0], MissionRequestList)
    mission.handle(MissionCount(255, 190, len(items)), START)
    for each in items:
        (asked,) = mission.requests(START)
        assert isinstance(asked, MissionRequestInt)
        assert (asked.target_system, asked.seq) == (7, each.seq)
        mission.handle(each, START)
    return mission


PATTERN = (
    item(0, WAYPOINT),
    item(1, MARK),
    item(2, WAYPOINT, -500.0, 300.0, 70.0),
    item(3, WAYPOINT, 0.0, -400.0, 80.0, ABOVE_SEA),
    item(4, LAND, 0.0, 50.0),
)


def test_a_landing_touches_down_at_its_place_on_the_course_of_its_last_leg() -> None:
    """The highest of its waypoints is 70 m above home; 80 m above sea level are 60 m above a home at 20 m."""
    mission = read(*PATTERN)
    assert mission.complete
    (thanks,) = mission.requests(START)
    assert isinstance(thanks, MissionAck)
    assert (thanks.type, mission.requests(START)) == (m.MAV_MISSION_ACCEPTED, [])
    found = mission.landing(20.0)
    assert isinstance(found, LandingSequence)
    assert found == pytest.approx((0.0, 50.0, math.radians(90.0), 70.0), abs=0.02)


def test_a_landing_without_its_mark_is_flown_by_some_autopilots_only() -> None:
    unmarked = (item(0, WAYPOINT, -400.0, 0.0, 50.0), item(1, LAND))
    assert read(*unmarked).landing(20.0) is None
    found = read(*unmarked, needs_mark=False).landing(20.0)
    assert found == pytest.approx((0.0, 0.0, 0.0, 50.0), abs=0.02)


@pytest.mark.parametrize("items", [(), (item(0, TAKEOFF),), PATTERN[:4], (item(0, MARK), item(1, LAND))])
def test_without_a_place_or_an_approach_there_is_no_landing(items: tuple[MissionItemInt, ...]) -> None:
    mission = read(*items)
    assert mission.complete
    assert mission.landing(20.0) is None


def test_what_is_lost_is_asked_for_again_and_who_never_answers_has_no_mission() -> None:
    mission, now = StoredMission(7, ORIGIN, needs_mark=True), START
    mission.requests(now)
    assert mission.requests(after(now, 0.5)) == []
    mission.handle(MissionCount(255, 190, 2), after(now, 0.6))
    mission.requests(after(now, 0.6))
    now = after(now, 2.0)
    (again,) = mission.requests(now)
    assert isinstance(again, MissionRequestInt)
    assert again.seq == 0
    for _ in range(TRIES):
        now = after(now, 1.1)
        mission.requests(now)
    assert mission.complete
    assert mission.landing(0.0) is None

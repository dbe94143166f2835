"""Reading the landing of a stored mission, by the MAVLink guide's "Mission Protocol"."""

from __future__ import annotations

import math

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import ComponentId
from airlink.messages.mission import MissionAck, MissionCount, MissionItemInt, MissionRequestInt, MissionRequestList
from flight_model.earth import GeodeticOrigin
from gcs_formation.vehicle.stored_mission import TRIES, LandingSequence, StoredMission

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 20.0)
START = Instant(0)
STATION = ComponentId(255, 190)
WAYPOINT, LAND, MARK, TAKEOFF = 16, 21, 189, 22
RELATIVE, ABOVE_SEA = 3, 0


def item(seq: int, command: int, north_m: float = 0.0, east_m: float = 0.0, z: float = 0.0, frame: int = RELATIVE):
    lat_rad, lon_rad, _ = ORIGIN.from_ned(north_m, east_m, 0.0)
    place = round(math.degrees(lat_rad) * 1e7), round(math.degrees(lon_rad) * 1e7)
    return MissionItemInt(255, 190, seq, frame, command, 0, 1, 0.0, 0.0, 0.0, 0.0, *place, z)


def read(*items: MissionItemInt, needs_mark: bool = True) -> StoredMission:
    """Return a mission that was read without a loss."""
    mission = StoredMission(7, STATION, ORIGIN, needs_mark=needs_mark)
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
    mission, now = StoredMission(7, STATION, ORIGIN, needs_mark=True), START
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


@pytest.mark.parametrize("known", [0, 2, 4])
def test_a_mission_that_is_replaced_while_it_is_read_is_read_from_its_beginning(known: int) -> None:
    """By a shorter one, by `PATTERN` and by a longer one; `known` items of the first had come."""
    for count in (2, len(PATTERN), 9):
        mission = StoredMission(7, STATION, ORIGIN, needs_mark=True)
        mission.handle(MissionCount(255, 190, len(PATTERN) + 1), START)
        for seq in range(known):
            mission.handle(item(seq, TAKEOFF), START)
        mission.handle(MissionCount(255, 190, count), START)
        (asked,) = mission.requests(START)
        assert isinstance(asked, MissionRequestInt)
        assert asked.seq == 0
        for each in PATTERN[:count]:
            mission.handle(each, START)
        assert mission.complete == (count <= len(PATTERN))
        assert (mission.landing(20.0) is None) == (count != len(PATTERN))


def test_a_number_of_items_that_comes_twice_forgets_none() -> None:
    mission = StoredMission(7, STATION, ORIGIN, needs_mark=True)
    for each in (MissionCount(255, 190, 5), PATTERN[0], MissionCount(255, 190, 5), *PATTERN[1:]):
        mission.handle(each, START)
    assert mission.landing(20.0) is not None


OTHERS = {"another_station": (254, 190), "another_component": (255, 1)}
FENCE, RALLY = 1, 2


@pytest.mark.parametrize("to", OTHERS.values(), ids=OTHERS)
def test_what_answers_another_station_is_no_part_of_what_this_one_reads(to: tuple[int, int]) -> None:
    theirs = {"target_system": to[0], "target_component": to[1]}
    mission = StoredMission(7, STATION, ORIGIN, needs_mark=True)
    mission.handle(MissionCount(*to, 2), START)
    assert isinstance(mission.requests(START)[0], MissionRequestList)
    mission.handle(MissionCount(255, 190, len(PATTERN)), START)
    for each in PATTERN:
        mission.handle(each, START)
        mission.handle(item(each.seq, TAKEOFF).but(**theirs), START)
        mission.handle(MissionCount(*to, 2), START)
    assert mission.landing(20.0) is not None


@pytest.mark.parametrize("kind", [FENCE, RALLY])
def test_items_of_a_fence_or_rally_points_are_no_part_of_a_mission(kind: int) -> None:
    mission = StoredMission(7, STATION, ORIGIN, needs_mark=True)
    mission.handle(MissionCount(255, 190, len(PATTERN)), START)
    for each in PATTERN:
        mission.handle(each, START)
        mission.handle(item(each.seq, TAKEOFF).but(mission_type=kind), START)
        mission.handle(MissionCount(255, 190, 2, kind), START)
    assert mission.landing(20.0) is not None


def test_an_answer_to_everybody_is_one_to_this_station() -> None:
    mission = StoredMission(7, STATION, ORIGIN, needs_mark=True)
    mission.handle(MissionCount(0, 0, len(PATTERN)), START)
    for each in PATTERN:
        mission.handle(each.but(target_system=0, target_component=0), START)
    assert mission.landing(20.0) is not None

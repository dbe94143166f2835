"""A mission carried out on paper: where it goes, how fast, and what isn't flown."""

import math

import pytest

from formation_scenario.mission_files import Mission, MissionFileError, MissionItem, route_of
from formation_scenario.mission_files.route import Circles

OPEN = math.nan


def item(command, *params, lat=OPEN, height=100.0, frame=3, where=""):
    filled = (*params, OPEN, OPEN, OPEN, OPEN)[:4]
    return MissionItem(
        where or f"item of {command}", command, frame, filled, lat, OPEN if math.isnan(lat) else 8.0, height
    )


def waypoint(lat, **keys):
    return item(16, lat=lat, where=f"waypoint {lat}", **keys)


def route(*items):
    return route_of(Mission("tour.plan", items, tuple(range(1, len(items) + 1))))


def lats(*items):
    return [point.lat_deg for point in route(*items).points]


def test_the_path_begins_after_take_off_and_ends_before_landing():
    flown = route(
        item(22, lat=47.0), waypoint(47.01), waypoint(47.02), item(189, frame=2), waypoint(47.03), item(21, lat=47.04)
    )
    assert [point.lat_deg for point in flown.points] == [47.01, 47.02]
    assert flown.remarks == (
        "item of 22: vehicles take off by themselves; the path begins after it",
        "item of 189: the path ends at DO_LAND_START, with the 2 items after it",
    )


@pytest.mark.parametrize("command", [20, 21, 85])
def test_the_path_ends_before_each_way_of_coming_down(command):
    assert lats(waypoint(47.0), waypoint(47.01), item(command, lat=47.02), waypoint(47.03)) == [47.0, 47.01]


def test_loitering_without_end_is_where_the_path_ends():
    assert lats(waypoint(47.0), item(17, lat=47.01), waypoint(47.02)) == [47.0, 47.01]


def test_a_jump_is_unrolled_as_often_as_it_says():
    tour = [waypoint(47.0), waypoint(47.01), waypoint(47.02), item(177, 2, 2), waypoint(47.03)]
    assert lats(*tour) == [47.0, 47.01, 47.02, 47.01, 47.02, 47.01, 47.02, 47.03]


def test_a_jump_without_end_is_flown_once_and_said():
    flown = route(waypoint(47.0), waypoint(47.01), item(177, 1, -1))
    assert [point.lat_deg for point in flown.points] == [47.0, 47.01, 47.0, 47.01]
    assert flown.remarks == ("item of 177: DO_JUMP without end is flown once",)


def test_a_jump_to_a_tag_goes_to_the_tag():
    assert lats(waypoint(47.0), item(600, 7, frame=2), waypoint(47.01), waypoint(47.02), item(601, 7, 1)) == [
        47.0, 47.01, 47.02, 47.01, 47.02,
    ]  # fmt: skip


def test_a_jump_to_nowhere_or_into_thousands_is_refused():
    with pytest.raises(MissionFileError, match="found a jump to item 9, which isn't in the mission"):
        route(waypoint(47.0), waypoint(47.01), item(177, 9, 1))
    with pytest.raises(MissionFileError, match="more than 20000 points with its jumps unrolled"):
        route(waypoint(47.0), waypoint(47.01), item(177, 1, 10**7))


def test_speed_changes_are_of_the_legs_after_them():
    flown = route(
        item(178, 0, 20.0),
        waypoint(47.0),
        waypoint(47.01),
        item(178, 1, 25.0),
        waypoint(47.02),
        item(178, 0, -1),
        waypoint(47.03),
    )
    assert [point.speed_mps for point in flown.points] == [20.0, 25.0, 25.0, 25.0]


def test_circles_have_turns_or_time_and_their_radius_says_which_way():
    flown = route(
        waypoint(47.0),
        item(18, 3, OPEN, -90.0, lat=47.01),
        item(19, 40.0, lat=47.02),
        item(31, 0, 70.0, lat=47.03, height=150.0),
    )
    assert [point.circles for point in flown.points] == [
        None, Circles(-90.0, turns=3.0), Circles(80.0, seconds=40.0), Circles(70.0, turns=0.0),
    ]  # fmt: skip


def test_an_item_without_a_position_is_where_the_vehicle_is():
    assert not MissionItem("", 16, 3, (0.0,) * 4, 0.0, 0.0, 50.0).placed
    flown = route(waypoint(47.0), waypoint(47.01), item(18, 2))
    assert [point.lat_deg for point in flown.points] == [47.0, 47.01]
    assert flown.points[-1].circles == Circles(80.0, turns=2.0)
    with pytest.raises(MissionFileError, match="no position in the first waypoint"):
        route(item(18, 2), waypoint(47.0))


def test_points_less_than_a_metre_apart_are_one_with_the_height_and_the_circles_of_the_last():
    assert lats(waypoint(47.0), waypoint(47.0 + 5e-7), waypoint(47.01)) == [47.0, 47.01]
    assert lats(waypoint(47.0), waypoint(47.0 + 2e-5), waypoint(47.01)) == [47.0, 47.0 + 2e-5, 47.01]
    flown = route(waypoint(46.99), waypoint(47.0), item(16, lat=47.0, height=120.0, where="item 3"), waypoint(47.01))
    assert [point.height_m for point in flown.points] == [100.0, 120.0, 100.0]
    assert any("at the position of item 3, whose height is flown there" in remark for remark in flown.remarks)
    circled = route(waypoint(46.99), item(18, 2, OPEN, 90.0, lat=47.0), waypoint(47.0))
    assert circled.points[-1].circles == Circles(90.0, turns=2.0)
    twice = route(waypoint(46.99), item(18, 2, lat=47.0), item(18, 1, lat=47.0, where="item 3"))
    assert any("circles at the position of item 3 aren't flown" in remark for remark in twice.remarks)


@pytest.mark.parametrize(
    ("frame", "datum"), [(0, "sea level"), (5, "sea level"), (3, "home"), (6, "home"), (10, "ground"), (11, "ground")]
)
def test_frames_say_from_where_heights_are_measured(frame, datum):
    assert {point.datum for point in route(waypoint(47.0, frame=frame), waypoint(47.01, frame=frame)).points} == {datum}


def test_a_waypoint_in_a_frame_without_a_position_is_refused():
    with pytest.raises(MissionFileError, match="found NAV_WAYPOINT in frame 1; allowed: 0, 3, 10"):
        route(waypoint(47.0, frame=1), waypoint(47.01))


def test_what_is_not_carried_out_is_named_once_by_command_with_its_items():
    flown = route(
        waypoint(47.0),
        item(206, frame=2, where="item 2"),
        waypoint(47.01),
        item(206, frame=2, where="item 4"),
        item(9999, where="item 5"),
    )
    assert flown.remarks == (
        "item 2, item 4: DO_SET_CAM_TRIGG_DIST isn't carried out",
        "item 5: command 9999 isn't carried out",
    )


def test_fewer_than_two_waypoints_are_no_path():
    with pytest.raises(MissionFileError, match="found 1 waypoints to fly; allowed: 2 or more"):
        route(item(22, lat=47.0), waypoint(47.01), item(20))


def test_where_nothing_is_flown_before_a_landing_begins_the_path_goes_on_up_to_the_landing():
    flown = route(item(189, frame=2, where="item 1"), waypoint(47.0), waypoint(47.01), item(21, lat=47.02))
    assert [point.lat_deg for point in flown.points] == [47.0, 47.01]
    assert flown.remarks[0] == "item 1: the path goes on at DO_LAND_START: nothing is flown before it"
    assert lats(waypoint(47.0), waypoint(47.01), item(189, frame=2), waypoint(47.02)) == [47.0, 47.01]

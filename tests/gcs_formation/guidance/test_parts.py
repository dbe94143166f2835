"""Following a vehicle along a path with turns in place: on which leg it is, also of one that turns straight back."""

import math

import pytest

from flight_model.legs.heights import Climbs
from flight_model.legs.turn import TurnLimits
from flight_model.spline import SplinePath
from flight_model.stops.corners import Pass
from flight_model.stops.path import PathWithStops, StopPlan
from gcs_formation.guidance.parts import AlongPath, Part


def there_and(angle_deg: float) -> PathWithStops:
    """Return 100 m to the north, and 80 m on a course of the given angle, with a stop between."""
    course = math.radians(angle_deg)
    end = [100.0 + 80.0 * math.cos(course), 80.0 * math.sin(course), 30.0]
    limits = [TurnLimits(0.05, 0.01)] * 2
    return PathWithStops([[0, 0, 30], [100, 0, 30], end], StopPlan([Pass(0.0)], [Climbs(0.3, 0.02)] * 2, limits, 100.0))


@pytest.mark.parametrize("angle_deg", [45, 90, 135, 179, 180])
@pytest.mark.parametrize("to_side_m", [-0.3, 0.0, 0.3])
def test_a_vehicle_is_followed_there_and_on(angle_deg, to_side_m):
    path = there_and(angle_deg)
    follower, course = AlongPath(path), math.radians(angle_deg)
    for along in range(101):
        assert follower.project(float(along), to_side_m) == pytest.approx(along, abs=1.1)
    for _ in range(20):  # it hovers, a little beyond the point
        assert follower.project(100.2, to_side_m) == pytest.approx(100.0, abs=0.5)
    for along in range(1, 80):
        north_m = 100.0 + along * math.cos(course) - to_side_m * math.sin(course)
        east_m = along * math.sin(course) + to_side_m * math.cos(course)
        assert follower.project(north_m, east_m) == pytest.approx(100.0 + along, abs=1.1)
    assert follower.part.begin_m == 100.0


def test_one_that_hovers_at_a_turn_is_on_the_next_part_once_it_moves_away_along_it():
    follower = AlongPath(there_and(90.0))
    for along in range(101):
        follower.project(float(along), 0.0)
    for east_m in (0.05, -0.1, 0.09, 0.02, 0.09):
        assert follower.project(100.0, east_m) == pytest.approx(100.0, abs=1e-6)
        assert follower.part.end_m == 100.0
    assert follower.project(100.0, 0.2) == pytest.approx(100.2)
    assert follower.part.begin_m == 100.0


def test_a_part_goes_on_straight_from_both_of_its_ends():
    path = there_and(90.0)
    first, second = Part(path, -math.inf, 100.0), Part(path, 100.0, math.inf)
    beyond, before = first.at(105.0), second.at(95.0)
    assert (beyond.north_m, beyond.east_m, beyond.course_rad) == pytest.approx((105.0, 0.0, 0.0), abs=1e-6)
    assert (before.north_m, before.east_m, before.course_rad) == pytest.approx((100.0, -5.0, math.pi / 2), abs=1e-6)


def test_a_search_finds_the_part_again_after_a_gap():
    follower = AlongPath(there_and(90.0))
    follower.project(50.0, 0.0)
    assert follower.search(100.0, 40.0, 200.0) == pytest.approx(140.0, abs=0.1)
    assert follower.part.begin_m == 100.0


@pytest.mark.parametrize(("came_to_m", "goes_on"), [(98.9, False), (99.1, True)])
def test_only_who_came_within_a_metre_of_a_turn_may_go_on_from_it(came_to_m, goes_on):
    """One that crosses the next leg elsewhere is still on its own."""
    follower = AlongPath(there_and(90.0))
    for along in (90.0, 95.0, came_to_m):
        follower.project(along, 0.0)
    for east_m in (0.5, 1.0):
        follower.project(came_to_m, east_m)
    assert follower.part.begin_m == (100.0 if goes_on else -math.inf)
    assert follower.distance_m == pytest.approx(101.0 if goes_on else came_to_m)


def test_who_hovers_a_decimetre_after_a_turn_goes_on_only_as_it_moves_away():
    follower = AlongPath(there_and(90.0))
    for east_m in (0.3, 0.3, 0.25, 0.08, 0.09):
        follower.project(100.0, east_m)
        assert follower.part.end_m == 100.0
    assert follower.project(100.0, 0.12) == pytest.approx(100.12)
    assert follower.part.begin_m == 100.0


def test_a_search_looks_no_farther_than_it_may_and_forgets_arrivals():
    follower = AlongPath(there_and(180.0))
    for along in (60.0, 99.9):
        follower.project(along, 0.0)
    follower.distance_m = 40.0
    assert follower.search(70.0, 0.0, 50.0) == pytest.approx(70.0, abs=1e-6)
    assert follower.part.end_m == 100.0
    for along in (71.0, 70.0, 69.0):
        assert follower.project(along, 0.0) == pytest.approx(along)
    assert follower.search(30.0, 0.0, 5.0) == pytest.approx(69.0)
    assert follower.search(30.0, 0.0, 120.0) == pytest.approx(170.0)


@pytest.mark.parametrize("at_m", [-10.0, 0.0, 40.0, 99.99, 100.01, 150.0, 190.0])
def test_within_its_ends_a_part_is_the_route(at_m):
    path = there_and(90.0)
    part = Part(path, -math.inf, 100.0) if at_m < 100.0 else Part(path, 100.0, math.inf)
    assert part.at(at_m).values() == path.at(at_m).values()
    assert part.length_m == path.length_m == pytest.approx(180.0)


@pytest.mark.parametrize("before_m", [0.0, 5e-4, -5e-4])
def test_at_a_turn_a_part_still_has_the_course_of_the_leg_before(before_m):
    point = Part(there_and(90.0), -math.inf, 100.0).at(100.0 - before_m)
    assert (point.north_m, point.east_m, point.course_rad) == pytest.approx((100.0 - before_m, 0.0, 0.0), abs=1e-9)


def test_along_a_path_without_turns_in_place_it_is_at_the_nearest_point():
    follower = AlongPath(SplinePath([[0, 0, 100], [1000, 0, 100]]))
    for along in (5.0, 200.0, 900.0, 1100.0):
        assert follower.project(along, 3.0) == pytest.approx(along)
        assert follower.distance_m == pytest.approx(along)
    assert (follower.part.begin_m, follower.part.end_m) == (-math.inf, math.inf)

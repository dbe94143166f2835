"""The route to the path's start: continuous, ends at the right place and course, never tighter than allowed."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.curve import PathPoint
from gcs_formation.guidance.join_route import JoinRoute, Leg, join, joins

place = st.floats(-3000, 3000)
course = st.floats(-math.pi, math.pi)


@given(place, place, course, course, st.floats(60, 300))
def test_ends_where_and_as_it_should(
    north: float, east: float, course_in: float, course_out: float, radius: float
) -> None:
    end = PathPoint(north, east, 120.0, course_out)
    route = join(PathPoint(0, 0, 50, course_in), end, radius, 0.1)
    last = route.at(route.length_m)
    assert (last.north_m, last.east_m) == pytest.approx((north, east), abs=1e-5)
    assert math.remainder(last.course_rad - course_out, math.tau) == pytest.approx(0, abs=1e-6)


@given(place, place, course, course)
def test_is_run_by_arc_length_without_jumps(north: float, east: float, course_in: float, course_out: float) -> None:
    route = join(PathPoint(0, 0, 50, course_in), PathPoint(north, east, 120, course_out), 150.0, 0.1)
    for k in range(50):
        here, there = (route.at(route.length_m * k / 50 + d) for d in (0.0, 0.5))
        assert math.hypot(there.north_m - here.north_m, there.east_m - here.east_m) == pytest.approx(0.5, abs=1e-3)
        assert abs(there.curvature_1pm) <= 1 / 150.0 + 1e-12
        assert (there.curvature_rate_1pm2, there.slope_rate_1pm) == (0.0, 0.0)


def test_straight_ahead_is_straight() -> None:
    route = join(PathPoint(0, 0, 100, 0.3), PathPoint(1000 * math.cos(0.3), 1000 * math.sin(0.3), 100, 0.3), 150.0, 0.1)
    assert route.length_m == pytest.approx(1000.0)


def test_height_changes_no_faster_than_the_slope() -> None:
    route = join(PathPoint(0, 0, 50, 0.0), PathPoint(2000, 0, 120, 0.0), 150.0, 0.1)
    assert [route.at(s).height_m for s in (0, 100, 700, 1500)] == pytest.approx([50, 60, 120, 120])


def to_the_side(ahead_m: float, right_m: float, course_rad: float = 0.0) -> JoinRoute:
    """Return the shortest route from the origin, heading north, with turns of 100 m radius."""
    return join(PathPoint(0, 0, 100, 0.0), PathPoint(ahead_m, right_m, 100, course_rad), 100.0, 0.1)


@pytest.mark.parametrize("side", [1, -1])
def test_the_shortest_routes_are_those_of_dubins_by_hand(side: int) -> None:
    """Half a circle to come back beside; to a parallel two opposite turns, by 2R farther at a distance d ahead.

    These have the straight (d² - 4R²)^1/2 between two turns by asin(2R/d); at d = 2R there is none of it.
    """
    assert to_the_side(0.0, 200.0 * side, math.pi).length_m == pytest.approx(100.0 * math.pi)
    assert to_the_side(300.0, 100.0 * side, math.pi / 2 * side).length_m == pytest.approx(200.0 + 50.0 * math.pi)
    shifted_m = math.sqrt(400.0**2 - 200.0**2) + 2.0 * 100.0 * math.asin(0.5)
    assert to_the_side(400.0, 200.0 * side).length_m == pytest.approx(shifted_m)
    assert to_the_side(200.0, 200.0 * side).length_m == pytest.approx(100.0 * math.pi)


@settings(max_examples=15, deadline=None)
@given(place, place, course, course)
def test_a_route_is_as_long_flown_backwards_mirrored_or_elsewhere(
    north: float, east: float, course_in: float, course_out: float
) -> None:
    def length_m(start: tuple[float, float, float], end: tuple[float, float, float]) -> float:
        return join(PathPoint(*start[:2], 0, start[2]), PathPoint(*end[:2], 0, end[2]), 150.0, 0.1).length_m

    there_m = length_m((0, 0, course_in), (north, east, course_out))
    assert math.hypot(north, east) - 1e-6 <= there_m <= math.hypot(north, east) + 4.0 * math.pi * 150.0
    back_m = length_m((north, east, course_out + math.pi), (0, 0, course_in + math.pi))
    mirrored_m = length_m((0, 0, -course_in), (north, -east, -course_out))
    turned_m = length_m((70, -90, course_in + math.pi / 2), (70 - east, north - 90, course_out + math.pi / 2))
    # Where a turn of none is needed, rounding may make it a whole one.
    whole_m = 2.0 * math.pi * 150.0
    for other_m in (back_m, mirrored_m, turned_m):
        assert math.remainder(other_m - there_m, whole_m) == pytest.approx(0.0, abs=1e-3)


@settings(max_examples=15, deadline=None)
@given(place, place, course, course)
def test_routes_come_the_shortest_first_and_turn_less_than_once_in_a_turn(
    north: float, east: float, course_in: float, course_out: float
) -> None:
    found = joins(PathPoint(0, 0, 50, course_in), PathPoint(north, east, 120, course_out), 150.0, 0.1)
    lengths_m = [route.length_m for route in found]
    assert 2 <= len(found) <= 4
    assert lengths_m == sorted(lengths_m)
    for route in found:
        assert all(0.0 <= leg.length_m * abs(leg.curvature_1pm) <= math.tau for leg in route.legs)
        assert route.length_m == pytest.approx(sum(leg.length_m for leg in route.legs))


@settings(max_examples=15, deadline=None)
@given(place, place, course, course, st.sampled_from([50.0, 100.0, 150.0]))
def test_course_and_slope_are_the_derivatives_of_the_position(
    north: float, east: float, course_in: float, course_out: float, begin_height: float
) -> None:
    start, end = PathPoint(0, 0, begin_height, course_in), PathPoint(north, east, 100, course_out)
    route, step_m = join(start, end, 150.0, 0.1), 1e-3
    for share in (-0.1, 0.013, 0.21, 0.52, 0.77, 0.987, 1.1):
        at_m = share * (route.length_m + 1.0)
        before, here, after = (route.at(at_m + each) for each in (-step_m, 0.0, step_m))
        course_rad = math.atan2(after.east_m - before.east_m, after.north_m - before.north_m)
        assert math.remainder(here.course_rad - course_rad, math.tau) == pytest.approx(0.0, abs=1e-4)
        if abs(after.slope - before.slope) < 1e-9:
            assert here.slope == pytest.approx((after.height_m - before.height_m) / (2.0 * step_m), abs=1e-6)
        if after.curvature_1pm == before.curvature_1pm:
            turned_rad = math.remainder(after.course_rad - before.course_rad, math.tau)
            assert here.curvature_1pm == pytest.approx(turned_rad / (2.0 * step_m), abs=1e-6)


@pytest.mark.parametrize("climb_m", [40.0, -40.0, 0.0])
def test_beyond_its_ends_a_route_is_straight_and_as_level_as_it_may_be(climb_m: float) -> None:
    """A climb of 40 m at a tenth takes 400 m, of which a quarter of a circle of 100 m radius leaves 243 m."""
    quarter_m = 50.0 * math.pi
    route = JoinRoute((Leg(PathPoint(0, 0, 100, 0.0), quarter_m, 0.01),), 100.0, 100.0 + climb_m, 0.1)
    before, start, end, beyond = (route.at(at_m) for at_m in (-30.0, 0.0, quarter_m, quarter_m + 30.0))
    slope = math.copysign(0.1, climb_m) if climb_m else 0.0
    assert before.values() == pytest.approx((-30.0, 0.0, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert start.values() == pytest.approx((0.0, 0.0, 100.0, 0.0, 0.01, 0.0, slope, 0.0))
    assert (end.north_m, end.east_m, end.course_rad, end.curvature_1pm) == pytest.approx((100, 100, math.pi / 2, 0.01))
    assert (beyond.north_m, beyond.east_m, beyond.curvature_1pm) == pytest.approx((100.0, 130.0, 0.0))
    assert beyond.height_m == pytest.approx(100.0 + slope * (quarter_m + 30.0))
    reached = route.at(401.0)
    assert (reached.height_m, reached.slope) == pytest.approx((100.0 + climb_m, 0.0))

"""Paths of legs: closed forms of turns, and what holds for any waypoints."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.legs.detour import Detours
from flight_model.legs.deviation import deviation
from flight_model.legs.heights import TIGHTER, Climbs, interior_slope
from flight_model.legs.joining import TurnRules
from flight_model.legs.path import LegPlan, LegsPath
from flight_model.legs.turn import TurnLimits, tangent_m, turn_length_m, turned_m
from flight_model.path import PathError
from flight_model.spline import SplinePath

LIMITS = TurnLimits(1.0 / 150.0, 1.5 / 150.0 / 120.0)
"""A radius of 150 m, after a transition of 120 m."""
CLIMBS = Climbs(0.14, 7e-4)
MAX_M = 100.0


def legs(waypoints, *, over: bool = False, circle: bool = False, lack=None, max_m: float = MAX_M) -> LegsPath:
    count = len(waypoints) - 1
    return LegsPath(waypoints, LegPlan(TurnRules([LIMITS] * count, max_m, over, lack), [CLIMBS] * count, circle))


def lanes(spacing_m: float, count: int = 4, length_m: float = 1500.0) -> list[list[float]]:
    ends = [[[0.0, lane * spacing_m, 100.0], [length_m, lane * spacing_m, 100.0]] for lane in range(count)]
    return [end for lane, both in enumerate(ends) for end in (both if lane % 2 == 0 else both[::-1])]


def of_turn(angle_rad: float) -> tuple[complex, float]:
    angle = np.asarray(angle_rad)
    return complex(turned_m(angle, LIMITS)), float(turn_length_m(angle, LIMITS))


@pytest.mark.parametrize("angle_rad", [1.0, 2.0, math.pi, 5.0, 2.0 * math.pi])
def test_a_turn_is_longer_than_its_arc_by_one_transition(angle_rad):
    assert of_turn(angle_rad)[1] == pytest.approx(150.0 * angle_rad + 120.0)


def test_a_small_turn_has_no_arc_and_its_peak_is_lower():
    assert LIMITS.transition_rad == pytest.approx(120.0 / 150.0)
    # k L = angle with L = 1.5 k / rate: twice the root of 1.5 angle / rate.
    assert of_turn(0.2)[1] == pytest.approx(2.0 * math.sqrt(1.5 * 0.2 / LIMITS.curvature_rate_1pm2))


def test_turns_to_both_sides_mirror_each_other_and_a_full_turn_ends_ahead_on_its_line():
    assert of_turn(-1.3)[0] == pytest.approx(of_turn(1.3)[0].conjugate())
    full = of_turn(2.0 * math.pi)[0]
    assert full.imag == pytest.approx(0.0, abs=1e-9)
    assert full.real == pytest.approx(120.0, rel=0.01)


def test_the_tangents_of_a_turn_meet_equally_far_from_both_ends():
    end, _ = of_turn(1.2)
    assert abs(end - tangent_m(1.2, LIMITS)) == pytest.approx(tangent_m(1.2, LIMITS))


@given(st.floats(-900.0, 900.0), st.floats(-900.0, 900.0), st.floats(-math.pi, math.pi))
@settings(max_examples=60, deadline=None)
def test_every_detour_ends_where_and_as_it_should_and_the_shortest_is_first(forward_m, right_m, angle_rad):
    options = Detours(LIMITS).between(forward_m, right_m, angle_rad)
    assert options
    assert [option.length_m for option in options] == sorted(option.length_m for option in options)
    for option in options:
        end, course, length_m = 0j, 0.0, 0.0
        for part in option.parts:
            turn = turned_m(np.asarray(part.angle_rad), LIMITS.widened(part.widened))
            end += np.exp(1j * course) * (part.straight_m + turn)
            length_m += part.straight_m + part.widened * float(turn_length_m(np.asarray(part.angle_rad), LIMITS))
            course += part.angle_rad
            assert part.widened >= 1.0
        assert abs(end - complex(forward_m, right_m)) < 1e-4
        assert abs(np.exp(1j * course) - np.exp(1j * angle_rad)) < 1e-6
        assert option.length_m == pytest.approx(length_m)
        assert option.length_m >= abs(end) - 1e-6


@pytest.mark.parametrize("spacing_m", [40.0, 60.0, 100.0, 200.0, 300.0, 350.0, 400.0])
def test_every_lane_of_a_survey_is_flown_straight_from_end_to_end(spacing_m):
    waypoints = lanes(spacing_m)
    path = legs(waypoints)
    at_m = np.arange(0.0, path.length_m, 0.5)
    points = path.at(at_m)
    for lane in range(4):
        on = (np.abs(points.east_m - lane * spacing_m) < 1e-3) & (np.abs(points.curvature_1pm) < 1e-9)
        north_m = points.north_m[on]
        assert north_m.min() < 2.0
        assert north_m.max() > 1498.0
    assert [each.kind for each in path.passed] == ["detour"] * 3
    assert np.ptp(points.height_m) < 1e-9


def test_lanes_far_apart_are_joined_by_two_turns_inside_their_corners():
    path = legs(lanes(500.0))
    assert [each.kind for each in path.passed] == ["turn"] * 6
    # A right angle cut by a turn: two legs shorter by the tangent, and the turn's own length.
    tangent, (_, turn_m) = tangent_m(math.pi / 2.0, LIMITS), of_turn(math.pi / 2.0)
    assert path.length_m == pytest.approx(4 * 1500.0 + 3 * 500.0 + 6 * (turn_m - 2.0 * tangent))


def test_a_leg_that_turns_straight_back_ends_and_begins_at_its_waypoint():
    path = legs([[0, 0, 100], [1000, 0, 100], [0, 0, 100]])
    (passed,) = path.passed
    for at_m, course in ((passed.begin_m, 0.0), (passed.begin_m + passed.length_m, math.pi)):
        point = path.at(at_m)
        assert (point.north_m, point.east_m) == pytest.approx((1000.0, 0.0), abs=1e-3)
        assert abs(math.remainder(point.course_rad - course, math.tau)) < 1e-6


def test_a_turn_that_would_pass_too_far_from_its_waypoint_is_a_detour_over_it():
    sharp = [[0, 0, 100], [3000, 0, 100], [500, 900, 100]]
    assert legs(sharp).passed[0].kind == "detour"
    inside = legs(sharp, max_m=1000.0)
    assert inside.passed[0].kind == "turn"


@pytest.mark.parametrize("degrees", [110.0, 120.0, 135.0, 149.0, -125.0])
def test_a_sharp_corner_is_passed_within_the_distance_and_near_its_legs(degrees):
    turned = 2000.0 * np.exp(1j * math.radians(degrees))
    waypoints = [[0, 0, 100], [2000, 0, 100], [2000.0 + turned.real, turned.imag, 100]]
    path = legs(waypoints)
    (passed,) = path.passed
    assert passed.kind == "overshoot"
    points = path.at(np.arange(0.0, path.length_m, 2.0))
    nearest_m = np.abs(points.north_m + 1j * points.east_m - 2000.0).min()
    assert nearest_m <= MAX_M + 2.0
    # A loop over the waypoint is two radii and more from both legs.
    assert deviation(path, waypoints).off_legs_m < (1.0 - math.cos(math.radians(degrees))) * 150.0


def test_a_sharp_corner_between_legs_of_which_one_is_short_takes_no_more_of_that_than_there_is():
    path = legs([[0, 0, 100], [2000, 0, 100], [1800, 346.4, 100], [1800, 3000, 100]])
    first, second = path.passed
    assert first.begin_m + first.length_m <= second.begin_m + 1e-6
    assert "detour" not in {first.kind, second.kind}


def test_a_detour_is_the_shortest_one_that_has_room():
    waypoints = [[0, 0, 100], [1500, 0, 100], [1200, 60, 100], [0, 60, 100]]
    shortest = legs(waypoints)
    farthest_m = shortest.at(np.linspace(0.0, shortest.length_m, 5000)).north_m.max()

    def lack(points, course_rad):
        return float(np.maximum(points.real - (farthest_m - 100.0), 0.0).sum())

    inside = legs(waypoints, lack=lack)
    assert inside.at(np.linspace(0.0, inside.length_m, 5000)).north_m.max() < farthest_m - 50.0
    assert inside.length_m > shortest.length_m


def test_a_detour_without_room_is_looked_for_near_its_legs_alone():
    # The lines of legs that are almost opposite meet 1,000 km away.
    waypoints = [[0, 0, 100], [1500, 0, 100], [1500, 200, 100], [0, 200.0003, 100]]

    def lack(points, course_rad):
        assert np.abs(points).max() < 10_000.0
        return float(points.size)

    assert legs(waypoints, lack=lack).length_m < 10_000.0


waypoint = st.tuples(st.floats(-3000.0, 3000.0), st.floats(-3000.0, 3000.0), st.floats(80.0, 130.0))


@st.composite
def missions(draw):
    found = [draw(waypoint)]
    for each in draw(st.lists(waypoint, min_size=1, max_size=7)):
        if math.hypot(each[0] - found[-1][0], each[1] - found[-1][1]) > 30.0:
            found.append(each)
    return found if len(found) > 1 else [*found, (found[0][0] + 500.0, found[0][1], 100.0)]


@given(missions(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_any_mission_is_a_curve_of_bounded_and_continuous_curvature_through_its_ends(waypoints, over):
    path = legs(waypoints, over=over)
    for end_m, (north_m, east_m, height_m) in ((0.0, waypoints[0]), (path.length_m, waypoints[-1])):
        point = path.at(end_m)
        assert (point.north_m, point.east_m, point.height_m) == pytest.approx((north_m, east_m, height_m), abs=1e-3)
    step_m = 1.0
    at_m = np.arange(0.0, path.length_m, step_m)
    points = path.at(at_m)
    course = np.unwrap(points.course_rad)
    flat = points.north_m + 1j * points.east_m
    # By finite differences: as long as it says, turning as it says, never faster nor less smoothly than allowed.
    assert np.abs(np.abs(np.diff(flat)) - step_m).max() < 2e-5
    assert np.abs(np.diff(course)).max() / step_m <= LIMITS.curvature_1pm * (1.0 + 1e-4)
    middle = (points.curvature_1pm[1:] + points.curvature_1pm[:-1]) / 2.0
    assert np.abs(np.diff(course) / step_m - middle).max() < 1e-5
    assert np.abs(np.diff(points.curvature_1pm)).max() / step_m <= LIMITS.curvature_rate_1pm2 * (1.0 + 1e-3) + 1e-9
    for each in path.passed:
        if over and each.first == each.last:
            point, (north_m, east_m, _) = path.at(path.waypoints_at_m[each.first]), waypoints[each.first]
            assert math.hypot(point.north_m - north_m, point.east_m - east_m) < 1e-3
        if each.kind == "detour":
            for where_m, index in ((each.begin_m, each.first), (each.begin_m + each.length_m, each.last)):
                point, (north_m, east_m, _) = path.at(where_m), waypoints[index]
                assert math.hypot(point.north_m - north_m, point.east_m - east_m) < 1e-3
    assert np.all(np.diff(path.waypoints_at_m) >= 0.0)
    everywhere = path.at(
        np.concatenate([path.nodes_m[:-1] + share * np.diff(path.nodes_m) for share in (0.1, 0.5, 0.9)])
    )
    assert np.abs(everywhere.curvature_rate_1pm2).max() <= LIMITS.curvature_rate_1pm2 * (1.0 + 1e-2) + 1e-8


@given(missions())
@settings(max_examples=60, deadline=None)
def test_what_is_straight_lies_on_a_leg_and_turns_pass_within_the_distance_allowed(waypoints):
    path = legs(waypoints)
    at_m = np.arange(0.0, path.length_m, 5.0)
    joined = np.zeros(at_m.size, dtype=bool)
    for each in path.passed:
        joined |= (at_m >= each.begin_m - 1e-6) & (at_m <= each.begin_m + each.length_m + 1e-6)
        if each.kind in ("turn", "overshoot") and each.first == each.last:
            point, (north_m, east_m, _) = path.at(path.waypoints_at_m[each.first]), waypoints[each.first]
            between_m = each.length_m / 48.0 if each.kind == "overshoot" else 1e-3  # that is found by samples
            assert math.hypot(point.north_m - north_m, point.east_m - east_m) <= MAX_M + between_m
    points = path.at(at_m[~joined])
    flat = np.array(waypoints)[:, :2] @ np.array([1.0, 1j])
    begin, along = flat[:-1, None], np.diff(flat)[:, None]
    position = points.north_m + 1j * points.east_m
    share = np.clip(((position - begin) * np.conj(along)).real / np.abs(along) ** 2, 0.0, 1.0)
    assert np.abs(position - begin - share * along).min(axis=0).max(initial=0.0) < 1e-3
    assert np.all(points.curvature_1pm == pytest.approx(0.0, abs=1e-9))


@given(missions(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_heights_are_never_outside_those_of_the_waypoints_and_slopes_are_continuous(waypoints, circle):
    path = legs(waypoints, circle=circle)
    at_m = np.arange(0.0, path.length_m, 1.0)
    points, heights = path.at(at_m), np.array(waypoints)[:, 2]
    leg = np.clip(np.searchsorted(path.waypoints_at_m, at_m, side="right") - 1, 0, len(waypoints) - 2)
    assert np.all(points.height_m <= np.maximum(heights[leg], heights[leg + 1]) + 0.01)
    assert np.all(points.height_m >= np.minimum(heights[leg], heights[leg + 1]) - 0.01)
    if not path.steep:
        assert np.abs(points.slope).max() <= CLIMBS.slope * (1.0 + 1e-6)
        assert np.abs(np.diff(points.slope)).max() <= TIGHTER[-1] * CLIMBS.change_1pm * (1.0 + 1e-3)
    assert np.abs(np.diff(points.height_m) - (points.slope[1:] + points.slope[:-1]) / 2.0).max() < 2e-3


def test_a_slope_leaves_room_for_its_rounding():
    # x D - 2 c x^2 = rise with c = 0.75 / change, from level to level.
    slope = interior_slope(2000.0, 100.0, (0.0, 0.0), CLIMBS.change_1pm)
    assert slope is not None
    assert slope * 2000.0 - 2.0 * 0.75 / CLIMBS.change_1pm * slope**2 == pytest.approx(100.0)
    assert slope > 100.0 / 2000.0
    assert interior_slope(200.0, 100.0, (0.0, 0.0), CLIMBS.change_1pm) is None


def test_a_leg_that_is_too_steep_is_named_or_ends_in_as_few_circles_as_do():
    steep = [[0, 0, 100], [2000, 0, 100], [2500, 0, 300], [4500, 0, 300]]
    refused, circled = legs(steep), legs(steep, circle=True)
    assert list(refused.steep) == [2]
    assert not circled.steep
    extra_m = circled.length_m - refused.length_m
    circle_m = 2.0 * math.pi * 150.0
    # 200 m at a slope of 0.14 at most take 1429 m and the rounding's 75 m: two circles more than the leg of 500 m.
    assert extra_m == pytest.approx(2 * circle_m + 120.0 - of_turn(2.0 * math.pi)[0].real, rel=1e-6)
    assert circled.at(circled.length_m).north_m == pytest.approx(4500.0, abs=1e-3)


def test_waypoints_at_one_position_have_no_leg_between_them():
    with pytest.raises(PathError, match=r"0\.5 m from the one before it"):
        legs([[0, 0, 100], [1000, 0, 100], [1000.5, 0, 100]])


def test_a_curve_through_unequal_legs_leaves_them_and_a_path_of_legs_says_by_how_much_less():
    waypoints = [[0, 0, 100], [2000, 0, 100], [2300, 300, 160], [2300, 2500, 160]]
    curve, straight = deviation(SplinePath(waypoints), waypoints), deviation(legs(waypoints), waypoints)
    assert curve.off_legs_m > 100.0
    assert curve.outside_heights_m > 5.0
    assert straight.off_legs_m < 40.0
    assert straight.outside_heights_m < 0.01
    point = SplinePath(waypoints).at(curve.off_legs_at_m)
    on_first = abs(point.east_m) if point.north_m <= 2000.0 else math.inf
    assert min(on_first, abs(point.north_m - 2300.0)) >= curve.off_legs_m - 1e-6


def test_five_hundred_legs_of_a_survey_are_one_path():
    path = legs(lanes(40.0, 250))
    assert len(path.waypoints_at_m) == 500
    end = path.at(path.length_m)
    assert (end.north_m, end.east_m) == pytest.approx((0.0, 249 * 40.0), abs=1e-2)

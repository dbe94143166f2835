"""Route tracking: projection onto a route."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.autopilot_model import AutopilotModel
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from flight_model.spline import SplinePath
from gcs_formation.guidance.join_route import JoinRoute, Leg
from gcs_formation.guidance.tracking import (
    Abreast,
    course_or_heading,
    height_setpoint_m,
    nearest,
    project,
    route_heading,
)

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
BENDS = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 120]])
BACK = SplinePath([[3000, 700, 120], [1500, 0, 100], [0, 0, 100]])


@given(st.floats(-200.0, 3400.0), st.floats(-100.0, 100.0), st.floats(-60.0, 60.0))
def test_a_place_beside_a_path_is_projected_onto_its_foot(s: float, right_m: float, ahead_m: float) -> None:
    foot = BENDS.at(s)
    north_m = foot.north_m - right_m * math.sin(foot.course_rad)
    east_m = foot.east_m + right_m * math.cos(foot.course_rad)
    assert project(BENDS, north_m, east_m, s + ahead_m) == pytest.approx(s, abs=1e-3)


@given(st.floats(-500.0, 3500.0), st.floats(-800.0, 1500.0), st.floats(0.0, 2800.0), st.floats(10.0, 700.0))
def test_no_point_between_two_distances_is_nearer_than_the_nearest(
    north_m: float, east_m: float, from_m: float, length_m: float
) -> None:

    def away_m(distance_m: float) -> float:
        return math.dist((north_m, east_m), (BENDS.at(distance_m).north_m, BENDS.at(distance_m).east_m))

    found_m = nearest(BENDS, north_m, east_m, from_m, from_m + length_m)
    assert from_m <= found_m <= from_m + length_m
    assert away_m(found_m) <= min(away_m(from_m + length_m * share / 40) for share in range(41)) + 1e-6


@pytest.mark.parametrize("s", [300.0, 800.0, 1200.0, 1500.0, 1800.0, 2600.0])
def test_on_a_path_that_turns_back_the_nearest_point_is_on_the_leg_beside_which_it_is(s: float) -> None:
    path = SplinePath([[0, 0, 100], [1000, 0, 100], [1300, 300, 100], [1000, 600, 100], [0, 600, 100]])
    foot = path.at(s)
    north_m, east_m = foot.north_m - 5.0 * math.sin(foot.course_rad), foot.east_m + 5.0 * math.cos(foot.course_rad)
    for from_m in (0.0, -path.length_m, -0.9 * path.length_m):
        assert nearest(path, north_m, east_m, from_m, path.length_m) == pytest.approx(s, abs=1e-3)


@pytest.mark.parametrize(("right_m", "along_mps"), [(0.0, 20.0), (20.0, 25.0), (-25.0, 16.0)])
def test_a_new_leader_begins_with_the_climb_it_has_and_the_change_of_it_that_its_setpoint_makes(
    right_m: float, along_mps: float
) -> None:
    """In a right turn of 100 m radius at 20 m/s, where the path covers more ground than what flies on its inside.

    By (7), with time constants of 1 s and 3 s, 3.2 m below its setpoint and climbing at 0.5 m/s the climb changes by
    (3.2 - 4 · 0.5) / 3 = 0.4 m/s², of which 3 / (2 · 4) m/s² is allowed.
    """
    abreast = Abreast(PathPoint(0.0, 0.0, 100.0, 0.0, 0.01, 0.0, 0.01, 1e-4), right_m, -6.0)
    climbs = FlightState(0.0, right_m, 94.0, 0.5, 20.0, 0.0, 0.0, 0.0)
    for commanded_m, change_mps2 in ((97.2, 0.375), (96.9, 0.3), (94.0, -0.375), (math.nan, -0.375)):
        rise = abreast.rise(climbs, commanded_m, MODEL, 20.0)
        assert rise[0] == -6.0
        assert (rise[1] + 0.01) * along_mps == pytest.approx(0.5)
        assert (rise[2] + 1e-4) * along_mps**2 == pytest.approx(change_mps2)


@pytest.mark.parametrize("course_rad", [0.0, 3.0])
@pytest.mark.parametrize(("off_deg", "slope_deg"), [(10.0, 10.0), (-20.0, -20.0), (50.0, 30.0), (-170.0, -30.0)])
def test_a_new_leader_begins_on_its_own_course_up_to_thirty_degrees_off_the_paths(
    off_deg: float, slope_deg: float, course_rad: float
) -> None:
    """On the inside of a bend by a fifth of its radius, it covers four fifths of the path's distance."""
    heading_rad, slope_rad = course_rad + math.radians(off_deg), math.radians(slope_deg)
    abreast = Abreast(PathPoint(0.0, 0.0, 100.0, course_rad, 0.01), 20.0, 0.0)
    flies = FlightState(0.0, 20.0, 100.0, 0.0, 20.0, heading_rad, 0.0, 0.0)
    assert abreast.lateral_slope(flies) == pytest.approx(0.8 * math.tan(slope_rad))
    flies.airspeed_mps = 0.1
    assert abreast.lateral_slope(flies) == 0.0, "the course of one that hovers is noise"


def test_a_projection_onto_an_arc_takes_no_more_than_three_steps_and_onto_a_straight_one() -> None:
    """Newton's method: within 0.1 mm from 20 m before, half of the radius inside; a straight has no error to repeat."""
    seen_m = list[float]()

    class Seen(JoinRoute):
        def at(self, distance_m: float) -> PathPoint:
            seen_m.append(distance_m)
            return super().at(distance_m)

    arc = Seen((Leg(PathPoint(0.0, 0.0, 100.0, 0.0), 300.0, 0.01),), 100.0, 100.0, 0.1)
    foot = arc.at(100.0)
    seen_m.clear()
    north_m, east_m = foot.north_m - 50.0 * math.sin(foot.course_rad), 50.0 * math.cos(foot.course_rad) + foot.east_m
    assert project(arc, north_m, east_m, 80.0) == pytest.approx(100.0, abs=1e-4)
    assert len(seen_m) == 3
    straight = Seen((Leg(PathPoint(0.0, 0.0, 100.0, 0.0), 300.0, 0.0),), 100.0, 100.0, 0.1)
    seen_m.clear()
    assert project(straight, 120.0, 30.0, 80.0) == 120.0
    assert len(seen_m) == 2


def test_nearer_to_a_bends_centre_than_a_fifth_of_its_radius_a_projection_only_approaches_the_foot() -> None:
    """At a twentieth, each of three steps takes 0.05 / 0.2 of what is left: (3/4)³ of it remain."""
    arc = JoinRoute((Leg(PathPoint(0.0, 0.0, 100.0, 0.0), 300.0, 0.01),), 100.0, 100.0, 0.1)
    foot = arc.at(100.0)
    north_m, east_m = foot.north_m - 95.0 * math.sin(foot.course_rad), foot.east_m + 95.0 * math.cos(foot.course_rad)
    assert project(arc, north_m, east_m, 101.0) == pytest.approx(100.0 + 0.75**3, abs=1e-3)


@settings(max_examples=15, deadline=None)
@given(st.floats(-200.0, 3400.0), st.floats(-100.0, 100.0), st.floats(-30.0, 30.0))
def test_on_a_path_flown_backwards_the_foot_is_the_same_point(s: float, right_m: float, ahead_m: float) -> None:
    foot = BENDS.at(s)
    north_m = foot.north_m - right_m * math.sin(foot.course_rad)
    east_m = foot.east_m + right_m * math.cos(foot.course_rad)
    assert BENDS.length_m - project(BACK, north_m, east_m, BENDS.length_m - s + ahead_m) == pytest.approx(s, abs=1e-2)


def test_the_nearest_point_is_never_beyond_what_is_searched() -> None:
    path = SplinePath([[0, 0, 100], [3000, 0, 100]])
    assert nearest(path, 500.0, 40.0, 700.0, 700.0) == 700.0
    assert nearest(path, 500.0, 40.0, 700.0, 705.0) == 700.0
    assert nearest(path, 900.0, 40.0, 700.0, 800.0) == 800.0
    assert nearest(path, 703.0, 40.0, 700.0, 705.0) == pytest.approx(703.0)


def test_what_is_near_just_beyond_the_end_of_what_is_searched_does_not_count() -> None:
    """Between two legs 60 m apart, 25 m from the one that leads back: the search ends 28 m before its foot there.

    So the first leg is nearer, at 35 m, than the end, at 37.5 m.
    """
    there, arc_m = Leg(PathPoint(0.0, 0.0, 100.0, 0.0), 1000.0, 0.0), 30.0 * math.pi
    arc = Leg(there.at(1000.0), arc_m, 1.0 / 30.0)
    route = JoinRoute((there, arc, Leg(arc.at(arc_m), 1000.0, 0.0)), 100.0, 100.0, 0.1)
    foot_m = 1500.0 + arc_m
    assert nearest(route, 500.0, 35.0, 0.0, foot_m - 28.0) == pytest.approx(500.0)
    assert nearest(route, 500.0, 35.0, 0.0, foot_m - 20.0) == pytest.approx(foot_m - 20.0)
    assert nearest(route, 500.0, 35.0, 0.0, foot_m + 20.0) == pytest.approx(foot_m)


@pytest.mark.parametrize(("wind_mps", "along_mps"), [(0.0, 20.0), (5.0, 25.0), (-8.0, 12.0)])
def test_rates_along_a_route_are_its_derivatives_by_the_distance_times_the_speed_over_ground(
    wind_mps: float, along_mps: float
) -> None:
    point = PathPoint(0.0, 0.0, 100.0, math.pi / 2, 0.01, 1e-4, 0.05, 1e-4)
    found = route_heading(point, FlightState(0.0, 0.0, 100.0, 0.0, 20.0, math.pi / 2, 0.0, wind_mps))
    assert (found.heading_rad, found.along_mps) == pytest.approx((math.pi / 2, along_mps))
    assert (found.turn_rps, found.climb_mps) == pytest.approx((0.01 * along_mps, 0.05 * along_mps))
    assert found.bend_rps2 == pytest.approx(1e-4 * along_mps**2)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_along_a_route_in_a_crosswind_it_heads_into_the_wind(side: float) -> None:
    """10 m/s from the left against 20 m/s: 30 degrees to the left, and 20 cos 30 along the route."""
    point = PathPoint(0.0, 0.0, 100.0, 0.0)
    state = FlightState(0.0, 0.0, 100.0, 0.0, 20.0, math.radians(-30.0 * side), 0.0, 10.0 * side)
    found = route_heading(point, state)
    assert found.heading_rad == pytest.approx(math.radians(-30.0 * side))
    assert found.along_mps == pytest.approx(20.0 * math.cos(math.radians(30.0)))


def test_the_height_setpoint_inverts_equation_seven() -> None:
    """z_r = z + (tau_a + tau_b) z' + tau_a tau_b z'' is 100 + 4 · 1 + 3 · 1e-4 · 20²; an updraught is taken off z'."""
    point = PathPoint(0.0, 0.0, 100.0, 0.5, 0.0, 0.0, 0.05, 1e-4)
    state = FlightState(3.0, 4.0, 80.0, 0.0, 20.0, 0.5, 0.0, 0.0)
    assert height_setpoint_m(point, state, MODEL) == pytest.approx(104.12)
    state.updraught_mps = 0.5
    assert height_setpoint_m(point, state, MODEL) == pytest.approx(102.12)
    state.heading_rad += math.pi
    assert height_setpoint_m(point, state, MODEL) == pytest.approx(100.0 + 4.0 * -1.5 + 0.12)


@pytest.mark.parametrize(("speed_mps", "by_course"), [(1.95, False), (2.0, True)])
def test_a_course_counts_from_two_metres_a_second_on(speed_mps: float, by_course: bool) -> None:
    """Here it drifts to the east, and faces 0.3 rad."""
    drifts = FlightState(0.0, 0.0, 100.0, 0.0, 0.0, 0.3, 0.0, speed_mps)
    assert course_or_heading(drifts) == pytest.approx(math.pi / 2 if by_course else 0.3)
    abreast = Abreast(PathPoint(0.0, 0.0, 100.0, math.pi / 2 - 0.2), 0.0, 0.0)
    assert abreast.lateral_slope(drifts) == pytest.approx(math.tan(0.2) if by_course else 0.0)


def test_the_climb_of_one_that_hardly_flies_along_the_path_counts_as_at_one_metre_a_second() -> None:
    abreast = Abreast(PathPoint(0.0, 0.0, 100.0, 0.0), 0.0, 0.0)
    climbs = FlightState(0.0, 0.0, 100.0, 0.4, 0.0, 0.0, 0.0, 0.0)
    slow, at_one, at_two = (abreast.rise(climbs, 101.6, MODEL, each) for each in (0.1, 1.0, 2.0))
    assert slow == at_one == pytest.approx((0.0, 0.4, 0.0))
    assert at_two == pytest.approx((0.0, 0.2, 0.0))

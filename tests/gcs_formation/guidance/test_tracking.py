"""Route tracking: projection onto a route."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.autopilot_model import AutopilotModel
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from flight_model.spline import SplinePath
from gcs_formation.guidance.tracking import Abreast, nearest, project

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)


@given(st.floats(-200.0, 3400.0), st.floats(-100.0, 100.0), st.floats(-60.0, 60.0))
def test_a_place_beside_a_path_is_projected_onto_its_foot(s: float, right_m: float, ahead_m: float) -> None:
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 120]])
    foot = path.at(s)
    north_m = foot.north_m - right_m * math.sin(foot.course_rad)
    east_m = foot.east_m + right_m * math.cos(foot.course_rad)
    assert project(path, north_m, east_m, s + ahead_m) == pytest.approx(s, abs=1e-3)


@given(st.floats(-500.0, 3500.0), st.floats(-800.0, 1500.0), st.floats(0.0, 2800.0), st.floats(10.0, 700.0))
def test_no_point_between_two_distances_is_nearer_than_the_nearest(
    north_m: float, east_m: float, from_m: float, length_m: float
) -> None:
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 120]])

    def away_m(distance_m: float) -> float:
        return math.dist((north_m, east_m), (path.at(distance_m).north_m, path.at(distance_m).east_m))

    found_m = nearest(path, north_m, east_m, from_m, from_m + length_m)
    assert from_m <= found_m <= from_m + length_m
    assert away_m(found_m) <= min(away_m(from_m + length_m * share / 40) for share in range(41)) + 1e-6


@pytest.mark.parametrize("s", [300.0, 800.0, 1200.0, 1500.0, 1800.0, 2600.0])
def test_on_a_path_that_turns_back_the_nearest_point_is_on_the_leg_beside_which_it_is(s: float) -> None:
    path = SplinePath([[0, 0, 100], [1000, 0, 100], [1300, 300, 100], [1000, 600, 100], [0, 600, 100]])
    foot = path.at(s)
    north_m, east_m = foot.north_m - 5.0 * math.sin(foot.course_rad), foot.east_m + 5.0 * math.cos(foot.course_rad)
    assert nearest(path, north_m, east_m, 0.0, path.length_m) == pytest.approx(s, abs=1e-3)


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

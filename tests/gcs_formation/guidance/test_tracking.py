"""Route tracking: the rate given with the heading setpoint is its derivative along the vehicle's motion."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.autopilot_model import AutopilotModel, FlightState
from flight_model.spline import SplinePath
from gcs_formation.guidance.tracking import project, track, track_turn

ROUTE = SplinePath([[0, 0, 100], [900, 0, 100], [1700, 500, 120], [2300, 1300, 110], [3300, 1500, 100]])
MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
SPEED_MPS = 22.0


Rates = tuple[tuple[float, float], float, tuple[float, float]]
"""Of position, heading and wind; of position and wind north and east."""


def moved(state: FlightState, rates: Rates, seconds: float) -> FlightState:
    """Return a state some time later, at constant rates."""
    place_mps, turn_rps, wind_mps2 = rates
    return FlightState(
        state.north_m + place_mps[0] * seconds,
        state.east_m + place_mps[1] * seconds,
        state.height_m,
        state.climb_mps,
        state.airspeed_mps,
        state.heading_rad + turn_rps * seconds,
        state.wind_north_mps + wind_mps2[0] * seconds,
        state.wind_east_mps + wind_mps2[1] * seconds,
    )


@settings(max_examples=150, deadline=None)
@given(
    st.floats(1000.0, 2500.0),
    st.floats(-2.0, 2.0),
    st.floats(-0.03, 0.03),
    st.floats(-0.03, 0.03),
    st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)),
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
    st.floats(-0.7, 0.7),
)
def test_the_told_turn_is_the_derivative_of_the_told_heading(
    at_m: float,
    right_m: float,
    off_rad: float,
    turn_rps: float,
    wind_mps: tuple[float, float],
    wind_mps2: tuple[float, float],
    carried_mps: float,
) -> None:
    """In wind, in bends, off the route; the position needn't move as the wind says."""
    point = ROUTE.at(at_m)
    north_m = point.north_m - right_m * math.sin(point.course_rad)
    east_m = point.east_m + right_m * math.cos(point.course_rad)
    state = FlightState(north_m, east_m, 100.0, 0.0, SPEED_MPS, point.course_rad + off_rad, *wind_mps)
    north_mps, east_mps = state.ground_mps()
    rates = (north_mps + carried_mps, east_mps - carried_mps), turn_rps, wind_mps2

    def told_rad(seconds: float) -> float:
        later = moved(state, rates, seconds)
        abreast_m = project(ROUTE, later.north_m, later.east_m, at_m)
        return track(ROUTE.at(abreast_m), later, MODEL, SPEED_MPS).heading_rad

    measured_rps = math.remainder(told_rad(0.001) - told_rad(-0.001), math.tau) / 0.002
    abreast = ROUTE.at(project(ROUTE, north_m, east_m, at_m))
    assert track_turn(abreast, state, MODEL, SPEED_MPS, *rates) == pytest.approx(measured_rps, abs=3e-4)


@given(st.floats(950.0, 2200.0), st.floats(-20.0, 20.0))
def test_who_stands_faces_along_the_route_however_far_beside_it(at_m: float, right_m: float) -> None:
    """It comes no closer by turning, and all slots would turn with its nose."""
    point = ROUTE.at(at_m)
    north_m = point.north_m - right_m * math.sin(point.course_rad)
    east_m = point.east_m + right_m * math.cos(point.course_rad)
    state = FlightState(north_m, east_m, 100.0, 0.0, 0.0, point.course_rad, 0.0, 0.0)
    drifts = (0.2, -0.1), 0.0, (0.0, 0.0)
    assert track(point, state, MODEL, 0.0).heading_rad == point.course_rad
    assert abs(track_turn(point, state, MODEL, 0.0, *drifts)) <= 0.25 * abs(point.curvature_1pm)


@given(st.floats(-200.0, 3400.0), st.floats(-100.0, 100.0), st.floats(-60.0, 60.0))
def test_a_place_beside_a_path_is_projected_onto_its_foot(s: float, right_m: float, ahead_m: float) -> None:
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 120]])
    foot = path.at(s)
    north_m = foot.north_m - right_m * math.sin(foot.course_rad)
    east_m = foot.east_m + right_m * math.cos(foot.course_rad)
    assert project(path, north_m, east_m, s + ahead_m) == pytest.approx(s, abs=1e-3)

"""The heading that a course shows, and the motion that follows from setpoints sent, by hand."""

from __future__ import annotations

import math

import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from gcs_formation.estimation.sample import heading_shown
from gcs_formation.estimation.setpoint_history import SetpointHistory

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 9.0, 9.0, 9.0)
"""Its limits are far."""


def test_a_course_shows_the_heading_that_crabs_by_the_wind_known_before() -> None:
    """Northwards at 20 m/s in 5 m/s to the east its course is 14 degrees: so one of 30 degrees is a heading of 16."""
    state = FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 0.0, 0.0, 5.0)
    course_rad, crabbed_rad = math.radians(30.0), math.atan2(5.0, 20.0)
    north_mps, east_mps = 21.0 * math.cos(course_rad), 21.0 * math.sin(course_rad)
    assert heading_shown(state, north_mps, east_mps) == pytest.approx(course_rad - crabbed_rad)
    south = FlightState(0.0, 0.0, 100.0, 0.0, 20.0, math.pi, 0.0, 5.0)
    assert abs(heading_shown(south, -20.0, 5.0)) == pytest.approx(math.pi)


@pytest.mark.parametrize("seconds", [0.1, 1.0, 3.0])
def test_a_setpoint_that_acts_moves_airspeed_and_heading_by_their_time_constants_alone(seconds: float) -> None:
    """Commanded 27 m/s instead of 22, and 0.1 rad; the position is left where it was."""
    history = SetpointHistory(10.0)
    history.begin_tick(vec[i64]([0]))
    history.record([(27.0, 0.1, 100.0)])
    state = FlightState(7.0, 8.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)
    history.respond(state, 0, round(seconds * NANOSECONDS), 0, MODEL)
    assert state.airspeed_mps == pytest.approx(27.0 - 5.0 * math.exp(-seconds / 4.0))
    assert state.heading_rad == pytest.approx(0.1 - 0.1 * math.exp(-seconds / 1.5))
    assert (state.north_m, state.east_m, state.height_m) == pytest.approx((7.0, 8.0, 100.0))

"""Setpoints are limited to the envelope, on the side that the law asked for."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from formation_scenario.vehicles import VehicleModel
from gcs_formation.control.setpoint import SLOT_INTERCEPT_MAX_RAD, Envelope

MODEL = AutopilotModel(*list(VehicleModel().model_dump(exclude={"dead_time_s"}).values())[:9])
STATE = FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)


@given(st.floats(-50, 50), st.floats(-10, 10), st.floats(-1e6, 1e6), st.floats(-1e4, 1e4))
def test_what_is_sent_is_inside_the_limits(speed: float, own: float, correction: float, height: float) -> None:
    speed_mps, heading_rad, height_m = Envelope(own, STATE, MODEL).limit(speed, own + correction, height)
    assert 16.0 <= speed_mps <= 28.0
    assert abs(heading_rad - own) <= SLOT_INTERCEPT_MAX_RAD + 1e-9
    assert abs(height_m - 100.0) <= 3.0 * (1.0 + 3.0) + 1e-9


@given(st.floats(1e-3, 100.0))
def test_however_far_to_the_side_a_follower_is_it_turns_towards_its_slot(correction: float) -> None:
    """A correction of half a turn must not become a turn in the other direction."""
    assert Envelope(0.0, STATE, MODEL).limit(22.0, -correction, 100.0)[1] == -min(correction, math.radians(60.0))


@given(st.floats(-0.5, 0.5), st.floats(-3.0, 3.0))
def test_with_its_back_to_the_leader_a_follower_is_commanded_its_slot_s_heading_whatever_its_errors(
    beside: float, correction: float
) -> None:
    """So it turns to one side; told to turn left and right in alternation, it would fly straight on."""
    behind = FlightState(0.0, 0.0, 100.0, 0.0, 22.0, math.pi + beside, 0.0, 0.0)
    assert Envelope(0.0, behind, MODEL).limit(22.0, correction, 100.0)[1] == 0.0

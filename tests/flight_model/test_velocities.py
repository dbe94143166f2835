"""A multirotor's velocity over ground: straight from one value to another, against small steps of its equation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.autopilot_model import AutopilotModel, respond_hovering
from flight_model.flight_state import FlightState
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, advance_hovering
from tests.gcs_formation import tables

COPTER = AutopilotModels(*(np.full(1, each) for each in (0.6, 0.3, 0.5, 0.5, 0.0, 9.0, 2.5, 1.5, 2.5)))
STEP_S = 1e-3
speeds, courses = st.floats(0.0, 9.0), st.floats(-3.1, 3.1)


def integrated(state: FlightState, speed_mps: float, course_rad: float, over_s: float) -> np.ndarray:
    """Return north, east and the velocity after v' = (v_set - v) / tau, limited in acceleration, by small steps."""
    v, position = np.array(state.ground_mps()), np.array((state.north_m, state.east_m))
    commanded = speed_mps * np.array((np.cos(course_rad), np.sin(course_rad)))
    for _ in range(round(over_s / STEP_S)):
        change = (commanded - v) / COPTER.tau_v_s[0]
        change *= min(1.0, COPTER.accel_max_mps2[0] / max(np.linalg.norm(change), 1e-9))
        position, v = position + STEP_S * (v + STEP_S * change / 2), v + STEP_S * change
    return np.array((*position, *v))


@given(speeds, courses, speeds, courses, st.sampled_from((0.2, 0.5)))
def test_it_comes_straight_to_what_it_is_commanded(speed_mps, course_rad, commanded_mps, commanded_rad, over_s):
    state = FlightState(10.0, 20.0, 30.0, 0.0, speed_mps, course_rad, 0.0, 0.0)
    expected = integrated(state, commanded_mps, commanded_rad, over_s)
    setpoints, duration_s = np.array([[commanded_mps], [commanded_rad], [30.0]]), np.array([over_s])
    later = advance_hovering(FlightStates.from_each([state]), setpoints, duration_s, COPTER)
    assert np.array((*later.level_m, *later.ground_mps))[:, 0] == pytest.approx(expected, abs=0.02)
    model: AutopilotModel = tables.models(COPTER)[0]
    respond_hovering(state, model, commanded_mps, commanded_rad, 30.0, over_s)
    assert state.ground_mps() == pytest.approx(expected[2:], abs=0.02)
    assert (state.north_m, state.east_m) == (10.0, 20.0)


def test_without_a_command_it_flies_on():
    state = FlightStates.from_each([FlightState(0.0, 0.0, 30.0, 0.0, 4.0, 0.5, 0.0, 0.0)])
    later = advance_hovering(state, np.full((3, 1), np.nan), np.array([2.0]), COPTER)
    assert later.level_m[:, 0] == pytest.approx([8.0 * np.cos(0.5), 8.0 * np.sin(0.5)])
    assert later.height_m[0] == 30.0

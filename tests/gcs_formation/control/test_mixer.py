"""Formation errors and the slot's own motion, in both frames, against geometry and equation (8)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.autopilot_model import rotated
from flight_model.flight_state import FlightState
from flight_model.slot import Slot
from formation_scenario.fields import Frame
from gcs_formation.control.setpoint import formation_error, slot_target

angle = st.floats(-math.pi, math.pi)
offset = st.floats(-80.0, 80.0)


def state(
    north: float, east: float, height: float, speed: float, heading: float, wind: tuple[float, float] = (0, 0)
) -> FlightState:
    return FlightState(north, east, height, 0.0, speed, heading, *wind)


def standing(forward: float, right: float, up: float) -> Slot:
    return Slot([forward, right, up], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])


@given(angle, offset, offset, st.floats(-20, 20))
def test_a_follower_in_its_slot_has_no_error(heading: float, forward: float, right: float, up: float) -> None:
    north = forward * math.cos(heading) - right * math.sin(heading)
    east = forward * math.sin(heading) + right * math.cos(heading)
    follower, slot = state(north, east, 100 + up, 22, 0), standing(forward, right, up)
    error = formation_error(state(0, 0, 100, 22, heading), follower, slot, heading)
    assert error == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_signs_are_actual_minus_commanded() -> None:
    """A follower that is 2 m behind, 3 m left and 1 m below its slot has errors +2, +3, +1."""
    slot = standing(-30.0, 30.0, 0.0)
    error = formation_error(state(0, 0, 100, 22, 0), state(-32, 27, 99, 22, 0), slot, 0.0)
    assert error == pytest.approx((2.0, 3.0, 1.0))


@pytest.mark.parametrize("frame", ["leader_heading", "follower_heading"])
@given(
    heading=angle,
    turn=st.floats(-0.06, 0.06),
    forward=st.floats(-60.0, 0.0),
    right=st.floats(-40.0, 40.0),
    drift_north=st.floats(-1, 1),
    drift_east=st.floats(-1, 1),
)
def test_the_slots_motion_keeps_the_follower_in_it(
    frame: Frame,
    heading: float,
    turn: float,
    forward: float,
    right: float,
    drift_north: float,
    drift_east: float,
) -> None:
    """Flying the target speed and heading, the errors' derivative by equation (8) is zero in a steady turn."""
    speed, wind = 22.0, (0.4, -0.3)
    slot, leader = standing(forward, right, 0.0), state(0, 0, 100, speed, heading, wind)
    carried = (wind[0] + drift_north, wind[1] + drift_east)
    v2, psi2 = speed, heading
    for _ in range(60):  # in the follower's frame its own heading rotates the drift
        drift = rotated(heading if frame == "leader_heading" else psi2, drift_north, drift_east)
        target = slot_target(leader, *drift, turn, slot, frame)
        v2, psi2 = target.speed_mps, target.heading_rad
    relative = np.array(
        [
            speed * math.cos(heading) + wind[0] - v2 * math.cos(psi2) - carried[0],
            speed * math.sin(heading) + wind[1] - v2 * math.sin(psi2) - carried[1],
        ]
    )
    axis = heading if frame == "leader_heading" else psi2
    rotation = np.array([[math.cos(axis), math.sin(axis)], [-math.sin(axis), math.cos(axis)]])
    turning = turn * np.array([-right, forward])  # d/dt of a rotating frame, at (x_c, y_c) = (-forward, -right)
    assert rotation @ relative + turning == pytest.approx(np.zeros(2), abs=2e-9)

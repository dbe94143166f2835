"""Turns on the spot: the shorter way round, smooth, and no faster than the farthest slot can follow."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import NANOSECONDS, Instant, after
from flight_model.stops.turning import SHARE
from gcs_formation.guidance.turn_on_spot import NOSE_TAU_S, TurnOnSpot

BEGUN = Instant(7 * NANOSECONDS)
SPEED_MPS, ACCEL_MPS2 = 9.0, 2.5
angles = st.floats(-6.0, 6.0)
reaches = st.floats(0.0, 60.0)


def at(turn, share, tau_s=0.0):
    return turn.setpoint(BEGUN + round(share * turn.duration_s * NANOSECONDS), tau_s)


@given(angles, angles, reaches)
def test_it_ends_where_it_is_commanded_to_by_the_shorter_way(goal, begin, reach):
    turn = TurnOnSpot.to(goal, begin, BEGUN, reach, SPEED_MPS, ACCEL_MPS2)
    assert math.remainder(turn.goal_rad - goal, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert abs(turn.by_rad) <= math.pi + 1e-9
    assert at(turn, -1.0) == pytest.approx((begin, 0.0))
    assert at(turn, 2.0) == pytest.approx((turn.goal_rad, 0.0))


@pytest.mark.parametrize("by_rad", [1.5, -1.5])
def test_half_of_it_is_turned_in_half_its_time_and_it_is_over_two_seconds_after_its_end(by_rad):
    """A minimum-jerk turn's largest rate is 15/8 of its mean one (Flash and Hogan, 1985), here 0.5 rad/s."""
    turn = TurnOnSpot.to(0.4 + by_rad, 0.4, BEGUN, 0.0, SPEED_MPS, ACCEL_MPS2)
    assert turn.duration_s == pytest.approx(1.875 * 1.5 / 0.5)
    assert at(turn, 0.5) == pytest.approx((0.4 + by_rad / 2.0, math.copysign(0.5, by_rad)))
    assert at(turn, 0.5, NOSE_TAU_S) == pytest.approx((0.4 + by_rad / 2.0 + by_rad / 3.0 * 0.44, by_rad / 3.0))
    ends = [turn.over(after(BEGUN, turn.duration_s + each)) for each in (0.0, 1.9, 2.0, 2.1)]
    assert ends == [False, False, True, True]


@given(angles, angles, reaches)
def test_slots_follow_within_half_of_what_vehicles_can_do(goal, begin, reach):
    turn = TurnOnSpot.to(goal, begin, BEGUN, reach, SPEED_MPS, ACCEL_MPS2)
    step = 1e-3
    for share in (0.1, 0.21, 0.35, 0.5, 0.79, 0.9):
        rate = at(turn, share)[1]
        change = (at(turn, share + step)[1] - at(turn, share - step)[1]) / (2 * step * turn.duration_s)
        assert reach * abs(rate) <= SHARE * SPEED_MPS * 1.001
        assert reach * rate**2 <= SHARE * ACCEL_MPS2 * 1.001
        assert reach * abs(change) <= SHARE * ACCEL_MPS2 * 1.01


def test_what_follows_with_a_lag_is_led_by_it():
    """A first-order lag with this setpoint flies the turn itself."""
    turn, tau_s, step_s = TurnOnSpot.to(1.5, 0.0, BEGUN, 24.0, SPEED_MPS, ACCEL_MPS2), 0.6, 1e-3
    heading = 0.0
    for step in range(round(turn.duration_s / step_s)):
        instant = BEGUN + round(step * step_s * NANOSECONDS)
        assert heading == pytest.approx(turn.setpoint(instant, 0.0)[0], abs=2e-3)
        heading += step_s * (turn.setpoint(instant, tau_s)[0] - heading) / tau_s


@pytest.mark.parametrize("tau_s", [0.0, 0.6])
def test_the_rate_of_the_setpoint_is_its_derivative(tau_s):
    """Followers lead the positions of their slots by it."""
    turn, step = TurnOnSpot.to(1.5, 0.0, BEGUN, 24.0, SPEED_MPS, ACCEL_MPS2), 1e-4
    for share in (0.1, 0.3, 0.5, 0.7, 0.9):
        before, after = at(turn, share - step, tau_s), at(turn, share + step, tau_s)
        derivative = (after[0] - before[0]) / (2 * step * turn.duration_s)
        assert at(turn, share, tau_s)[1] == pytest.approx(derivative, abs=1e-4)

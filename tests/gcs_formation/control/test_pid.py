"""The PID's parts: its derivative filter, its integral, its anti-windup."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs_formation.control.fuzzy_pid import Gains, PidState, filter_rate, integrate, unlimited

DT_S = 0.1


def test_the_filtered_rate_becomes_the_slope() -> None:
    state, slope = PidState.at_rest((1,)), np.array([2.5])
    for _ in range(200):
        state = PidState(state.integral, filter_rate(state, slope, 0.3, DT_S))
    assert state.rate == pytest.approx(slope, rel=1e-9)


def test_the_filter_is_exact_for_a_constant_slope() -> None:
    """After a time t of slope m from rest, 1/(Ts+1) gives m (1 - exp(-t/T)), whatever the sampling."""
    for dt_s in (0.02, 0.1, 0.5):
        state = PidState.at_rest((1,))
        for _ in range(round(1.0 / dt_s)):
            state = PidState(state.integral, filter_rate(state, np.array([3.0]), 0.4, dt_s))
        assert state.rate == pytest.approx([3.0 * (1 - np.exp(-1.0 / 0.4))], rel=1e-12)


def test_a_change_of_gain_does_not_kick_the_integral_part() -> None:
    error, rate = np.array([0.0]), np.array([0.0])
    state = PidState(np.array([4.0]), rate)
    outputs = [unlimited(state, Gains(np.ones(1), np.array([k_i]), np.ones(1)), error, rate) for k_i in (0.1, 5.0)]
    assert outputs[0] == outputs[1] == 4.0


def test_back_calculation_holds_the_integral_at_the_limit() -> None:
    gains, state = Gains(np.ones(1), np.ones(1), np.zeros(1)), PidState.at_rest((1,))
    error, most = np.array([10.0]), 1.0
    for _ in range(2000):
        output = unlimited(state, gains, error, np.zeros(1))
        state = integrate(state, gains, error, np.zeros(1), np.clip(output, -most, most) - output, 1.0, DT_S)
    # At rest k_i e = (output - limit) / T, so output = limit + T k_i e.
    assert unlimited(state, gains, error, np.zeros(1)) == pytest.approx([most + 10.0])


SMALLEST_AND_LARGE = st.sampled_from((0.0, 1e-9, 1e-3, 0.1, 1.0, 10.0))


@given(kp=SMALLEST_AND_LARGE, ki=SMALLEST_AND_LARGE, kd=SMALLEST_AND_LARGE, windup_s=st.sampled_from((0.1, 1.0, 100.0)))
def test_a_limit_leaves_nothing_in_the_integral_that_the_error_did_not_put_there(
    kp: float, ki: float, kd: float, windup_s: float
) -> None:
    """For 10 s an error of 8 drives the output beyond a limit of 6, then it is gone.

    What the integral holds then has the error's sign, and is no more than the gain can have gathered: at a gain of 0
    nothing. So the output is back where it was before the limit.
    """
    gains, state = Gains(*(np.array([gain]) for gain in (kp, ki, kd))), PidState.at_rest((1,))
    gathered = 0.0
    for k in range(200):
        error = np.array([8.0 if k < 100 else 0.0])
        rate = filter_rate(state, np.array([-80.0 if k == 100 else 0.0]), 0.1, DT_S)
        output = unlimited(state, gains, error, rate)
        state = integrate(state, gains, error, rate, np.clip(output, -6.0, 6.0) - output, windup_s, DT_S)
        gathered += ki * error[0] * DT_S
        assert -1e-9 <= state.integral[0] <= gathered + 1e-9
    assert ki > 0.0 or unlimited(state, gains, np.zeros(1), np.zeros(1)) == 0.0


@pytest.mark.parametrize(
    ("held", "excess", "left"), [(3.0, -9.0, 0.0), (3.0, -2.0, 1.0), (-3.0, 9.0, 0.0), (3.0, 9.0, 3.0)]
)
def test_a_limit_takes_from_the_integral_what_is_there_and_no_more(held: float, excess: float, left: float) -> None:
    gains, none = Gains(*np.zeros((3, 1))), np.zeros(1)
    state = integrate(PidState(np.array([held]), none), gains, none, none, np.array([excess]), 1.0, 1.0)
    assert state.integral == pytest.approx([left])

"""The PID's parts: its derivative filter, its integral, its anti-windup."""

import numpy as np
import pytest

from gcs_formation.control.pid import Gains, PidState, filter_rate, integrate, unlimited

DT_S = 0.1


def test_the_filtered_rate_of_a_ramp_becomes_its_slope() -> None:
    state, slope = PidState.at_rest((1,)), 2.5
    for k in range(200):
        error = np.array([slope * k * DT_S])
        rate = filter_rate(state, error, 0.3, DT_S)
        state = PidState(state.integral, rate, error)
    assert state.rate == pytest.approx([slope], rel=1e-9)


def test_the_filter_is_exact_for_straight_pieces() -> None:
    """After a time t of slope m from rest, s/(Ts+1) gives m (1 - exp(-t/T)), whatever the sampling."""
    for dt_s in (0.02, 0.1, 0.5):
        state = PidState(np.zeros(1), np.zeros(1), np.zeros(1))
        for k in range(1, round(1.0 / dt_s) + 1):
            error = np.array([3.0 * k * dt_s])
            state = PidState(state.integral, filter_rate(state, error, 0.4, dt_s), error)
        assert state.rate == pytest.approx([3.0 * (1 - np.exp(-1.0 / 0.4))], rel=1e-12)


def test_the_first_sample_has_no_rate() -> None:
    assert filter_rate(PidState.at_rest((2, 3)), np.ones((2, 3)), 0.1, DT_S) == pytest.approx(np.zeros((2, 3)))


def test_a_change_of_gain_does_not_kick_the_integral_part() -> None:
    error, rate = np.array([0.0]), np.array([0.0])
    state = PidState(np.array([4.0]), rate, error)
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

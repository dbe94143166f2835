"""Delay margins of the PID loops: golden values, and the boundary in the time domain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from formation_scenario.vehicles import VehicleModel
from gcs_formation.control.fuzzy_pid import FIXED_GAINS, GainRange, PidGains
from gcs_formation.control.setpoint import Mixer
from gcs_formation.stability import loop_delay_s
from gcs_formation.stability.mismatch import carried, predicted_mismatch_margin
from gcs_formation.stability.pid_margins import (
    MID_RANGE,
    SMALL_SIGNAL,
    Loop,
    Plant,
    Rational,
    delay_margin,
    delay_margins,
    forward_plant,
    height_plant,
    loop_margin,
    right_plant,
    worst_loop_margin,
)

MIXER = Mixer(k_v=0.1, k_x=1.0, k_psi=0.1, k_y=0.05, k_z=1.0)
MODEL = VehicleModel(tau_v_s=4.0, tau_psi_s=1.5, tau_ha_s=1.0, tau_hb_s=3.0)
RANGE = GainRange(base=0.7, span=0.6)
CHANNELS = {
    "x": (PidGains(3.0, 0.8, 6.5), forward_plant(MIXER, MODEL)),
    "y": (PidGains(1.0, 0.6, 0.1), right_plant(MIXER, MODEL, 22.0, x_rc_m=60.0)),
    "y in the leader's frame": (PidGains(1.2, 0.5, 1.8), right_plant(MIXER, MODEL, 22.0)),
    "z": (PidGains(2.0, 0.4, 4.0), height_plant(MIXER, MODEL)),
}


@pytest.mark.parametrize(
    ("channel", "outputs", "margin_s", "tolerance_s"),
    [
        ("x", MID_RANGE, 0.862581, 5e-7),
        ("y", MID_RANGE, 0.779763, 5e-7),
        ("z", MID_RANGE, 2.326, 5e-4),
        ("x", SMALL_SIGNAL, 0.8688, 5e-5),
        ("y", SMALL_SIGNAL, 0.7349, 5e-5),
        ("y in the leader's frame", MID_RANGE, 1.226, 5e-4),
        ("y in the leader's frame", SMALL_SIGNAL, 1.252, 5e-4),
    ],
)
def test_golden_margins(channel, outputs, margin_s, tolerance_s):
    assert loop_margin(*CHANNELS[channel], RANGE, outputs) == pytest.approx(margin_s, abs=tolerance_s)


@pytest.mark.parametrize(
    ("channel", "margin_s", "tolerance_s"),
    [("x", 0.669, 5e-4), ("y", 0.584744, 5e-7), ("y in the leader's frame", 0.892, 5e-4)],
)
def test_golden_worst_margins_over_the_fuzzy_range(channel, margin_s, tolerance_s):
    assert worst_loop_margin(*CHANNELS[channel], RANGE) == pytest.approx(margin_s, abs=tolerance_s)


outputs_in_range = st.tuples(*[st.floats(0.0, 1.0)] * 3)


@pytest.mark.parametrize("channel", CHANNELS)
@given(outputs=outputs_in_range)
@settings(max_examples=50, deadline=None)
def test_no_gain_in_the_range_has_less_than_the_worst_margin(channel, outputs):
    worst = worst_loop_margin(*CHANNELS[channel], RANGE)
    assert loop_margin(*CHANNELS[channel], RANGE, outputs) >= worst - 1e-9


@pytest.mark.parametrize("channel", CHANNELS)
def test_nominal_gains_are_the_middle_of_the_range(channel):
    assert worst_loop_margin(*CHANNELS[channel], FIXED_GAINS) == loop_margin(*CHANNELS[channel], FIXED_GAINS)
    assert loop_margin(*CHANNELS[channel], RANGE, MID_RANGE) == pytest.approx(
        loop_margin(*CHANNELS[channel], FIXED_GAINS), rel=1e-9
    )


def test_margin_of_an_integrator_is_a_quarter_period():
    """L = k/s: crossover at k, with a quarter turn of phase left."""
    lag_free = Loop(
        PidGains(2.0, 0.0, 0.0), right_plant(Mixer(0, 0, 0, 1.0, 0), VehicleModel.model_construct(tau_psi_s=1e-9), 1.0)
    )
    assert delay_margin(lag_free.open_loop()) == pytest.approx(np.pi / 4.0, abs=1e-8)


def test_open_loop_that_is_stable_stands_any_delay():
    off = PidGains(0.0, 0.0, 0.0)
    assert loop_margin(off, height_plant(MIXER, MODEL)) == np.inf
    assert loop_margin(off, forward_plant(MIXER, MODEL)) == 0.0  # no loop holds the position


def test_slot_ahead_of_the_leader_is_unstable_in_the_followers_frame():
    gains, _ = CHANNELS["y"]
    assert loop_margin(gains, right_plant(MIXER, MODEL, 22.0, x_rc_m=-30.0)) <= 0.0


def test_followers_frame_gains_are_unstable_somewhere_in_the_leaders_frame():
    gains, _ = CHANNELS["y"]
    assert worst_loop_margin(gains, right_plant(MIXER, MODEL, 22.0), RANGE) < 0.0


def test_unfiltered_derivative_of_a_proper_loop():
    """High-frequency gain kd k_v/tau_v: below 1 some delay is tolerated, above 1 none is."""
    plant = forward_plant(MIXER, MODEL)
    limit = MODEL.tau_v_s / MIXER.k_v
    assert loop_margin(PidGains(3.0, 0.8, 0.9 * limit, filter_s=0.0), plant) > 0.0
    assert loop_margin(PidGains(3.0, 0.8, 1.1 * limit, filter_s=0.0), plant) == 0.0


def test_margins_of_many_loops_are_those_of_each():
    """Loops of every degree, in mixed order; the last has no filter, and its margin is 0 at high frequency."""
    pids = PidGains(3.0, 0.8, 6.5), PidGains(3.0, 0.0, 6.5), PidGains(0.0, 0.0, 0.0), PidGains(3.0, 0.8, 99.0, 0.0)
    loops = [Loop(pid, plant).open_loop() for pid in pids for _, plant in CHANNELS.values()]
    assert delay_margins(loops) == [delay_margin(loop) for loop in loops]
    assert len(set(delay_margins(loops))) > len(pids)


def test_loop_delay_counts_sampling_and_hold():
    assert loop_delay_s(0.3, 0.31, 10.0, 10.0) == pytest.approx(0.71)


def simulate(loop: Loop, delay_s: float, predicted_s: float, duration_s: float = 80.0) -> float:
    """Return the growth of the loop's response: its peak over the last fifth divided by that over the second fifth.

    The PID acts on the state predicted `predicted_s` ahead by a discrete convolution of the setpoints sent.
    """
    step = 0.01
    steps, late, ahead = round(duration_s / step), round(delay_s / step), round(predicted_s / step)
    state, drive, output = (np.array(part) for part in loop.plant)
    exact = expm(np.block([[state, drive[:, None]], [np.zeros((1, 3))]]) * step)
    advance, push = exact[:2, :2], exact[:2, 2]
    kernel = np.array([np.linalg.matrix_power(advance, age) @ push for age in range(ahead)]).reshape(ahead, 2)
    carry = np.linalg.matrix_power(advance, ahead)
    setpoints = np.zeros(steps + ahead)  # newest last; padded with the zeros before the start
    states = np.zeros((steps + 1, 2))
    states[0] = 1.0, -1.0
    pid, integral, slow = loop.pid, 0.0, 0.0
    for now in range(steps):
        sent = setpoints[now : now + ahead][::-1]
        seen = carry @ states[max(now - late, 0)] * (now >= late) + sent @ kernel
        error = -float(output @ seen)
        integral += pid.ki * error * step
        rate = (error - slow) / pid.filter_s
        slow += rate * step
        setpoints[now + ahead] = pid.kp * error + integral + pid.kd * rate
        applied = setpoints[now + ahead]
        states[now + 1] = advance @ states[now] + push * applied
    size = np.abs(states @ output)
    fifth = steps // 5
    return float(size[-fifth:].max() / size[fifth : 2 * fifth].max())


@pytest.mark.parametrize("channel", CHANNELS)
def test_loop_decays_below_its_margin_and_grows_above(channel):
    gains, plant = CHANNELS[channel]
    margin = loop_margin(gains, plant)
    assert simulate(Loop(gains, plant), 0.93 * margin, 0.0) < 1.0
    assert simulate(Loop(gains, plant), 1.07 * margin, 0.0) > 1.0


@pytest.mark.parametrize("channel", CHANNELS)
def test_without_prediction_the_mismatch_margin_is_the_delay_margin(channel):
    gains, plant = CHANNELS[channel]
    assert predicted_mismatch_margin(Loop(gains, plant), 0.0).longer_s == pytest.approx(
        loop_margin(gains, plant), rel=1e-9
    )


@pytest.mark.parametrize(
    ("channel", "nominal_s"), [("x", 0.6), ("x", 1.5), ("y", 0.6), ("y in the leader's frame", 0.6)]
)
def test_predicted_loop_stands_its_nominal_delay_and_mismatch_up_to_the_margin(channel, nominal_s):
    loop = Loop(*CHANNELS[channel])
    margin = predicted_mismatch_margin(loop, nominal_s)
    shorter = max(margin.shorter_s, -nominal_s)
    assert simulate(loop, nominal_s, nominal_s) < 0.5
    assert simulate(loop, nominal_s + 0.75 * margin.longer_s, nominal_s) < 1.0
    assert simulate(loop, nominal_s + 0.75 * shorter, nominal_s) < 1.0
    assert simulate(loop, nominal_s + 1.3 * margin.longer_s, nominal_s) > 1.0
    if np.isfinite(margin.shorter_s):
        assert simulate(loop, nominal_s + 1.3 * margin.shorter_s, nominal_s) > 1.0


def test_prediction_trades_margin_against_mismatch_for_the_longer_delay():
    """The x loop tolerates 0.86 s without prediction; with prediction over 1.5 s it tolerates that delay, ± 52 ms."""
    loop = Loop(*CHANNELS["x"])
    assert predicted_mismatch_margin(loop, 0.6).min_s() == pytest.approx(0.13787, abs=1e-5)
    assert predicted_mismatch_margin(loop, 1.5).min_s() == pytest.approx(0.05158, abs=1e-5)
    late = replace(loop, dead_time_s=0.9)
    assert predicted_mismatch_margin(late, 0.6).min_s() == pytest.approx(0.05158, abs=1e-5), "both are predicted over"


def test_prediction_saves_no_loop_that_is_unstable_without_delay():
    gains, _ = CHANNELS["y"]
    assert predicted_mismatch_margin(Loop(gains, right_plant(MIXER, MODEL, 22.0, -30.0)), 0.3) == (
        0.0,
        0.0,
    )


@pytest.mark.parametrize(("gain", "margin_s"), [(0.99, np.inf), (1.0, 0.0), (-1.0, 0.0), (1.01, 0.0)])
def test_a_gain_of_1_at_high_frequency_leaves_no_margin(gain: float, margin_s: float) -> None:
    """gain s / (s + 2): below 1 there is no crossover, and from 1 on any delay destabilises."""
    assert delay_margin(Rational(np.array([gain, 0.0]), np.array([1.0, 2.0]))) == margin_s


@pytest.mark.parametrize("state", [((0.0, 1.0), (0.0, -0.5)), ((-1.0, 3.0), (-2.0, 0.4)), ((-0.5, 1.0), (0.0, -0.5))])
def test_a_state_is_carried_by_the_matrix_exponential(state: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """With two real poles, a pair, and a double one; scipy's expm is the peer."""
    plant = Plant(state, (0.0, 1.0), (0.7 + 0.2j, -1.3 + 0.0j))
    peer = np.array(plant.output) @ expm(np.array(state) * 0.8)
    np.testing.assert_allclose(carried(plant, 0.8), peer, rtol=1e-12)

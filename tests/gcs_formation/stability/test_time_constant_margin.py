"""Lags that differ from those of the model that a loop predicts by."""

import math

import numpy as np
import pytest

from formation_scenario.vehicles import VehicleModel
from gcs_formation.control.fuzzy_pid import PidGains
from gcs_formation.control.setpoint import Mixer
from gcs_formation.stability.mismatch import (
    MAXIMUM,
    LoopDelay,
    Usage,
    mismatch_margin_with_taus_off,
    predicted_are_stable,
    predicted_mismatch_margin,
    tau_margin,
)
from gcs_formation.stability.pid_margins import Loop, forward_plant, height_plant, right_plant

MIXER, MODEL = Mixer(k_v=0.1, k_x=1.0, k_psi=0.1, k_y=0.05, k_z=1.0), VehicleModel()
X = Loop(PidGains(3.0, 1.04, 6.5), forward_plant(MIXER, MODEL))
Y = Loop(PidGains(1.2, 0.65, 1.8), right_plant(MIXER, MODEL, 22.0))
Z = Loop(PidGains(2.0, 0.52, 4.0), height_plant(MIXER, MODEL))


def grows(loop, true, delay_s, dt_s=0.01, seconds=40.0):
    """Return whether the predicted loop's error grows, flown step by step with model and autopilot side by side."""
    (a, b), c = (np.array(each) for each in loop.plant[:2]), np.array(loop.plant.output)
    true_a, true_b = (np.array(each) for each in true.plant[:2])
    late, kept = round(delay_s / dt_s), np.eye(2)
    for _ in range(late):
        kept = kept + dt_s * a @ kept
    steps = round(seconds / dt_s)
    flown, model = np.zeros((steps + 1, 2)), np.zeros((steps + 1, 2))
    integral, filtered, errors = 0.0, 0.0, np.zeros(steps)
    for k in range(steps):
        ago = max(0, k - late)
        predicted = model[k] + kept @ (flown[ago] - model[ago])
        errors[k] = error = (1.0 if k < 100 else 0.0) - float((c @ predicted).real)
        rate = (error - filtered) / loop.pid.filter_s
        filtered, integral = filtered + dt_s * rate, integral + dt_s * error
        reported = loop.pid.kp * error + loop.pid.ki * integral + loop.pid.kd * rate
        flown[k + 1] = flown[k] + dt_s * (true_a @ flown[k] + true_b * reported)
        model[k + 1] = model[k] + dt_s * (a @ model[k] + b * reported)
    early, end = (np.abs(errors[part]).max() for part in (slice(200, steps // 2), slice(3 * steps // 4, steps)))
    return bool(end > early)


@pytest.mark.parametrize("loop", [X, Y], ids="xy")
def test_a_loop_flown_with_time_constants_inside_its_margin_dies_out_and_beyond_it_grows(loop):
    margin = tau_margin(loop, 1.1)
    assert 0.2 < margin < MAXIMUM
    options = (-1.0, 1.0)
    assert not any(grows(loop, loop.with_time_constants(1.0 + 0.9 * margin * way), 1.1) for way in options)
    assert any(grows(loop, loop.with_time_constants(1.0 + 1.1 * margin * way), 1.1) for way in options)


@pytest.mark.parametrize("loop", [X, Y, Z], ids="xyz")
def test_at_the_margin_no_mismatch_of_the_delay_is_left(loop):
    """The number of roots and the crossings of the imaginary axis are computed in different ways."""
    margin = tau_margin(loop, 0.7)
    assert mismatch_margin_with_taus_off(loop, 0.7, 0.99 * margin) < 0.4 * predicted_mismatch_margin(loop, 0.7).min_s()
    assert mismatch_margin_with_taus_off(loop, 0.7, 1.05 * margin) == 0.0
    assert mismatch_margin_with_taus_off(loop, 0.7, 0.0) == pytest.approx(predicted_mismatch_margin(loop, 0.7).min_s())


def test_with_the_right_time_constants_the_predicted_loop_is_stable_at_any_delay_and_an_unstable_one_never():
    unstable = Loop(PidGains(-1.0, 0.0, 0.0), X.plant)
    assert predicted_are_stable(X, [X], 2.0) == [True]
    assert predicted_are_stable(unstable, [unstable], 0.0) == [False]
    assert tau_margin(unstable, 0.5) == 0.0


def test_longer_time_constants_are_the_plant_of_the_longer_time_constants():
    longer = VehicleModel(tau_v_s=6.0, tau_ha_s=1.5, tau_hb_s=2.0)
    assert np.allclose(
        forward_plant(MIXER, MODEL).with_time_constants(1.5).transfer()[1], forward_plant(MIXER, longer).transfer()[1]
    )
    ours, theirs = height_plant(MIXER, MODEL).with_time_constants(1.5, 2.0 / 3.0), height_plant(MIXER, longer)
    assert sorted(np.roots(ours.transfer()[1])) == pytest.approx(sorted(np.roots(theirs.transfer()[1])))


def test_a_loop_without_prediction_does_not_go_by_a_model_and_small_differences_count_as_none():
    delay = LoopDelay(1.1, 0.0)
    predicted = Usage([X], predicted=True)
    assert predicted.of_time_constants(delay, 0.3) == pytest.approx(0.3 / tau_margin(X, 1.1))
    assert predicted.of_time_constants(delay, 0.05) == pytest.approx(0.05 / tau_margin(X, 1.1))
    assert predicted.of_time_constants(delay, 0.04) == predicted.of_time_constants(LoopDelay(math.nan, 0.0), 0.3) == 0.0
    assert Usage([X], predicted=False).of_time_constants(delay, 0.3) == 0.0


def test_time_constants_are_reckoned_with_up_to_30_percent_off() -> None:
    thirty = mismatch_margin_with_taus_off(X, 0.6, 0.3)
    assert mismatch_margin_with_taus_off(X, 0.6) == thirty
    assert 0.0 < thirty < mismatch_margin_with_taus_off(X, 0.6, 0.0)

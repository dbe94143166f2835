"""Which errors are a limit cycle, and what a vehicle's answer shows of its dead time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from gcs_formation.features.limit_cycle.answer import KEPT, Answer
from gcs_formation.features.limit_cycle.swings import SWINGS, Swings

DT_S = 0.1
TIMES_S = np.arange(0.0, 120.0, DT_S)
PERIOD_S = 9.8


def steady_at(errors_m) -> list[float]:
    """Return the times at which an error counts as a limit cycle."""
    swings, found = Swings(), list[float]()
    for place, error_m in enumerate(np.asarray(errors_m).tolist()):
        swings.add(place * DT_S, error_m)
        if swings.steady(place * DT_S, still=bool(found)):
            found.append(place * DT_S)
    return found


def sine(amplitude_m) -> np.ndarray:
    return amplitude_m * np.sin(2.0 * np.pi * TIMES_S / PERIOD_S)


@pytest.mark.parametrize("offset_m", [0.0, 3.0])
def test_a_steady_swing_is_named_after_five_periods_with_its_amplitude_and_period(offset_m):
    first_s = steady_at(sine(4.5) + offset_m)[0]
    assert first_s == pytest.approx((SWINGS / 2.0 + 0.5) * PERIOD_S, abs=0.2 * PERIOD_S)
    swings = Swings()
    for time_s, error_m in zip(TIMES_S.tolist(), sine(4.5).tolist(), strict=True):
        swings.add(time_s, error_m + offset_m)
    assert (swings.amplitude_m, swings.period_s) == pytest.approx((4.5, PERIOD_S), rel=0.02)


def test_noise_of_telemetry_hides_none():
    noise_m = 0.3 * np.random.default_rng(1).standard_normal(TIMES_S.size)
    assert steady_at(sine(4.5) + noise_m)


@pytest.mark.parametrize(
    "errors_m",
    [
        sine(0.9),
        sine(8.0) * np.exp(-TIMES_S / 40.0),
        sine(0.1) * np.exp(TIMES_S / 20.0),
        5.0 * np.exp(-(TIMES_S % 30.0) / 5.0),
        np.full(TIMES_S.size, 6.0),
    ],
)
def test_what_is_small_or_dies_out_or_grows_or_comes_with_turns_is_no_limit_cycle(errors_m):
    assert steady_at(errors_m) == []


@pytest.mark.parametrize("damping", [1.0, 0.5, 0.25])
def test_what_gusts_do_to_a_damped_loop_is_none_in_a_thousand_seconds(damping):
    root = math.tau / 10.0 * complex(-damping, math.sqrt(1.0 - damping**2)) * DT_S
    poles = [1.0, -2.0 * np.exp(root).real, abs(np.exp(root)) ** 2]
    errors_m = lfilter([1.0], poles, np.random.default_rng(2).standard_normal(10000))
    assert steady_at(3.0 * errors_m / errors_m.std()) == []


def test_it_ends_when_the_swings_do_and_what_is_forgotten_begins_again():
    ends_s = TIMES_S[-1]
    found = steady_at(np.concatenate((sine(4.5), np.zeros(TIMES_S.size))))
    assert ends_s < found[-1] < ends_s + PERIOD_S
    swings = Swings()
    for time_s, error_m in zip(TIMES_S.tolist(), sine(4.5).tolist(), strict=True):
        swings.add(time_s, error_m)
    assert swings.steady(ends_s, still=False)
    swings.clear()
    assert not swings.steady(ends_s, still=True)


@pytest.mark.parametrize("dead_s", [0.0, 0.4, 1.1])
@pytest.mark.parametrize("turn_radps", [0.0, 0.1])
def test_an_answer_beyond_the_models_time_constant_is_its_dead_time(dead_s, turn_radps):
    """A first-order lag turns the phase of a swing by atan(w tau) and shrinks it; a steady turn adds a line."""
    tau_s, radps, answer = 1.5, math.tau / PERIOD_S, Answer()
    lag_rad, share = math.atan(radps * tau_s), math.cos(math.atan(radps * tau_s))
    for time_s in TIMES_S.tolist():
        asked = 0.3 * math.sin(radps * time_s) + turn_radps * time_s
        seen_s = time_s - 0.35
        flown = 0.3 * share * math.sin(radps * (seen_s - dead_s) - lag_rad) + turn_radps * (seen_s - dead_s - tau_s)
        answer.add(time_s, math.remainder(asked, math.tau), seen_s, flown)
    assert answer.late_s(PERIOD_S, tau_s) == pytest.approx(dead_s, abs=0.03)


def test_too_little_says_nothing():
    answer = Answer()
    assert math.isnan(answer.late_s(PERIOD_S, 1.5))
    answer.add(0.0, 0.0, 0.0, 0.0)
    assert math.isnan(answer.late_s(PERIOD_S, 1.5))


@pytest.mark.parametrize("before", [1, 700, KEPT, 2 * KEPT + 5])
def test_only_the_newest_of_an_answer_count_whatever_was_before(before):
    """Until then, it was 0.8 s later; and the newest begin anywhere in what is kept."""
    answer, newest, radps = Answer(), Answer(), math.tau / PERIOD_S
    for tick in range(before + KEPT):
        time_s = 0.05 * tick
        late_s = 0.2 if tick >= before else 1.0
        row = (time_s, math.sin(radps * time_s), time_s, math.sin(radps * (time_s - late_s)))
        answer.add(*row)
        if tick >= before:
            newest.add(*row)
    assert answer.late_s(PERIOD_S, 0.0) == newest.late_s(PERIOD_S, 0.0) == pytest.approx(0.2)

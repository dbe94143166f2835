"""How rough the air is: turbulence counts, a single gust and a steady wind don't."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcs_formation.guidance.rough_air import RoughAir

DT_S = 0.1


def after(north_mps: list[float]) -> RoughAir:
    air = RoughAir(DT_S)
    for each in north_mps:
        air.observe(each, 3.0)
    return air


def turbulence(sigma_mps: float, seconds: float, seed: int = 1) -> list[float]:
    """Return Dryden's spectrum across at 200 m and 22 m/s: a time constant of 13.6 s, MIL-F-8785C."""
    tau_s, draws, state, each = 13.6, np.random.default_rng(seed), np.zeros(2), list[float]()
    for _ in range(round(seconds / DT_S)):
        noise = sigma_mps * math.sqrt(tau_s / DT_S) * draws.standard_normal()
        state += DT_S / tau_s * np.array([noise - state[0], state[0] - state[1]])
        each.append(float(state[1] + math.sqrt(3.0) * (state[0] - state[1])))
    return each


def test_turbulence_of_a_wind_of_seven_metres_a_second_is_rough() -> None:
    assert after(turbulence(0.8, 120.0)).share == 1.0


def test_a_gust_of_any_size_and_a_wind_that_turns_in_a_minute_are_not() -> None:
    assert after([0.0] * 600 + [0.85] * 20).share == 0.0
    assert after([0.0] * 600 + [5.0] * 600).share == 0.0
    assert after([2.0 * math.sin(DT_S * each / 60.0) for each in range(1200)]).share == 0.0


def test_another_vehicles_wind_is_no_gust() -> None:
    air = after([0.0] * 10)
    air.drop_state()
    air.observe(8.0, 0.0)
    assert air.changes_mps == 0.0


@pytest.mark.parametrize("calm_s", [20.0, 120.0])
def test_it_is_over_after_a_few_minutes(calm_s: float) -> None:
    air = after([*turbulence(0.8, 120.0), *[0.0] * round(calm_s / DT_S)])
    assert (air.share == 0.0) == (calm_s > 100.0)

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


def growing(mps2: float, seconds: float, dt_s: float = DT_S, course_rad: float = 0.0) -> RoughAir:
    """Observe a wind that grows steadily, of which a second's worth counts as a fast change."""
    air = RoughAir(dt_s)
    for tick in range(round(seconds / dt_s)):
        size_mps = mps2 * tick * dt_s
        air.observe(3.0 + size_mps * math.cos(course_rad), -8.0 + size_mps * math.sin(course_rad))
    return air


@pytest.mark.parametrize(("mps2", "changes_mps"), [(0.06, 0.06), (0.12, 0.12), (0.4, 0.4), (0.6, 0.5), (-2.0, 0.5)])
def test_changes_of_up_to_half_a_metre_a_second_count_in_full(mps2: float, changes_mps: float) -> None:
    """The wind that is filtered at 1 rad/s lags one that grows by c m/s² by c m/s."""
    assert growing(mps2, 600.0).changes_mps == pytest.approx(changes_mps, rel=1e-3)


@pytest.mark.parametrize("course_rad", [0.3, 2.0, -1.8])
@pytest.mark.parametrize("dt_s", [0.05, 0.2])
def test_the_direction_of_a_change_and_the_rate_of_ticks_do_not_matter(course_rad: float, dt_s: float) -> None:
    assert growing(0.3, 40.0, dt_s, course_rad).changes_mps == pytest.approx(growing(0.3, 40.0).changes_mps, rel=0.01)


def test_what_a_minute_remembers_fades_by_an_e_th_in_a_minute() -> None:
    """From when the filtered wind lags by all of it, which takes it seconds."""
    early_mps, later_mps = (0.12 - growing(0.12, seconds).changes_mps for seconds in (20.0, 80.0))
    assert later_mps / early_mps == pytest.approx(1.0 / math.e, rel=2e-3)


@pytest.mark.parametrize(("mps2", "share"), [(0.07, 0.0), (0.1, 0.25), (0.12, 0.5), (0.15, 0.875), (0.17, 1.0)])
def test_between_calm_and_rough_air_the_share_grows_with_the_changes(mps2: float, share: float) -> None:
    """From 0.08 to 0.16 m/s."""
    assert growing(mps2, 600.0).share == pytest.approx(share, abs=1e-3)


def test_with_ticks_of_minutes_only_the_last_change_counts() -> None:
    air = RoughAir(120.0)
    for north_mps, changes_mps in ((3.0, 0.0), (3.3, 0.3), (3.3, 0.0), (3.1, 0.2)):
        air.observe(north_mps, 1.0)
        assert air.changes_mps == pytest.approx(changes_mps)

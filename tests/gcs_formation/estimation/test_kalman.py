"""The filter's steps on covariances of any correlation, against matrix algebra."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from flight_model.arrays import Array
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from gcs_formation.estimation.kalman import (
    HeightCovariance,
    Level,
    LevelCovariance,
    VelocityJacobian,
    correct_height,
    correct_level,
    innovation,
    innovation_variances,
    minus,
)
from gcs_formation.estimation.noise_and_plausibility import Values

LEVEL, HEIGHT = [0, 1, 4, 5, 6, 7], [2, 3]
"""Rows of the states in their usual order: north, east, height, climb, airspeed, heading, wind north and east."""

seeds = st.integers(0, 2**32 - 1)
headings = st.floats(-math.pi, math.pi)
speeds = st.floats(1.0, 40.0)
taus = st.floats(0.3, 5.0)


def six(row: Array) -> Level:
    a, b, c, d, e, f = row.tolist()
    return a, b, c, d, e, f


def eight(row: Array) -> Values:
    a, b, c, d, e, f, g, h = row.tolist()
    return a, b, c, d, e, f, g, h


def spread(random: np.random.Generator, size: int) -> Array:
    """Return a covariance with any correlations."""
    root = random.standard_normal((size, size))
    return root @ root.T + 0.1 * np.eye(size)


def level_of(whole: Array) -> LevelCovariance:
    level = LevelCovariance((0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    level.north, level.east, level.speed, level.heading, level.wind_north, level.wind_east = map(six, whole)
    return level


def height_of(whole: Array) -> HeightCovariance:
    height = HeightCovariance(whole[0, 0], whole[1, 1])
    height.cross = whole[0, 1]
    return height


def table(level: LevelCovariance) -> Array:
    return np.array((level.north, level.east, level.speed, level.heading, level.wind_north, level.wind_east))


def height_table(height: HeightCovariance) -> Array:
    return np.array(((height.height, height.cross), (height.cross, height.climb)))


def at(state: FlightState) -> VelocityJacobian:
    jacobian = VelocityJacobian()
    jacobian.linearise(state)
    return jacobian


def flying(speed_mps: float, heading_rad: float) -> FlightState:
    return FlightState(3.0, -4.0, 100.0, 0.5, speed_mps, heading_rad, 1.5, -2.5)


@given(seeds, speeds, headings, st.floats(0.02, 1.0), taus, taus)
@settings(max_examples=20)
def test_a_prediction_is_the_matrix_exponential_of_the_linear_model(
    seed: int, speed_mps: float, heading_rad: float, elapsed_s: float, one_s: float, other_s: float
) -> None:
    """P' = F P F^T with F = exp(A t), model (7) for small changes; height's two time constants in either order."""
    model = AutopilotModel(other_s, one_s, one_s, other_s, 16.0, 28.0, 9.0, 9.0, 9.0)
    random, cos, sin = np.random.default_rng(seed), math.cos(heading_rad), math.sin(heading_rad)
    rates = np.zeros((6, 6))
    rates[0, 2:5] = cos, -speed_mps * sin, 1.0
    rates[1, [2, 3, 5]] = sin, speed_mps * cos, 1.0
    rates[2, 2], rates[3, 3] = -1.0 / other_s, -1.0 / one_s
    climbs = np.array(((0.0, 1.0), (-1.0 / (one_s * other_s), -1.0 / one_s - 1.0 / other_s)))
    whole, upright = spread(random, 6), spread(random, 2)
    level, height = level_of(whole), height_of(upright)
    level.predict(at(flying(speed_mps, heading_rad)), elapsed_s, model)
    height.predict(elapsed_s, model)
    moved, risen = expm(rates * elapsed_s), expm(climbs * elapsed_s)
    np.testing.assert_allclose(table(level), moved @ whole @ moved.T, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(height_table(height), risen @ upright @ risen.T, rtol=1e-8, atol=1e-9)


@given(seeds, speeds, headings)
@settings(max_examples=20)
def test_a_correction_is_the_one_by_all_eight_values_at_once(seed: int, speed_mps: float, heading_rad: float) -> None:
    """K = P H^T (H P H^T + R)^-1, then Joseph's form (Gelb, 1974, chapter 4)."""
    random, cos, sin = np.random.default_rng(seed), math.cos(heading_rad), math.sin(heading_rad)
    whole = np.zeros((8, 8))
    whole[np.ix_(LEVEL, LEVEL)], whole[np.ix_(HEIGHT, HEIGHT)] = spread(random, 6), spread(random, 2)
    rows = np.zeros((8, 8))
    rows[[0, 1, 2, 5, 6, 7], [0, 1, 2, 3, 4, 5]] = 1.0
    rows[3, 4:7] = cos, -speed_mps * sin, 1.0
    rows[4, [4, 5, 7]] = sin, speed_mps * cos, 1.0
    noise, off, jacobian = random.uniform(0.1, 2.0, 8), random.standard_normal(8), at(flying(speed_mps, heading_rad))
    level, height = level_of(whole[np.ix_(LEVEL, LEVEL)]), height_of(whole[np.ix_(HEIGHT, HEIGHT)])
    spreads = rows @ whole @ rows.T + np.diag(noise)
    np.testing.assert_allclose(innovation_variances(level, height, jacobian, eight(noise)), np.diag(spreads))
    gain = np.linalg.solve(spreads, rows @ whole).T
    kept = np.eye(8) - gain @ rows
    corrected, found = kept @ whole @ kept.T + gain @ np.diag(noise) @ gain.T, np.zeros(8)
    found[LEVEL] = correct_level(level, jacobian, eight(off), eight(noise))
    found[HEIGHT] = correct_height(height, eight(off), eight(noise))
    np.testing.assert_allclose(found, gain @ off, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(table(level), corrected[np.ix_(LEVEL, LEVEL)], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(height_table(height), corrected[np.ix_(HEIGHT, HEIGHT)], rtol=1e-6, atol=1e-8)


@given(speeds, headings, st.lists(st.floats(-3.0, 3.0), min_size=8, max_size=8))
@settings(max_examples=20)
def test_an_innovation_is_what_was_added_to_the_sample_expected_in_all_quadrants(
    speed_mps: float, heading_rad: float, off: list[float]
) -> None:
    """The expected one by the wind triangle; headings differ by less than half a turn across south too."""
    state, added = flying(speed_mps, heading_rad), np.array(off)
    exact = np.array((3.0, -4.0, 100.0, *state.ground_mps(), 0.5, speed_mps, heading_rad))
    found = innovation(eight(exact + added), state, at(state))
    assert found == pytest.approx(off, abs=1e-9)
    turned = innovation(eight(exact + added + np.array((0, 0, 0, 0, 0, 0, 0, math.tau))), state, at(state))
    assert turned == pytest.approx(off, abs=1e-9)
    assert minus(found, eight(added)) == pytest.approx([0.0] * 8, abs=1e-9)


def test_a_step_of_the_wind_at_an_unknown_time_moves_the_position_by_half_the_interval_on_average() -> None:
    """A time before now that is uniform in 0..0.6 s has a mean of 0.3 s and a mean square of 0.12 s²."""
    level = LevelCovariance((1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    np.testing.assert_array_equal(table(level), np.diag((1.0, 2.0, 3.0, 4.0, 5.0, 6.0)))
    level.gust(10.0, 0.6)
    grown = np.diag((1.0 + 1.2, 2.0 + 1.2, 3.0, 4.0, 5.0 + 10.0, 6.0 + 10.0))
    grown[0, 4] = grown[4, 0] = grown[1, 5] = grown[5, 1] = 3.0
    np.testing.assert_allclose(table(level), grown)


def test_noise_of_the_model_grows_with_time_and_correlates_nothing() -> None:
    whole = spread(np.random.default_rng(1), 6)
    level = level_of(whole)
    level.grow((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), 0.5)
    np.testing.assert_allclose(table(level) - whole, np.diag((0.5, 1.0, 1.5, 2.0, 2.5, 3.0)), atol=1e-12)


def test_samples_shrink_the_variance_of_what_stays_as_their_number() -> None:
    """After n samples of variance R a state without noise of its own has R / n: heading and height over no time."""
    level, height, state = LevelCovariance((1e6, 1e6, 1e6, 1e6, 0.0, 0.0)), HeightCovariance(1e6, 1e6), flying(1.0, 0.0)
    noise, nothing = eight(np.array((4.0, 9.0, 0.25, 1e9, 1e9, 0.36, 1.0, 0.01))), eight(np.zeros(8))
    for _ in range(25):
        correct_level(level, at(state), nothing, noise)
        correct_height(height, nothing, noise)
    found = level.north[0], level.east[1], level.speed[2], level.heading[3], height.height, height.climb
    assert found == pytest.approx((0.16, 0.36, 0.04, 0.0004, 0.01, 0.0144), rel=1e-5)

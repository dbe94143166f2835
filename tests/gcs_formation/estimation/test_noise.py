"""Telemetry noise estimated from the correlation of successive increments."""

import math
from typing import Any

import numpy as np
import pytest

from flight_model.arrays import Array
from gcs_formation.estimation.noise_and_plausibility import MAX_DRIFT, RESOLUTION, PositionDrift, VehicleNoise

SIGMA = np.array((0.3, 0.3, 0.1, 0.1, 0.3, 0.01))
ROW_OF = (0, 0, 1, 2, 2, 3, 4, 5)


def each_of_eight(value: float) -> Any:
    return (value,) * 8


def begun() -> VehicleNoise:
    return VehicleNoise(tuple(SIGMA.tolist()), tuple((SIGMA / 10.0).tolist()))


def test_the_estimate_is_the_mean_of_products_of_successive_increments() -> None:
    """-e_k e_(k-1), north and east together; over 20 samples at first and 100 later; increments count up to 2 sigma."""
    random, noise, before = np.random.default_rng(1), begun(), np.zeros(8)
    variance = SIGMA**2
    for number in range(150):
        rows, spread = variance[list(ROW_OF)], np.full(8, 0.04)
        bound = 2.0 * np.sqrt(spread + rows)
        increments = 1.2 * bound * random.uniform(-1.0, 1.0, 8)
        noise.adapt(tuple(increments.tolist()), tuple(spread.tolist()))
        clipped = np.clip(increments, -bound, bound)
        products = -clipped * before
        mean = np.array((products[:2].mean(), products[2], products[3:5].mean(), *products[5:]))
        variance = variance + (mean - variance) / min(number + 21.0, 100.0)
        variance = np.clip(variance, (SIGMA / 10.0) ** 2, np.array((30.0, 30.0, 5.0, 5.0, 10.0, 0.5)) ** 2)
        before = clipped
        np.testing.assert_allclose(noise.sigma(), np.sqrt(variance))
        np.testing.assert_allclose(noise.values, variance[list(ROW_OF)])
        judged = np.sqrt(variance) / SIGMA if number >= 99 else np.ones(6)
        np.testing.assert_allclose(noise.ratios(), judged)


def test_a_vehicle_that_begins_again_has_what_is_declared_and_the_others_keep_what_was_estimated() -> None:
    again, other = begun(), begun()
    for number in range(30):
        for each in (again, other):
            each.adapt(each_of_eight(0.2 * (-1) ** number), each_of_eight(1.0))
    estimated = other.sigma()
    again.initialise()
    np.testing.assert_allclose(again.sigma(), SIGMA)
    np.testing.assert_allclose(other.sigma(), estimated)
    for each in (again, other):
        each.adapt(each_of_eight(0.2), each_of_eight(1.0))
    np.testing.assert_allclose(again.sigma(), SIGMA * np.sqrt(20.0 / 21.0))


@pytest.mark.parametrize("stated", [True, False])
def test_noise_is_compared_with_what_is_stated_and_more_than_rounding(stated: bool) -> None:
    sigma = (0.003, 0.3, 0.003, 0.1, 0.3, 0.01)
    noise = VehicleNoise(sigma, sigma, stated=stated)
    for number in range(100):
        noise.adapt(each_of_eight(0.5 * (-1) ** number), each_of_eight(1.0))
    compared = np.flatnonzero(np.array(noise.ratios()) != 1.0)
    assert compared.tolist() == ([1, 3, 4, 5] if stated else [])


def test_what_is_exact_has_the_noise_of_its_rounding() -> None:
    """The standard deviation of an even distribution over 1e-7 degrees of latitude, or 1 cm/s, is its 12^-1/2th part.

    Heights are rounded to 1 mm; airspeeds and headings hardly.
    """
    position_m, velocity_mps = 1e-7 * 10_002e3 / 90.0 / math.sqrt(12.0), 0.01 / math.sqrt(12.0)
    assert RESOLUTION[[0, 2, 3]] == pytest.approx([position_m, velocity_mps, velocity_mps], rel=0.1)
    assert RESOLUTION[1] == pytest.approx(0.001)
    assert RESOLUTION[4:] == pytest.approx([1e-4, 2e-5])


def strayed(places: Array, velocities: Array, step_s: float, sigma: float, sigma_mps: float = 0.003) -> list[float]:
    """Return the learned straying of positions (n, 2) at each sample, m per square root of a second."""
    place, rate = sigma**2, sigma_mps**2
    drift, noise = PositionDrift(), (place, place, place, rate, rate, rate, rate, rate)
    found = list[float]()
    for (north, east), (north_mps, east_mps) in zip(places.tolist(), velocities.tolist(), strict=True):
        drift.adapt((north, east, 0.0, north_mps, east_mps, 0.0, 22.0, 0.0), step_s if found else 0.0, noise)
        found.append(math.sqrt(drift.variance))
    return found


@pytest.mark.parametrize("step_s", [0.1, 0.25])
@pytest.mark.parametrize("sigmas", [(0.003, 0.003), (0.3, 0.1), (0.003, 0.3)])
def test_noisy_positions_in_a_bend_do_not_stray(sigmas, step_s):
    """22 m/s and 0.3 rad/s: the mean of two velocities is 2.6 mm short of the way in 0.25 s, always inwards."""
    random, at = np.random.default_rng(2), 0.3 * step_s * np.arange(600)
    places = 22.0 / 0.3 * np.stack((np.sin(at), -np.cos(at)), axis=1)
    velocities = 22.0 * np.stack((np.cos(at), np.sin(at)), axis=1)
    place, velocity = (
        each + sigma * random.standard_normal(each.shape)
        for each, sigma in zip((places, velocities), sigmas, strict=True)
    )
    assert max(strayed(place, velocity, step_s, *sigmas)) == 0.0


def test_one_position_that_is_off_does_not_stray():
    places = np.zeros((300, 2))
    places[150] = 40.0
    assert max(strayed(places, np.zeros((300, 2)), 0.1, 0.003)) < 0.02


@pytest.mark.parametrize("walk", [0.02, 0.04, 0.2])
def test_positions_that_stray_are_followed_by_as_much_up_to_a_limit(walk):
    places = walk * math.sqrt(0.1) * np.cumsum(np.random.default_rng(3).standard_normal((3000, 2)), axis=0)
    found = np.array(strayed(places, np.zeros((3000, 2)), 0.1, 0.003))[300:]
    assert np.sqrt(np.mean(found**2)) == pytest.approx(min(walk, math.sqrt(MAX_DRIFT)), rel=0.25)
    assert found.max() <= math.sqrt(MAX_DRIFT)


def test_nothing_is_estimated_over_a_gap():
    places = np.cumsum(np.full((100, 2), 3.0), axis=0)
    assert max(strayed(places, np.zeros((100, 2)), 0.3, 0.003)) == 0.0

"""The noise of telemetry from what successive increments have in common."""

from typing import Any

import numpy as np
import pytest

from gcs_formation.estimation.noise import Declared, NoiseEstimate

SIGMA = np.array((0.3, 0.3, 0.1, 0.1, 0.3, 0.01))
ROW_OF = (0, 0, 1, 2, 2, 3, 4, 5)


def each_of_eight(value: float) -> Any:
    return (value,) * 8


def begun(columns: int = 1) -> NoiseEstimate:
    sigma = np.repeat(SIGMA[:, None], columns, axis=1)
    return NoiseEstimate(Declared(sigma, sigma / 10.0))


def test_the_estimate_is_the_mean_of_products_of_successive_increments() -> None:
    """-e_k e_(k-1), north and east together; over 20 samples at first and 100 later; increments count up to 2 sigma."""
    random, noise, before = np.random.default_rng(1), begun(), np.zeros(8)
    variance = SIGMA**2
    for number in range(150):
        rows, spread = variance[list(ROW_OF)], np.full(8, 0.04)
        bound = 2.0 * np.sqrt(spread + rows)
        increments = 1.2 * bound * random.uniform(-1.0, 1.0, 8)
        noise.each[0].learn(tuple(increments.tolist()), tuple(spread.tolist()))
        clipped = np.clip(increments, -bound, bound)
        products = -clipped * before
        mean = np.array((products[:2].mean(), products[2], products[3:5].mean(), *products[5:]))
        variance = variance + (mean - variance) / min(number + 21.0, 100.0)
        variance = np.clip(variance, (SIGMA / 10.0) ** 2, np.array((30.0, 30.0, 5.0, 5.0, 10.0, 0.5)) ** 2)
        before = clipped
        np.testing.assert_allclose(noise.sigma(0), np.sqrt(variance))
        np.testing.assert_allclose(noise.each[0].values, variance[list(ROW_OF)])
        judged = np.sqrt(variance) / SIGMA if number >= 99 else np.ones(6)
        np.testing.assert_allclose(noise.ratios(0), judged)


def test_a_vehicle_that_begins_again_has_what_is_declared_and_the_others_keep_what_was_learnt() -> None:
    noise = begun(2)
    for number in range(30):
        for each in noise.each:
            each.learn(each_of_eight(0.2 * (-1) ** number), each_of_eight(1.0))
    learnt = noise.sigma(1)
    noise.each[0].begin()
    np.testing.assert_allclose(noise.sigma(0), SIGMA)
    np.testing.assert_allclose(noise.sigma(1), learnt)
    for each in noise.each:
        each.learn(each_of_eight(0.2), each_of_eight(1.0))
    np.testing.assert_allclose(noise.sigma(0), SIGMA * np.sqrt(20.0 / 21.0))


@pytest.mark.parametrize("stated", [True, False])
def test_noise_is_compared_with_what_is_stated_and_more_than_rounding(stated: bool) -> None:
    sigma = np.array((0.003, 0.3, 0.003, 0.1, 0.3, 0.01))[:, None]
    noise = NoiseEstimate(Declared(sigma, sigma, np.array([stated])))
    for number in range(100):
        noise.each[0].learn(each_of_eight(0.5 * (-1) ** number), each_of_eight(1.0))
    compared = np.flatnonzero(np.array(noise.ratios(0)) != 1.0)
    assert compared.tolist() == ([1, 3, 4, 5] if stated else [])

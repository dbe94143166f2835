"""Roots between points of different signs."""

from __future__ import annotations

import numpy as np
from scipy.optimize import elementwise

from flight_model.arrays import Array
from gcs_formation.stability.mismatch import roots_between


def wave(x: Array) -> Array:
    return np.cos(x) * np.exp(-x / 5.0) - 0.01 * x + 1e-3 * x**2 * np.sign(np.sin(3.0 * x))


def test_roots_are_those_of_scipy_to_the_bit() -> None:
    grid = np.linspace(0.0, 20.0, 41)
    above = wave(grid) > 0.0
    (found,) = np.nonzero(above[1:] != above[:-1])
    assert found.size > 5
    low, high = grid[found], grid[found + 1]
    np.testing.assert_array_equal(roots_between(wave, low, high), elementwise.find_root(wave, (low, high)).x)


def test_a_root_at_an_end_is_found_and_none_is_none() -> None:
    assert roots_between(lambda x: x - 1.0, np.array([0.0, 1.0]), np.array([1.0, 3.0])).tolist() == [1.0, 1.0]
    assert roots_between(wave, np.array([]), np.array([])).size == 0

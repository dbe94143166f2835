"""The natural cubic spline against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from flight_model.spline import spline_through


@pytest.mark.parametrize("count", [2, 3, 4, 40])
@pytest.mark.parametrize("even", [True, False])
def test_values_and_derivatives_are_those_of_scipy(count: int, even: bool) -> None:
    rng = np.random.default_rng(count)
    steps = np.full(count - 1, 700.0) if even else rng.uniform(1.0, 1000.0, count - 1)
    parameters, points = np.concatenate(([0.0], np.cumsum(steps))), rng.normal(0.0, 1000.0, (count, 3))
    own, peer = spline_through(parameters, points), make_interp_spline(parameters, points, k=3, bc_type="natural")
    at = np.concatenate((parameters, rng.uniform(0.0, parameters[-1], 100))).reshape(-1, 1)
    for order in range(3):
        np.testing.assert_allclose(own.at(at, order), peer(at, order), rtol=1e-9, atol=1e-9 / 10.0**order)

"""Where vehicles were at each tick: interpolated between the rows of the emulators' ground truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from flight_model.arrays import Array
from gcs_formation.record.timeseries import AIRBORNE, POSITION, TRUTH, VELOCITY, true_columns

OTHERS = [name.removeprefix("true_") for name in TRUTH[3:]]


def rows(time_s: Array, vehicles: int, seed: int) -> dict[str, Array]:
    """Return random truth at some times; everything else than positions and headings is within 10."""
    draw = np.random.default_rng(seed)
    shape = (time_s.size, vehicles)
    found = {name: draw.uniform(-10.0, 10.0, shape) for name in (*VELOCITY, *OTHERS)}
    found |= {name: draw.uniform(-1e4, 1e4, shape) for name in POSITION}
    found["heading_rad"] = draw.uniform(0.0, 2.0 * np.pi, shape)
    return found | {"time_s": time_s, "airborne": (draw.random(shape) < 0.7).astype(float)}


@settings(max_examples=10)
@given(st.integers(2, 7), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_positions_are_cubic_by_their_rates_and_the_rest_is_linear(count: int, vehicles: int, seed: int) -> None:
    """Compared with SciPy's and NumPy's interpolation, vehicle by vehicle; outside the rows values stay constant."""
    draw = np.random.default_rng(seed)
    time_s = np.cumsum(draw.uniform(0.01, 2.0, count))
    wanted_s = np.sort(np.concatenate((time_s, draw.uniform(time_s[0] - 1.0, time_s[-1] + 1.0, 9))))
    within_s = np.clip(wanted_s, time_s[0], time_s[-1])
    truth = rows(time_s, vehicles, seed)
    found = true_columns(truth, wanted_s)
    assert list(found) == [*TRUTH, AIRBORNE]
    for column in range(vehicles):
        for name, rate in zip(POSITION, VELOCITY, strict=True):
            curve = CubicHermiteSpline(time_s, truth[name][:, column], truth[rate][:, column])
            np.testing.assert_allclose(found[f"true_{name}"][:, column], curve(within_s), rtol=1e-9, atol=1e-8)
        for name in OTHERS:
            own = truth[name][:, column]
            if name == "heading_rad":
                turns = np.interp(wanted_s, time_s, np.unwrap(own)) - found[f"true_{name}"][:, column]
                np.testing.assert_allclose(np.exp(1j * turns), 1.0, atol=1e-9)
            else:
                np.testing.assert_allclose(found[f"true_{name}"][:, column], np.interp(wanted_s, time_s, own))
        flies = np.interp(wanted_s, time_s, truth["airborne"][:, column]) >= 1.0
        assert found[AIRBORNE][:, column].tolist() == flies.astype(float).tolist()


@pytest.mark.parametrize(("before", "later", "between"), [(0.1, 6.1, -0.0416), (6.1, 0.1, 6.2416), (1.0, 3.0, 2.0)])
def test_a_heading_turns_through_north_by_the_smaller_angle(before: float, later: float, between: float) -> None:
    truth = rows(np.array([0.0, 1.0]), 2, 1)
    truth["heading_rad"] = np.array([[before, 2.0], [later, 2.5]])
    found = true_columns(truth, np.array([0.5]))["true_heading_rad"]
    assert found.tolist() == [[pytest.approx(between, abs=1e-4), 2.25]]

"""The fuzzy scheduler against the paper's tables and the corrected paper's golden values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs_formation.control import FuzzyGainScheduler
from gcs_formation.control.fuzzy_pid import rule_tables

unit = st.floats(-1.0, 1.0)


@pytest.mark.parametrize(
    ("error", "rate", "factors"),
    [
        (0.0, 0.0, (0.5, 1.0, 0.5)),
        (0.6, -0.3, (0.6, 0.7, 0.44)),
        (-0.8, 0.1, (0.2, 0.74, 0.56)),
        (1.0, 1.0, (0.5, 0.5, 1.0)),
    ],
)
def test_golden_values(error: float, rate: float, factors: tuple[float, float, float]) -> None:
    assert FuzzyGainScheduler().infer(error, rate) == pytest.approx(factors, abs=1e-12)


def test_rules_hold_at_the_centres_of_the_sets() -> None:
    centres = np.linspace(-1, 1, 5)
    error, rate = np.meshgrid(centres, centres)
    assert FuzzyGainScheduler().infer(error, rate) == pytest.approx(rule_tables("printed"))


def test_inputs_of_unlike_shapes_are_broadcast() -> None:
    infer, index, row = FuzzyGainScheduler().infer, np.linspace(-1, 1, 4)[:, None], np.linspace(-1, 1, 3)
    assert infer(row, 0).tolist() == infer(row, np.zeros(3)).tolist()
    assert infer(0.2, row).tolist() == infer(np.full(3, 0.2), row).tolist()
    both = infer(index, row)
    assert both.shape == (4, 3, 3)
    assert both[2, 1].tolist() == infer(index[2, 0], row[1]).tolist()
    with pytest.raises(ValueError, match="shape mismatch"):
        infer(row, np.zeros(2))


def _triangles(value: float) -> np.ndarray:
    return np.clip(1 - np.abs(np.clip(value, -1, 1) - np.linspace(-1, 1, 5)) / 0.5, 0, 1)


@given(unit, unit)
def test_equals_product_inference_with_weighted_average(error: float, rate: float) -> None:
    weights = np.outer(_triangles(rate), _triangles(error))
    expected = (weights[..., None] * rule_tables("printed")).sum(axis=(0, 1)) / weights.sum()
    assert FuzzyGainScheduler().infer(error, rate) == pytest.approx(expected, abs=1e-12)


@given(st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_factors_stay_between_zero_and_one_whatever_comes_in(error: float, rate: float) -> None:
    factors = FuzzyGainScheduler().infer(error, rate)
    assert ((factors >= 0) & (factors <= 1)).all()


@given(unit, unit)
def test_symmetric_tables_do_not_mind_the_sign(error: float, rate: float) -> None:
    scheduler = FuzzyGainScheduler("symmetric")
    assert scheduler.infer(error, rate) == pytest.approx(scheduler.infer(-error, -rate), abs=1e-12)


def test_the_printed_tables_do_mind_it() -> None:
    scheduler = FuzzyGainScheduler()
    assert np.abs(scheduler.infer(1.0, -1.0) - scheduler.infer(-1.0, 1.0)).max() == 1.0


def test_symmetric_tables_are_the_mean_of_the_printed_ones_and_of_their_mirror_image() -> None:
    error, rate = np.meshgrid(np.linspace(-1.0, 1.0, 7), np.linspace(-1.0, 1.0, 9))
    mean = (FuzzyGainScheduler().infer(error, rate) + FuzzyGainScheduler().infer(-error, -rate)) / 2.0
    assert FuzzyGainScheduler("symmetric").infer(error, rate) == pytest.approx(mean, abs=1e-12)


def test_any_shape_goes_through() -> None:
    assert FuzzyGainScheduler().infer(np.zeros((7, 3)), np.zeros((7, 3))).shape == (7, 3, 3)


@pytest.mark.parametrize(
    ("error", "rate", "name"),
    [(np.nan, 0.0, "error"), ([0.0, np.nan], [0.2, 0.1], "error"), ([0.0, 0.1], [0.2, np.nan], "error_rate")],
)
def test_what_is_not_a_number_is_refused_by_its_name(error, rate, name) -> None:
    with pytest.raises(ValueError, match=f"^{name}: found nan"):
        FuzzyGainScheduler().infer(error, rate)


def test_rules_of_ones_own_take_the_place_of_the_papers():
    rules = tuple(tuple(0.25 * row if index < 4 else 1.0 for index in range(5)) for row in range(5))
    scheduler = FuzzyGainScheduler("printed", (rules, None, None))
    assert scheduler.factors(-1.0, 1.0)[0] == 1.0
    assert scheduler.factors(-1.0, 0.5)[0] == 0.75
    assert scheduler.factors(1.0, -1.0)[0] == 1.0
    assert scheduler.factors(0.3, -0.2)[1:] == FuzzyGainScheduler().factors(0.3, -0.2)[1:]

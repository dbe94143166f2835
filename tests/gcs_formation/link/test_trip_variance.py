"""How much one round trip tells of the clock."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs_formation.link.trip_variance import TripVariance

QUIET_S2 = 0.5e-3**2


def taken(variance: TripVariance, excess_s: float = 0.0, deviation_s: float = 0.0, robust_s: float = 0.0) -> float:
    return variance.sample_s2(excess_s, 16, deviation_s, robust_s)


@given(st.floats(0.0, 1.0), st.integers(0, 7))
def test_the_first_seven_tell_little_whatever_they_are(excess_s: float, count: int) -> None:
    """A deviation of 0.1 s of the round trip is 0.05 s of its midpoint; and their resolution is 0.5 ms."""
    variance = TripVariance(0.02)
    assert variance.sample_s2(excess_s, count, 0.01, 0.01) == pytest.approx(0.05**2 + QUIET_S2)
    assert (variance.trips_s2, variance.mean_s2) == (0.0, 0.0)
    assert variance.sample_s2(0.0, 8, 0.0, 0.0) == pytest.approx(QUIET_S2)


def test_the_first_one_of_a_known_deviation_by_hand() -> None:
    """Deviation 9 ms, excess 3 ms: one in eight, 81 - 72/8 = 72 µs²; its bound (1 + 2/3) · 72 = 120; a quarter is 30.

    The next excess 0: one in nine, 72 · 8/9 = 64; the bound is 64 (1 + 2/√10).
    """
    variance = TripVariance(0.0)
    assert taken(variance, 3e-3, 9e-3, 9e-3) == pytest.approx(QUIET_S2 + 30e-6)
    assert (variance.trips_s2, variance.mean_s2) == (pytest.approx(72e-6), pytest.approx(18e-6))
    assert taken(variance, 0.0, 1.0, 1.0) == pytest.approx(QUIET_S2 + 16e-6 * (1.0 + 2.0 / math.sqrt(10.0)))
    assert variance.mean_s2 == pytest.approx(8e-6)


@pytest.mark.parametrize(
    ("excess_s", "late_s2"), [(0.0299, 0.0), (0.0301, 0.0301**2), (0.3, 0.09), (-0.0301, 0.0), (-0.3, 0.0)]
)
def test_one_that_was_held_up_is_off_by_half_of_it_and_counts_for_three_deviations(
    excess_s: float, late_s2: float
) -> None:
    """Of 10 ms; one that came early can't have been held up."""
    variance = TripVariance(0.0)
    reported_s2 = taken(variance, excess_s, 0.01, 0.005)
    known_s2 = 1e-4 + (min(excess_s**2, 9e-4) - 1e-4) / 8.0
    assert variance.trips_s2 == pytest.approx(known_s2)
    assert reported_s2 == pytest.approx(QUIET_S2 + (known_s2 * (1.0 + 2.0 / 3.0) + late_s2) / 4.0)


def test_exactly_three_deviations_are_no_outlier() -> None:
    """3/128 s of 1/128 s, which floating-point numbers hold exactly."""
    variance = TripVariance(0.0)
    reported_s2 = taken(variance, 3 / 128, 1 / 128, 1 / 128)
    assert variance.trips_s2 == 2 / 128**2
    assert reported_s2 == pytest.approx(QUIET_S2 + 2 / 128**2 * (1.0 + 2.0 / 3.0) / 4.0)


def test_round_trips_that_vary_more_than_they_did_are_no_outliers() -> None:
    """A robust deviation of 20 ms makes 50 ms plausible, one of 10 ms doesn't."""
    for robust_s, plausible_s2 in ((0.02, 25e-4), (0.01, 9e-4)):
        variance = TripVariance(0.0)
        taken(variance, 0.05, 0.01, robust_s)
        assert variance.trips_s2 == pytest.approx(1e-4 + (plausible_s2 - 1e-4) / 8.0)


@pytest.mark.parametrize("jitter_s", [0.0, 0.01])
def test_the_variance_converges_to_that_of_the_delays_and_the_wait_costs_little(jitter_s: float) -> None:
    """The wait, uniform over 20 ms, has 400/12 µs²; as far as the round trip tells it, it isn't uncertain.

    Without other jitter all of it; of j² beside w² the variance j² w² / (j² + w²) is left of it, and j² is the link's:
    together (j² + w²) - w⁴ / (j² + w²).
    """
    rng, variance, wait_s2 = np.random.default_rng(1), TripVariance(0.02), 0.02**2 / 12.0
    total_s2, known_s2, reported_s2 = wait_s2 + jitter_s**2, list[float](), list[float]()
    for excess_s in (rng.uniform(-0.01, 0.01, 3000) + jitter_s * rng.standard_normal(3000)).tolist():
        reported_s2.append(taken(variance, excess_s, math.sqrt(total_s2), math.sqrt(total_s2)))
        known_s2.append(variance.trips_s2)
    assert np.mean(known_s2[200:]) == pytest.approx(total_s2, rel=0.03)
    assert variance.jitter_s2 == pytest.approx(variance.trips_s2 - wait_s2)
    assert variance.mean_s2 == pytest.approx(variance.trips_s2 / 4.0 / 64.0)
    bound_s2 = variance.trips_s2 * (1.0 + 2.0 / math.sqrt(72.0))
    assert reported_s2[-1] == pytest.approx(QUIET_S2 + (bound_s2 - wait_s2**2 / bound_s2) / 4.0)
    assert np.std(known_s2[200:]) < 0.2 * total_s2, "a mean over 64"
    assert taken(TripVariance(0.02), 0.0, 0.004, 0.004) == pytest.approx(QUIET_S2), "less than the wait's"


def test_the_memory_is_of_71_round_trips_once_many_are_known() -> None:
    """Each weighs 1 / (64 + 8 - 1): of a variance that ends, (70/71)^n is left after n."""
    variance = TripVariance(0.0)
    for _ in range(100):
        taken(variance, 0.01, 0.01, 0.01)
    assert variance.trips_s2 == pytest.approx(1e-4)
    for _ in range(71):
        taken(variance, 0.0, 0.01, 0.01)
    assert variance.trips_s2 == pytest.approx(1e-4 * (70.0 / 71.0) ** 71)

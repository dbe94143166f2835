"""The Kalman filter of a clock's offset and drift, against the joint distribution of all samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import NANOSECONDS, Instant, after
from gcs_formation.link.clock_filter import ClockFilter

BEGUN = Instant(5_000_000_000)


def joint(at_s: np.ndarray, noises: tuple[float, float, float], first_s2: float) -> np.ndarray:
    """Return the covariance of a clock's offsets at times since the first sample, and of its drift then, last.

    Offset noise is a random walk, drift noise an independent one for each step, acting on the offset from the next
    step on. Summed step by step, without a recursion of covariances.
    """
    count, (prior_drift, offset_noise, drift_noise) = len(at_s), noises
    sources = [(first_s2, np.append(np.ones(count), 0.0)), (prior_drift**2, np.append(at_s - at_s[0], 1.0))]
    for step, span_s in enumerate(np.diff(at_s), 1):
        later = np.arange(count) >= step
        sources.append((offset_noise**2 * span_s, np.append(later, 0.0)))
        sources.append((drift_noise**2 * span_s, np.append(np.where(later, at_s - at_s[step], 0.0), 1.0)))
    return np.asarray(sum(variance * np.outer(acts, acts) for variance, acts in sources))


@pytest.mark.parametrize("noises", [(5e-5, 1e-6, 2e-8), (2e-3, 1e-4, 2e-6), (1e-4, 1e-3, 1e-4)])
def test_the_estimate_is_the_mean_given_all_samples_and_likelihoods_multiply(
    noises: tuple[float, float, float],
) -> None:
    """Conditional mean, covariance and density of a joint normal distribution, by linear algebra."""
    rng = np.random.default_rng(1)
    for count in (2, 3, 4, 6, 6, 6):
        at_s = np.cumsum([0.0, *np.round(rng.uniform(0.1, 8.0, count), 6)])
        off_s, variances = 1e-3 * rng.standard_normal(count), 10.0 ** rng.uniform(-7.0, -5.0, count)
        known = ClockFilter(*noises)
        known.drift = 7.0
        known.initialise(BEGUN, 30.0, 1e-6)
        log_likelihood = sum(
            known.correct(after(BEGUN, at), 30.0 + each_s, variance)
            for at, each_s, variance in zip(at_s[1:].tolist(), off_s.tolist(), variances.tolist(), strict=True)
        )
        spread = joint(at_s, noises, 1e-6)
        seen = spread[1:-1, 1:-1] + np.diag(variances)
        gains = np.linalg.solve(seen, spread[1:-1, -2:]).T
        covariance = spread[-2:, -2:] - gains @ spread[1:-1, -2:]
        assert (known.offset_s - 30.0, known.drift) == pytest.approx(tuple(gains @ off_s), rel=1e-4, abs=1e-10)
        assert known.offset_variance == pytest.approx(covariance[0, 0], rel=1e-4)
        assert known.drift_deviation**2 == pytest.approx(covariance[1, 1], rel=1e-4)
        log_density = -(np.linalg.slogdet(seen)[1] + off_s @ np.linalg.solve(seen, off_s)) / 2.0
        assert log_likelihood == pytest.approx(log_density, rel=1e-4)


@given(st.floats(-1e4, 1e4), st.floats(-0.02, 0.02), st.floats(-1e3, 1e3), st.floats(0.0, 10.0))
def test_instants_and_times_of_the_vehicle_s_clock_are_mapped_both_ways(
    offset_s: float, drift: float, later_s: float, age_s: float
) -> None:
    """The clock shows t + offset + drift · (t - reference)."""
    known, at = ClockFilter(0.02), after(BEGUN, later_s)
    known.initialise(BEGUN, offset_s, 1e-6)
    known.drift = drift
    assert known.predict(BEGUN) == offset_s
    shown_s = at / NANOSECONDS + known.predict(at)
    assert shown_s == pytest.approx(5.0 + later_s + offset_s + drift * later_s, abs=1e-8)
    assert known.to_instant(shown_s) == pytest.approx(at, abs=5)
    assert known.age_s(shown_s, after(at, age_s)) == pytest.approx(age_s, abs=1e-8)


def test_uncertainty_grows_with_time_by_drift_and_random_walk() -> None:
    """After 10 s, from 1 ms: 1e-6 + (10 · 0.02)² + 1e-4² · 10 = 0.0400011 s²; earlier instants change nothing."""
    known = ClockFilter(0.02)
    known.initialise(BEGUN, 1.0, 1e-6)
    known.advance(after(BEGUN, 10.0))
    assert known.offset_variance == pytest.approx(1e-6 + 0.04 + 1e-7, rel=1e-12)
    assert known.drift_deviation == pytest.approx(math.sqrt(0.02**2 + 2e-6**2 * 10.0), rel=1e-12)
    assert (known.offset_s, known.reference) == (1.0, after(BEGUN, 10.0))
    known.advance(BEGUN)
    assert known.reference == after(BEGUN, 10.0)
    assert known.offset_variance == pytest.approx(1e-6 + 0.04 + 1e-7, rel=1e-12)


def test_drift_is_learnt_from_two_samples_of_little_noise_and_kept_when_the_clock_steps() -> None:
    """1 ms in 10 s are 1e-4; a step leaves nothing of the offset's correlation with it."""
    known = ClockFilter(0.02, 0.0, 0.0)
    known.initialise(BEGUN, 2.0, 1e-12)
    known.correct(after(BEGUN, 10.0), 2.001, 1e-12)
    assert known.drift == pytest.approx(1e-4, rel=1e-6)
    known.step(after(BEGUN, 10.0), 5.0, 4e-6)
    assert (known.offset_s, known.offset_variance) == (5.0, 4e-6)
    assert known.predict(after(BEGUN, 20.0)) == pytest.approx(5.001, abs=1e-9)
    drift = known.drift
    known.correct(after(BEGUN, 10.0), 5.003, 4e-6)
    assert (known.offset_s, known.drift) == (pytest.approx(5.0015), drift)


def test_a_line_s_slope_is_as_uncertain_as_that_through_its_two_ends() -> None:
    """Ends off by s each, independently, T apart: slope's variance 2 s²/T², covariance with the last one s²/T.

    A sample at the end of variance s² halves its error: of 2 ms, 1 ms, and 1 ms / T = 1e-4 of the slope.
    """
    known = ClockFilter(0.02)
    known.begin_line(BEGUN, 3.0, 5e-5, 1e-3, 10.0)
    assert (known.offset_s, known.drift, known.reference) == (3.0, 5e-5, BEGUN)
    assert (known.offset_variance, known.drift_deviation) == (
        pytest.approx(1e-6),
        pytest.approx(math.sqrt(2.0) * 1e-4),
    )
    known.correct(BEGUN, 3.002, 1e-6)
    assert (known.offset_s, known.drift) == (pytest.approx(3.001), pytest.approx(1.5e-4))
    assert known.offset_variance == pytest.approx(5e-7)
    assert known.drift_deviation**2 == pytest.approx(2e-8 - 1e-7**2 / 2e-6)


def test_nothing_is_known_before_the_first_sample() -> None:
    known = ClockFilter(3e-5)
    assert math.isnan(known.offset_s)
    assert (known.drift, known.drift_deviation, known.offset_variance, known.reference) == (0.0, 3e-5, 1.0, Instant(0))

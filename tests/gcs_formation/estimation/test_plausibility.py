"""When a sample is implausible, within which limits noise is estimated, and how positions drift: by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gcs_formation.estimation.large_gust import LargeGust, explained
from gcs_formation.estimation.noise_and_plausibility import (
    PositionDrift,
    Quantities,
    Values,
    VehicleNoise,
    _arc_ratio,
    excesses,
    plausible,
)

OWN: Values = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.08)
"""Variances of innovations."""
ZERO: Values = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def with_one(which: int, value: float, others: Values = ZERO) -> Values:
    a, b, c, d, e, f, g, h = (value if place == which else each for place, each in enumerate(others))
    return a, b, c, d, e, f, g, h


@pytest.mark.parametrize(
    ("which", "sigma"),
    [
        (0, math.sqrt(1.0 + 0.25)),
        (1, math.sqrt(2.0 + 0.25)),
        (2, math.sqrt(3.0 + 0.25)),
        (3, math.sqrt(4.0 + 1.0)),
        (4, math.sqrt(5.0 + 1.0)),
        (5, math.sqrt(6.0 + 1.0)),
        (6, math.sqrt(7.0 + 1.0)),
        (7, math.sqrt(0.08 + 0.01)),
    ],
)
def test_what_departs_by_three_standard_deviations_is_implausible(which: int, sigma: float) -> None:
    """The unknown motion is 1 m/s, for positions over the 0.5 s between two samples, and 0.1 rad."""
    for sign in (-1.0, 1.0):
        assert plausible(excesses(with_one(which, 2.99 * sign * sigma), OWN, 0.5))
        found = excesses(with_one(which, 6.0 * sign * sigma), OWN, 0.5)
        assert not plausible(found)
        assert found == pytest.approx(with_one(which, 4.0, (1.0,) * 8))


LEAST: Quantities = (0.01, 0.02, 0.03, 0.04, 0.05, 0.06)
"""Lower limits of noise, of each quantity."""


def noise_of(sigma: float) -> VehicleNoise:
    return VehicleNoise((sigma,) * 6, LEAST)


def test_noise_is_estimated_up_to_limits_and_down_to_the_least_one() -> None:
    """Errors that alternate are noise, those of one sign aren't: 30 m, 5 m/s, 10 m/s and 0.5 rad."""
    noise, huge = noise_of(1.0), (1e4,) * 8
    for number in range(600):
        noise.adapt(((-1.0) ** number * 60.0,) * 8, huge)
    assert noise.sigma() == pytest.approx([30.0, 30.0, 5.0, 5.0, 10.0, 0.5])
    for _ in range(600):
        noise.adapt((60.0,) * 8, huge)
    assert noise.sigma() == pytest.approx(LEAST)


@pytest.mark.parametrize("which", range(8))
def test_increments_count_up_to_two_standard_deviations_of_their_own(which: int) -> None:
    """With variances of 1 and innovations' of 3, 8, 15, …, two standard deviations are 4, 6, 8, … in the first sample.

    North and east share a variance, so that each of them counts half.
    """
    spread: Values = (3.0, 8.0, 15.0, 24.0, 35.0, 48.0, 63.0, 80.0)
    quantity, share = ((0, 0.5), (0, 0.5), (1, 1.0), (2, 0.5), (2, 0.5), (3, 1.0), (4, 1.0), (5, 1.0))[which]
    noise = noise_of(1.0)
    if which == 7:
        noise = noise_of(0.4)
        spread = with_one(7, 0.0, spread)
    variance = noise.by_quantity[quantity]
    noise.adapt(with_one(which, 99.0), spread)
    first = noise.by_quantity[quantity]
    assert first == pytest.approx(variance * (1.0 - 1.0 / 21.0))
    noise.adapt(with_one(which, -0.01), spread)
    clipped = 2.0 * math.sqrt(spread[which] + variance)
    assert noise.by_quantity[quantity] == pytest.approx(first + (share * 0.01 * clipped - first) / 22.0)


@given(st.floats(1.1, 60.0), st.floats(-math.pi, math.pi), st.floats(-0.2, 0.2))
@settings(max_examples=20)
@example(1.1, 0.3, 0.2)
def test_an_arc_is_longer_than_the_mean_of_its_ends_velocities_by_tan_x_by_x(
    speed_mps: float, course_rad: float, turned_rad: float
) -> None:
    """For a turn of 2 x, whatever speed and direction: the chord of an arc is 2 r sin x."""
    later_rad, half_rad = course_rad + turned_rad, turned_rad / 2.0
    north_mps, east_mps = speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)
    ratio = _arc_ratio(north_mps, east_mps, speed_mps * math.cos(later_rad), speed_mps * math.sin(later_rad))
    assert ratio == pytest.approx(math.tan(half_rad) / half_rad if abs(half_rad) > 1e-3 else 1.0, abs=1e-4)


def drifted(steps: int, slide_mps: tuple[float, float], sigma_m: float, sigma_mps: float) -> PositionDrift:
    """Fly 12 m/s northwards and 16 eastwards and gain a slide on it, ten samples a second."""
    place, rate = sigma_m**2, sigma_mps**2
    noise, drift = (place, place, 9.0, rate, rate, 9.0, 9.0, 9.0), PositionDrift()
    for step in range(steps + 1):
        at_s = 0.1 * step
        values = (12.0 + slide_mps[0]) * at_s, (16.0 + slide_mps[1]) * at_s, 0.0, 12.0, 16.0, 0.0, 20.0, 0.9
        drift.adapt(values, 0.1 if step else 0.0, noise)
    return drift


@pytest.mark.parametrize(("sigma_m", "sigma_mps"), [(0.003, 0.003), (0.01, 0.003), (0.003, 0.02)])
def test_a_slide_adds_up_for_three_seconds(sigma_m: float, sigma_mps: float) -> None:
    """0.02 m/s northwards and 0.01 to the west: 6 and 3 cm; noise of velocities adds up like a walk, s² 0.1 s 3 s / 2.

    The drift's variance per second is 2 / 3 s of the mean square above four times the noise.
    """
    by_noise = sigma_m**2 + sigma_mps**2 * 0.1 * 3.0 / 2.0
    expected = 2.0 / 3.0 * ((0.06**2 + 0.03**2) / 2.0 - 4.0 * by_noise)
    assert drifted(2000, (0.02, -0.01), sigma_m, sigma_mps).variance == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("slide_mps", "gains_m"), [(0.1, 0.01), (-0.1, 0.01), (0.4, 0.03274), (-0.4, 0.03274)])
def test_the_first_sample_counts_as_one_of_21_and_gains_are_clipped(slide_mps: float, gains_m: float) -> None:
    """At 2 standard deviations of two positions of 3 mm and the largest drift, 5 cm in a second: 3.27 cm in 0.1 s."""
    for slide in ((slide_mps, 0.0), (0.0, slide_mps)):
        by_noise = 0.003**2 * (1.0 + 0.15)
        expected = 2.0 / 3.0 * (gains_m**2 / 2.0 / 21.0 - 4.0 * by_noise)
        drift = drifted(1, slide, 0.003, 0.003)
        assert drift.variance == pytest.approx(max(0.0, expected), abs=1e-8)
        assert drift._square == pytest.approx(gains_m**2 / 2.0 / 21.0, rel=2e-3)


def test_a_drift_begins_again_from_a_sample_and_keeps_what_is_known() -> None:
    """Of which a sample of a hundred, without any slide, leaves 99 %."""
    drift = drifted(2000, (0.02, -0.01), 0.003, 0.003)
    known, elsewhere = drift.variance, (900.0, -900.0, 0.0, 12.0, 16.0, 0.0, 20.0, 0.9)
    noise = (9e-6, 9e-6, 9.0, 9e-6, 9e-6, 9.0, 9.0, 9.0)
    drift.initialise(elsewhere)
    assert drift.variance == known
    drift.adapt((901.2, -898.4, *elsewhere[2:]), 0.1, noise)
    assert drift._square == pytest.approx((0.06**2 + 0.03**2) / 2.0 * 0.99)


@pytest.mark.parametrize("elapsed_s", [-0.1, 0.0, 0.3, 1.0])
def test_velocities_are_not_integrated_over_no_time_or_a_gap(elapsed_s: float) -> None:
    drift = drifted(2000, (0.02, -0.01), 0.003, 0.003)
    known = drift._square
    drift.adapt((5.0, 5.0, 0.0, 0.0, 20.0, 0.0, 20.0, 1.5), elapsed_s, (9e-6,) * 8)
    assert (drift._square, drift._north_m, drift._east_m) == (known, 0.0, 0.0)


@pytest.mark.parametrize(("which", "limit"), [(6, 1.0), (7, 0.1)])
def test_a_gust_is_explained_by_an_airspeed_or_a_heading_that_changed(which: int, limit: float) -> None:
    for sign in (-1.0, 1.0):
        assert not explained(with_one(which, sign * limit))
        assert explained(with_one(which, 1.01 * sign * limit))


def repeats(change_mps: tuple[float, float], off_mps: tuple[float, float], noise: float) -> bool:
    """Return whether a gust repeats whose wind has changed, and whose position moved otherwise than its velocity."""
    moved_m = 0.25 * (18.0 + off_mps[0]), 0.25 * (-7.0 + off_mps[1])
    values = (0.0, 0.0, 100.0, 18.0, -7.0, 0.0, 20.0, 0.0)
    before = LargeGust(9.0, -4.0, 50.0, 60.0)
    now = LargeGust(9.0 + change_mps[0], -4.0 + change_mps[1], 50.0 + moved_m[0], 60.0 + moved_m[1])
    return now.repeats(before, values, noise, 0.25)


@pytest.mark.parametrize("direction_deg", range(0, 360, 45))
def test_a_gust_repeats_within_four_standard_deviations_and_1_mps(direction_deg: int) -> None:
    """With a variance of 0.5 (m/s)², 16 * 0.5 + 1 in each component, so 4.24 m/s together, in all directions."""
    cos, sin = math.cos(math.radians(direction_deg)), math.sin(math.radians(direction_deg))
    inside_mps, outside_mps = (4.2 * cos, 4.2 * sin), (4.3 * cos, 4.3 * sin)
    assert repeats(inside_mps, inside_mps, 0.5)
    assert not repeats(outside_mps, inside_mps, 0.5)
    assert not repeats(inside_mps, outside_mps, 0.5)
    assert np.hypot(*inside_mps) < math.sqrt(18.0) < np.hypot(*outside_mps)
    assert not repeats((3.0, 3.0), inside_mps, 0.5)
    assert not repeats(inside_mps, (3.0, 3.0), 0.5)


@pytest.mark.parametrize("elapsed_s", [-0.1, 0.0])
def test_a_gust_does_not_repeat_without_time(elapsed_s: float) -> None:
    gust = LargeGust(9.0, 0.0, 0.0, 0.0)
    assert not gust.repeats(gust, ZERO, 9.0, elapsed_s)

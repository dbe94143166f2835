"""How far a heading or an airspeed may change in a step: each limit from both of its sides."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs_formation.features.telemetry_health.heading_and_airspeed import AirspeedJumps, HeadingCheck, StepNoise

TURN_RPS, ACCEL_MPS2, STEP_S = 0.25, 1.5, 0.1
NEW = 21
"""Samples after which the noise of 20 steps is known."""


def at_ns(number: float) -> int:
    return 1 + round(number * STEP_S * 1e9)


def straight(samples: int = NEW) -> HeadingCheck:
    """Return one that has flown north."""
    checked = HeadingCheck(TURN_RPS)
    for number in range(samples):
        checked.take_turned(at_ns(number), 0.0, 0.0, 0.0)
    return checked


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("max_rad", "after", "bend_rad", "sigma_rad"),
    [(0.1875, 1, 0.0, 0.0), (0.2625, 3, 0.0, 0.0), (0.45, 1, 0.2, 0.0), (0.2575, 1, 0.0, 0.01)],
)
def test_a_heading_jumps_that_turns_by_more_than_half_again_the_limit_and_some(
    sign: float, max_rad: float, after: int, bend_rad: float, sigma_rad: float
) -> None:
    """1.5 * 0.25 rad/s * 0.1 s + 0.15 rad: 0.1875 rad; the course's own turn where that is more; 7 sigmas of noise."""
    for reported_rad, is_jump in ((max_rad - 0.001, False), (max_rad + 0.001, True)):
        checked = straight()
        flown = checked.take_turned(at_ns(NEW - 1 + after), sign * reported_rad, sign * bend_rad, sigma_rad)
        assert flown == pytest.approx(sign * (bend_rad if is_jump else reported_rad))
        assert (checked.offset_rad != 0.0) == is_jump
        assert checked.evidence_rad == pytest.approx((reported_rad - bend_rad) if is_jump else 0.0)


@pytest.mark.parametrize(("samples", "is_jump"), [(20, False), (21, True)])
def test_a_jump_is_judged_once_twenty_steps_have_shown_the_noise(samples: int, is_jump: bool) -> None:
    checked = straight(samples)
    checked.take_turned(at_ns(samples), 1.0, 0.0, 0.0)
    assert (checked.offset_rad != 0.0) == is_jump


@pytest.mark.parametrize(("gap_s", "is_jump"), [(3.0, True), (3.1, False), (-0.5, False)])
def test_a_heading_after_a_gap_of_three_seconds_is_not_compared(gap_s: float, is_jump: bool) -> None:
    checked = straight()
    checked.take_turned(at_ns(NEW - 1 + gap_s / STEP_S), 3.0, 0.0, 0.0)
    assert (checked.offset_rad != 0.0) == is_jump


def test_a_heading_that_jumps_again_within_a_second_is_carried_on_by_the_course() -> None:
    """The course turns at 0.1 rad/s; whatever is reported in the next second, what is flown turns with it."""
    checked = straight()
    checked.take_turned(at_ns(NEW), 1.0, 0.01, 0.0)
    for number in range(1, 10):
        reported_rad = 1.0 + 0.1 * (number % 2)
        flown = checked.take_turned(at_ns(NEW + number), reported_rad, 0.01 * (number + 1), 0.0)
        assert flown == pytest.approx(0.01 * (number + 1))
    checked.take_turned(at_ns(NEW + 10), reported_rad, 0.1, 0.0)
    flown = checked.take_turned(at_ns(NEW + 11), reported_rad + 0.05, 0.1, 0.0)
    assert flown == pytest.approx(0.1 + 0.05), "it has been quiet for a second, and is believed to turn"


@given(jump_rad=st.floats(0.4, 3.0), course_rad=st.floats(-3.0, 3.0))
@settings(max_examples=20)
def test_a_jump_back_forgets_the_jump_through_south_too(jump_rad: float, course_rad: float) -> None:
    """Headings repeat after a full turn; what is flown is the true one all the time."""
    checked = HeadingCheck(TURN_RPS)
    for number in range(80):
        reported = course_rad + 0.002 * number + (jump_rad if 30 <= number < 55 else 0.0)
        flown = checked.take_turned(at_ns(number), math.remainder(reported, math.tau), course_rad + 0.002 * number, 0.0)
        assert math.remainder(flown - course_rad - 0.002 * number, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert checked.offset_rad == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_heading_is_frozen_after_five_that_are_the_same_and_a_bend_less_its_sharpest_turn(sign: float) -> None:
    """0.04 rad each: after four, 0.12 rad are left without the sharpest; after five, 0.16 rad, more than 0.15 rad."""
    checked = straight()
    checked.take_turned(at_ns(NEW), sign * 0.01, sign * 0.01, 0.0)
    for number in range(1, 8):
        bend_rad = sign * (0.01 + 0.04 * number)
        flown = checked.take_turned(at_ns(NEW + number), sign * 0.01, bend_rad, 0.0)
        assert checked.frozen == (number >= 5)
        assert flown == pytest.approx(bend_rad if number >= 5 else sign * 0.01)
    assert checked.evidence_rad == pytest.approx(0.2)
    assert checked.take_turned(at_ns(NEW + 8), bend_rad + sign * 0.04, bend_rad + sign * 0.04, 0.0) == pytest.approx(
        bend_rad + sign * 0.04
    )
    assert not checked.frozen


def test_four_that_are_the_same_are_not_frozen_however_sharp_the_bend() -> None:
    checked = straight()
    checked.take_turned(at_ns(NEW), 0.01, 0.0, 0.0)
    for number in range(1, 5):
        checked.take_turned(at_ns(NEW + number), 0.01, 0.1 * number, 0.0)
    assert not checked.frozen
    checked.take_turned(at_ns(NEW + 5), 0.01, 0.5, 0.0)
    assert checked.frozen


def test_noise_is_known_from_twenty_steps_and_is_at_least_the_declared() -> None:
    """Steps of 2 a and -2 a take back 4 a² each; the first takes nothing: in equal weights 19 of 20 of it, 1.949 a."""
    noise = StepNoise()
    for number in range(20):
        assert not noise.known
        noise.take(0.2 * (-1) ** number)
    assert noise.known
    assert noise.sigma(0.0) == pytest.approx(math.sqrt(0.04 * 19.0 / 20.0))
    assert noise.sigma(0.5) == 0.5
    noise.take(0.0)
    assert noise.sigma(0.0) == pytest.approx(math.sqrt(0.95 * 0.04 * 19.0 / 20.0)), "the newest weighs a 20th"
    drifting = StepNoise()
    drifting.take(1.0)
    drifting.take(1.0)
    assert drifting.sigma(0.1) == 0.1, "what goes on is no noise"


def cruising(samples: int = NEW) -> AirspeedJumps:
    checked = AirspeedJumps(ACCEL_MPS2)
    for number in range(samples):
        assert checked.take(at_ns(number), 20.0, 0.0) == 20.0
    return checked


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("max_mps", "after", "sigma_mps"), [(4.725, 1, 0.0), (5.4, 4, 0.0), (6.125, 1, 0.2)])
def test_an_airspeed_jumps_that_changes_by_more_than_half_again_the_limit_and_a_gust(
    sign: float, max_mps: float, after: int, sigma_mps: float
) -> None:
    """1.5 * 1.5 m/s² * 0.1 s + 4.5 m/s: 4.725 m/s; and 7 sigmas of noise."""
    for change_mps, is_jump in ((max_mps - 0.01, False), (max_mps + 0.01, True)):
        checked = cruising()
        flown = checked.take(at_ns(NEW - 1 + after), 20.0 + sign * change_mps, sigma_mps)
        assert flown == pytest.approx(20.0 if is_jump else 20.0 + sign * change_mps)
        assert checked.evidence_mps == pytest.approx(change_mps if is_jump else 0.0)


@pytest.mark.parametrize(
    ("samples", "gap", "is_jump"), [(20, 1, False), (21, 1, True), (21, 30, True), (21, 31, False)]
)
def test_an_airspeed_is_compared_with_known_noise_and_within_three_seconds(
    samples: int, gap: int, is_jump: bool
) -> None:
    checked = cruising(samples)
    assert (checked.take(at_ns(samples - 1 + gap), 35.0, 0.0) == 20.0) == is_jump


def test_a_failed_sensors_airspeed_is_passed_on_and_what_was_known_of_jumps_is_forgotten() -> None:
    checked = cruising()
    assert checked.take(at_ns(NEW), 30.0, 0.0) == pytest.approx(20.0)
    assert checked.take(at_ns(NEW + 1), 31.0, 0.0, read=False) == 31.0
    assert checked.offset_mps == 0.0
    assert checked.take(at_ns(NEW + 2), 10.0, 0.0) == 10.0


def test_an_airspeed_that_jumps_twice_the_same_way_is_taken_back_by_both() -> None:
    checked = cruising()
    reported = [30.0] * 30 + [40.0] * 30 + [41.0] * 5
    flown = [checked.take(at_ns(NEW + number), each, 0.0) for number, each in enumerate(reported)]
    assert flown == pytest.approx([20.0] * 60 + [21.0] * 5)
    assert checked.offset_mps == pytest.approx(-20.0)


@pytest.mark.parametrize(("samples", "is_jump"), [(20, False), (21, True)])
def test_the_first_of_all_is_compared_with_nothing_however_soon_after_the_vehicles_start(
    samples: int, is_jump: bool
) -> None:
    """Twenty steps are between 21 samples, here from the second second of its clock on."""
    airspeed, heading = AirspeedJumps(ACCEL_MPS2), HeadingCheck(TURN_RPS)
    for number in range(samples):
        airspeed.take(at_ns(20 + number), 20.0, 0.0)
        heading.take_turned(at_ns(20 + number), 0.3, 0.2, 0.0)
    flown_mps = airspeed.take(at_ns(20 + samples), 35.0, 0.0)
    flown_rad = heading.take_turned(at_ns(20 + samples), 1.3, 0.2, 0.0)
    assert (flown_mps, flown_rad) == pytest.approx((20.0, 0.3) if is_jump else (35.0, 1.3))

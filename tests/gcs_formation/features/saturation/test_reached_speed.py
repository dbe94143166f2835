"""The speed at which a multirotor is saturated, by what it was commanded and what it flew."""

from __future__ import annotations

import math

import pytest

from gcs_formation.features.saturation.reached_speed import CHECK_S, CHECKS, FORGETS_MPS2, ReachedSpeed

FASTEST_MPS = 9.0


def flown(reached: ReachedSpeed, commanded_mps: float, *speeds_mps: float, course_rad: float = 0.7) -> None:
    for speed_mps in speeds_mps:
        north, east = math.cos(course_rad), math.sin(course_rad)
        commanded = commanded_mps * north, commanded_mps * east
        reached.check(commanded, (speed_mps * north, speed_mps * east))


def test_one_that_is_too_slow_and_gets_no_faster_is_at_its_limit():
    reached = ReachedSpeed(FASTEST_MPS)
    flown(reached, 7.0, *[4.7] * (CHECKS - 1))
    assert (reached.saturated, reached.max_mps) == (False, math.inf)
    flown(reached, 7.0, 4.7)
    assert reached.saturated
    assert reached.max_mps == pytest.approx(4.7)


@pytest.mark.parametrize(
    "flown_mps",
    [
        [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.9, 7.0, 7.0],  # accelerates at its limit
        [4.0, 5.9, 6.6, 6.9, 6.9, 7.0, 7.0, 7.0],  # as a first-order system does
        [6.7] * 20,  # less than its noise and gusts may do
        [7.6] * 20,  # too fast
        [0.5] * 20,  # doesn't fly: none waits for it
        [-3.0] * 20,
    ],
)
def test_one_that_follows_or_does_not_fly_at_all_is_not(flown_mps: list[float]):
    reached = ReachedSpeed(FASTEST_MPS)
    for speed_mps in flown_mps:
        flown(reached, 7.0, speed_mps)
        assert not reached.saturated
    assert reached.max_mps == math.inf


def test_its_limit_is_the_mean_of_what_it_flew_meanwhile():
    reached = ReachedSpeed(FASTEST_MPS)
    flown(reached, 7.0, *(4.6 + 0.1 * number for number in range(CHECKS)))
    assert reached.max_mps == pytest.approx(4.6 + 0.1 * (CHECKS - 1) / 2)


def test_what_it_flies_across_its_command_does_not_count():
    reached = ReachedSpeed(FASTEST_MPS)
    for _ in range(CHECKS):
        reached.check((5.0, 0.0), (4.0, 6.0))
    assert reached.max_mps == pytest.approx(4.0)


def test_a_limit_is_forgotten_slowly_and_then_there_is_none():
    reached = ReachedSpeed(FASTEST_MPS)
    flown(reached, 7.0, *[4.7] * CHECKS)
    flown(reached, 4.0, *[4.0] * 10)
    assert not reached.saturated
    assert reached.max_mps == pytest.approx(4.7 + 10 * FORGETS_MPS2 * CHECK_S)
    flown(reached, 4.0, *[4.0] * 1000)
    assert reached.max_mps == math.inf


def test_what_it_flew_before_it_was_commanded_again_does_not_count():
    reached = ReachedSpeed(FASTEST_MPS)
    flown(reached, 7.0, *[4.7] * (CHECKS - 1))
    reached.pause()
    flown(reached, 7.0, *[4.7] * (CHECKS - 1))
    assert reached.max_mps == math.inf


@pytest.mark.parametrize(
    ("commanded_mps", "flown_mps", "saturated"),
    [
        (7.0, (4.0, 4.8, 4.8, 4.8), True),  # of 3 m/s that it lacked it gained 0.8, less than 0.9
        (7.0, (4.0, 5.0, 5.0, 5.0), False),
        (7.0, (4.0, 4.0, 4.0, 5.0), False),
        (10.0, (5.0, 6.5, 6.5, 6.5), False),  # three tenths are enough
        (1.0, (0.5, 0.5, 0.5, 0.5), True),
        (0.75, (0.4, 0.4, 0.4, 0.4), False),  # lacks less than 0.4 m/s
        (0.9, (0.5, 0.5, 0.5, 0.5), True),
        (10.0, (2.9, 2.9, 2.9, 2.9), False),  # flies less than 0.3 of its command
        (10.0, (3.0, 3.0, 3.0, 3.0), True),
        (0.0, (0.0, 0.0, 0.0, 0.0), False),
    ],
)
def test_what_counts_is_what_it_lacks_what_it_flies_and_what_it_has_gained_of_it(
    commanded_mps: float, flown_mps: tuple[float, ...], saturated: bool
):
    reached = ReachedSpeed(FASTEST_MPS)
    flown(reached, commanded_mps, *flown_mps, course_rad=0.0)
    assert reached.saturated is saturated


def test_four_successive_checks_count_whatever_was_before_them():
    reached = ReachedSpeed(FASTEST_MPS)
    flown(reached, 7.0, 4.6, 4.6, 4.6, 4.6, 4.8, 4.8, 4.8, 4.8)
    assert reached.max_mps == pytest.approx(4.8)
    flown(reached, 7.0, 6.7, 4.8, 4.8, 4.8)
    assert not reached.saturated


def test_what_it_lacked_counts_only_as_long_as_what_it_flew_then():
    """It lacked 0.5 m/s first, and 3 m/s afterwards, of which 0.8 m/s aren't enough."""
    reached, paused = ReachedSpeed(FASTEST_MPS), ReachedSpeed(FASTEST_MPS)
    assert (reached.saturated, reached.max_mps) == (False, math.inf)
    flown(reached, 7.0, 6.5, 4.0, 4.8, 4.8, 4.8)
    assert reached.saturated
    flown(paused, 7.0, 6.5)
    paused.pause()
    flown(paused, 7.0, 4.0, 4.8, 4.8, 4.8)
    assert paused.saturated


def test_a_limit_rises_by_0_05_mps2_while_it_is_not_saturated():
    """By 10 checks, each 0.4 s after the one before."""
    reached = ReachedSpeed(FASTEST_MPS)
    flown(reached, 7.0, 4.7, 4.7, 4.7, 4.7)
    flown(reached, 4.0, *[4.0] * 10)
    assert reached.max_mps == pytest.approx(4.9)


def test_a_limit_at_its_models_is_none_from_the_next_check_on():
    reached = ReachedSpeed(FASTEST_MPS)
    flown(reached, 10.0, *[FASTEST_MPS] * 4, course_rad=0.0)
    assert reached.max_mps == FASTEST_MPS
    flown(reached, 9.0, 9.0)
    assert reached.max_mps == math.inf

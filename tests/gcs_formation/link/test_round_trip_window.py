"""Mean, median and jitter of the recent round trips, and when the link's delay has stepped."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs_formation.link.round_trip_window import RoundTripWindow

TRIPS_S = st.lists(st.floats(0.0, 5.0), max_size=20)
QUIET_S = [0.1 + 0.001 * (number % 4) for number in range(16)]
"""Range 3 ms, median 101.5 ms, median deviation 1 ms."""


def filled(trips_s: list[float], off_s: float = 0.0) -> RoundTripWindow:
    window = RoundTripWindow()
    for trip_s in trips_s:
        window.add(trip_s, off_s)
    return window


@given(TRIPS_S)
def test_statistics_are_those_of_the_last_round_trips(trips_s: list[float]) -> None:
    """At most 16, since the last step of the link; 1.4826: a normal distribution's deviation by its median's."""
    window, kept = RoundTripWindow(), list[float]()
    for trip_s in trips_s:
        window.add(trip_s, 0.0)
        kept.append(trip_s)
        kept = kept[-8 if window.stepped else -16 :]
        assert window.count == len(kept)
        assert window.mean_s == pytest.approx(np.mean(kept))
        assert window.median_s == np.median(kept)
        deviation_s = np.std(kept, ddof=1) if len(kept) > 1 else 0.0
        assert window.jitter_s == pytest.approx(deviation_s, abs=1e-12)
        by_median_s = 1.4826 * np.median(np.abs(np.array(kept) - np.median(kept)))
        assert window.usual_jitter_s == pytest.approx(min(deviation_s, by_median_s), abs=1e-12)
        assert window.median_s == np.median(kept), "asked again"


def test_nothing_is_known_before_the_first() -> None:
    window = RoundTripWindow()
    assert math.isnan(window.mean_s)
    assert (window.median_s, window.jitter_s, window.usual_jitter_s, window.stepped) == (0.0, 0.0, 0.0, False)


@given(st.floats(-0.09, 1.0), st.floats(-0.5, 0.5))
def test_a_step_is_noticed_with_its_eighth_round_trip_and_leaves_the_new_ones_alone(
    more_s: float, off_s: float
) -> None:
    """Jitter of 3 ms is reported from a step by 4 · 3 ms + 4 · 1.4826 · 1 ms = 17.93 ms.

    The step of the samples is their median since then, if that is more than what is usual.
    """
    window = filled(QUIET_S)
    changed_s = [(trip_s + more_s, off_s + 0.001 * number) for number, trip_s in enumerate(QUIET_S[:8])]
    found = [(window.add(*each), window.stepped) for each in changed_s]
    far = abs(more_s) > 0.01793
    assert [stepped for _, stepped in found] == [False] * 7 + [far]
    step_s = off_s + 0.0035
    usual_s = 1.4826e-3
    assert [step for step, _ in found[:7]] == [0.0] * 7
    expected_s = step_s if far and abs(step_s) > usual_s else 0.0
    assert found[7][0] == pytest.approx(expected_s, abs=1e-9)
    assert window.count == (8 if far else 16)
    if far:
        assert window.mean_s == pytest.approx(0.1015 + more_s)
        window.add(0.1015 + more_s, 0.0)
        assert (window.count, window.stepped) == (9, False)


@pytest.mark.parametrize(("before", "stepped", "reported"), [(7, True, False), (8, True, True), (1, True, False)])
def test_the_first_round_trips_may_have_been_slow_by_anything(before: int, stepped: bool, reported: bool) -> None:
    """They are dropped, but before the window is full they tell no change of the link's delay."""
    window = filled([0.5] * before)
    found = [window.add(0.1, 0.2) for _ in range(8)]
    assert window.stepped == stepped
    assert (found[-1] == 0.2) == reported
    assert window.count == 8


def test_innovations_move_up_with_their_round_trips() -> None:
    """16 of before, of which each has its own, and eight of after: the median of these, 4.5, isn't one of those."""
    window = RoundTripWindow()
    for number in range(20):
        assert window.add(0.1, 100.0 + number) == 0.0
    assert [window.add(0.3, float(number)) for number in range(1, 9)][-1] == 4.5
    for number in range(8):
        assert window.add(0.3, 50.0 + number) == 0.0
    assert [window.add(0.1, -float(number)) for number in range(1, 9)][-1] == -4.5


@pytest.mark.parametrize(("wide_s", "stepped"), [(0.049, True), (0.051, False)])
def test_a_step_is_reported_from_round_trips_that_vary_afterwards(wide_s: float, stepped: bool) -> None:
    """By 200 ms: four times their range. Of a steady link before, the jitter is 0."""
    window = filled([0.1] * 16)
    for number in range(8):
        window.add(0.3 - wide_s / 2 + wide_s * number / 7, 0.0)
    assert window.stepped == stepped


@pytest.mark.parametrize(("wide_s", "stepped"), [(0.0318, True), (0.0324, False)])
def test_a_step_is_reported_from_round_trips_that_varied_before(wide_s: float, stepped: bool) -> None:
    """By 200 ms: four times 1.4826 times the median deviation, here 1.05 w; w = 32.1 ms."""
    window = filled([0.5 + wide_s * (-1) ** number * (1.1 if number % 4 < 2 else 1.0) for number in range(16)])
    for _ in range(8):
        window.add(0.3, 0.0)
    assert window.stepped == stepped

"""The clock by the narrowest corridor that holds all delays, for delays whose distribution is exact."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from gcs_formation.link.delay_edges import DelayEdges

NUMBER, PERIOD_S, DELAY_S = 128, 0.25, 0.1
OFFSET_S, DRIFT = 0.02, 4e-5


def spread_s(width_s: float, sharp: float, sharp_end: float, turn: int) -> np.ndarray:
    """Return delays, a quarter of which lies within 4 ** (1 / sharp) times the distance that a sixteenth does.

    That is of the shortest one; of the longest with `sharp_end`. The second half is the first one backwards, so that by
    symmetry the corridor has exactly the slope of the clock.
    """
    shares = (np.arange(NUMBER // 2) * turn % (NUMBER // 2)) / (NUMBER / 2 - 1.0)
    shares = np.concatenate((shares, shares[::-1]))
    near, far = 0.5 * (2.0 * shares) ** (1.0 / sharp), 1.0 - 0.5 * (2.0 * (1.0 - shares)) ** (1.0 / sharp_end)
    return DELAY_S + width_s * np.where(shares < 0.5, near, far)


def filled(up_s: np.ndarray, down_s: np.ndarray, loop_s: float = 0.0, drift: float = DRIFT) -> DelayEdges:
    edges, at_s = DelayEdges(loop_s), PERIOD_S * np.arange(len(up_s))
    ahead_s = OFFSET_S + drift * (at_s - at_s[-1])
    for each in zip(at_s.tolist(), (up_s + ahead_s).tolist(), (down_s - ahead_s).tolist(), strict=True):
        edges.add(*each)
    return edges


def alike(sharp: float, sharp_end: float) -> DelayEdges:
    return filled(spread_s(0.02, sharp, sharp_end, 37), spread_s(0.02, sharp, sharp_end, 75))


@pytest.mark.parametrize(("sharp", "found"), [(1.0, True), (1.3, True), (1.4, False), (2.0, False)])
def test_an_edge_is_sharp_where_the_density_does_not_vanish_at_it(sharp: float, found: bool) -> None:
    """4 ** (1 / 1.3) = 2.90, 4 ** (1 / 1.4) = 2.69; uniform delays have 4, normal ones some 1.7."""
    edges = alike(sharp, 1.0)
    assert edges.find(DRIFT) == found
    if found:
        assert edges.offset_s == pytest.approx(OFFSET_S, abs=1e-7)
        assert edges.drift == pytest.approx(DRIFT, abs=4e-9)
        assert edges.span_s == PERIOD_S * (NUMBER - 1)


@pytest.mark.parametrize(("sharp_end", "lever"), [(1.0, 2.0), (1.6, 2.0), (1.9, 3.6), (3.0, 3.6)])
def test_both_edges_know_the_clock_better_than_the_lower_ones(sharp_end: float, lever: float) -> None:
    """A delay in 126th of the width lies on each edge, so it is uncertain by that; half the difference of two by 1/√2.

    The end of the line is 2, or 3.6, times as uncertain. The longest delays count from 4 ** (1 / 1.76) = 2.2 on.
    """
    edges = alike(1.0, sharp_end)
    assert edges.find(DRIFT)
    assert edges.deviation_s == pytest.approx(lever * 0.02 / 126.0 / math.sqrt(2.0), rel=1e-3)
    assert edges.offset_s == pytest.approx(OFFSET_S, abs=1e-7)


@pytest.mark.parametrize("off", [-2e-5, 0.0, 2e-5])
@pytest.mark.parametrize("drift", [-2.5e-4, 4e-5, 2.5e-4])
def test_the_rate_need_not_be_known_well_before(drift: float, off: float) -> None:
    up_s, down_s = spread_s(0.02, 1.0, 1.0, 37), spread_s(0.02, 1.0, 1.0, 75)
    edges = filled(up_s, down_s, 0.0, drift)
    assert edges.find(drift + off)
    assert edges.drift == pytest.approx(drift, abs=4e-9)
    assert edges.offset_s == pytest.approx(OFFSET_S, abs=1e-7)


@pytest.mark.parametrize(("drift", "found"), [(-2e-3, -3e-4), (2e-3, 3e-4)])
def test_no_rate_is_found_that_no_crystal_has(drift: float, found: float) -> None:
    edges = filled(spread_s(1.0, 1.0, 1.0, 37), spread_s(1.0, 1.0, 1.0, 75), 0.0, drift)
    assert edges.find(drift)
    assert edges.drift == pytest.approx(found, rel=1e-4)


@pytest.mark.parametrize("loop_s", [0.0, 0.02, 0.04])
def test_the_longest_wait_for_the_answering_loop_is_no_delay(loop_s: float) -> None:
    """Up there is the wait besides, evenly from 0 to the loop's period; the offset is the same."""
    edges = filled(spread_s(0.02 + loop_s, 1.0, 1.0, 37), spread_s(0.02, 1.0, 1.0, 75), loop_s)
    assert edges.find(DRIFT)
    assert edges.offset_s == pytest.approx(OFFSET_S, abs=1e-7)


@pytest.mark.parametrize("fastest", [[2, 30], [17, 33], [40, 50], [0, 15, 16, 63]])
def test_two_of_the_fastest_are_used_if_they_are_not_among_the_same_sixteen(fastest: list[int]) -> None:
    """Where the corridor touches the delays twice, its rate is that of the clock; of 16 in a row one can touch it."""
    rng = np.random.default_rng(3)
    up_s, down_s = 0.1 + 1e-3 * rng.pareto(1.5, 64), 0.1 + 1e-3 * rng.pareto(1.5, 64)
    up_s[fastest] = down_s[fastest] = 0.09998
    edges = filled(up_s, down_s)
    assert edges.find(DRIFT)
    assert edges.drift == pytest.approx(DRIFT, abs=1e-8)
    assert edges.offset_s == pytest.approx(OFFSET_S, abs=1e-6)


def test_edges_are_found_again_after_a_thirty_second_part_more_and_again_once_all_is_forgotten() -> None:
    edges, due = DelayEdges(0.0), list[int]()
    for _ in range(2):
        due.clear()
        for number in range(1, 400):
            if edges.add(float(number), 0.1, 0.1):
                due.append(number)
        assert due[0] == 64
        assert due[-1] > 380
        assert all(later - sooner == later // 32 for sooner, later in pairwise(due))
        edges.clear()


def test_of_2048_round_trips_the_older_half_is_forgotten() -> None:
    """By the time that the edges' line spans, for delays that come again each 128."""
    edges, up_s, down_s = DelayEdges(0.0), spread_s(0.02, 1.0, 1.0, 37), spread_s(0.02, 1.0, 1.0, 75)
    for count, span_s in ((2048, 2047.0), (2049, 1024.0)):
        for number in range(0 if count == 2048 else 2048, count):
            edges.add(float(number), float(up_s[number % NUMBER]), float(down_s[number % NUMBER]))
        assert edges.find(0.0)
        assert edges.span_s == span_s

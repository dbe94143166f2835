"""The smallest delays, and how far from them shares of the others lie, without sorting all."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from librt.vecs import vec

from gcs_formation.link.delay_edges import CAPACITY, FEWEST, DelayEdges, ranked


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=80), st.data())
def test_a_value_of_a_rank_is_that_of_the_sorted_list_and_smaller_ones_move_to_its_left(
    delays_s: list[float], data: st.DataObject
) -> None:
    count = data.draw(st.integers(1, len(delays_s)))
    rank = data.draw(st.integers(0, count - 1))
    values = vec[float](delays_s)
    assert ranked(values, count, rank) == sorted(delays_s[:count])[rank]
    assert sorted(list(values)[:count]) == sorted(delays_s[:count])
    assert list(values)[count:] == delays_s[count:]
    assert all(each <= values[rank] for each in list(values)[:rank])


@pytest.mark.parametrize("fastest", [[0, FEWEST - 1], [0, 40], [20, FEWEST - 1]])
def test_the_clock_is_the_line_through_the_fastest_requests_and_answers_wherever_they_are(fastest: list[int]) -> None:
    """Behind a queue that is mostly empty: Pareto's delays, whose longest have no bound."""
    rng, edges, offset_s, drift = np.random.default_rng(3), DelayEdges(0.0), 0.02, 4e-5
    up_s, down_s = 0.1 + 1e-3 * rng.pareto(1.5, FEWEST), 0.1 + 1e-3 * rng.pareto(1.5, FEWEST)
    up_s[fastest] = down_s[fastest] = 0.09997
    at_s = 0.25 * np.arange(FEWEST)
    ahead_s = offset_s + drift * (at_s - at_s[-1])
    due = [edges.add(*each) for each in zip(at_s.tolist(), up_s + ahead_s, down_s - ahead_s, strict=True)]
    assert due == [False] * (FEWEST - 1) + [True]
    assert edges.find(3e-5)
    assert (edges.offset_s, edges.drift) == (pytest.approx(offset_s, abs=1e-7), pytest.approx(drift, abs=1e-8))
    assert edges.span_s == at_s[-1]


def test_the_older_half_is_forgotten_once_there_is_no_room() -> None:
    edges = DelayEdges(0.0)
    for number in range(CAPACITY + 1):
        edges.add(float(number), 0.1 + 1e-3 * (number % 7) ** 2, 0.1 + 1e-3 * (number % 11) ** 2)
    assert edges.find(0.0)
    assert edges.span_s == CAPACITY // 2

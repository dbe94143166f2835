"""Recorded delays are played by time, however many datagrams are sent."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import Instant, after
from airlink.impairment import Impairment, together
from airlink.one_way_channel import Channel
from airlink.random_streams import random_stream
from airlink.trace import Trace


def at(seconds: float) -> Instant:
    return after(Instant(0), seconds)


@given(
    st.lists(st.floats(0.0, 3.0), min_size=2, max_size=30),
    st.floats(0.05, 20.0),
    st.floats(0.0, 2000.0),
)
def test_the_delay_is_that_of_the_record_at_that_age_and_it_repeats(
    delays_s: list[float], period_s: float, now_s: float
) -> None:
    """Against numpy's interpolation over the record and its repetition."""
    times_s = [period_s * number for number in range(len(delays_s))]
    length_s = period_s * len(delays_s)
    expected_s = np.interp(now_s % length_s, [*times_s, length_s], [*delays_s, delays_s[0]])
    assert Trace(times_s, delays_s, period_s, gaps=True).delay_s(at(now_s)) == pytest.approx(expected_s, abs=1e-6)


def test_what_is_nearest_to_a_lost_sample_is_lost_and_its_neighbours_are_held() -> None:
    trace = Trace([0.0, 1.0, 2.0, 3.0], [0.1, 0.2, math.nan, 0.4], 1.0, gaps=True)
    found = {now_s: trace.delay_s(at(now_s)) for now_s in (0.5, 1.0, 1.4, 1.6, 2.0, 2.4, 2.6, 3.0, 3.5)}
    assert found == {
        0.5: pytest.approx(0.15), 1.0: 0.2, 1.4: 0.2, 1.6: None, 2.0: None, 2.4: None, 2.6: 0.4, 3.0: 0.4,
        3.5: pytest.approx(0.25),
    }  # fmt: skip


def test_a_gap_in_a_steady_record_is_lost_and_one_in_an_unsteady_record_is_not() -> None:
    times_s, delays_s = [0.0, 1.0, 2.0, 6.0, 7.0], [0.1, 0.1, 0.1, 0.5, 0.5]
    steady, unsteady = (Trace(times_s, delays_s, 1.0, gaps=gaps) for gaps in (True, False))
    assert [steady.delay_s(at(now_s)) for now_s in (2.4, 2.6, 4.0, 5.4, 5.6)] == [0.1, None, None, None, 0.5]
    assert unsteady.delay_s(at(4.0)) == pytest.approx(0.3)


@pytest.mark.parametrize("often_hz", [7.0, 70.0])
def test_the_mean_delay_is_the_records_own_however_often_datagrams_are_sent(often_hz: float) -> None:
    """5 Hz with a mean of 332 ms whose delays fall no faster than time goes on, as over one queue."""
    random, delays_s = np.random.default_rng(4), [0.3]
    for _ in range(1499):
        delays_s.append(max(0.05, delays_s[-1] - 0.15, random.gamma(2.0, 0.13)))
    delays_s = [each * 0.332 / float(np.mean(delays_s)) for each in delays_s]
    times_s = [0.2 * number for number in range(len(delays_s))]
    impairment = Impairment(process=Trace(times_s, delays_s, 0.2, gaps=True))
    channel = Channel(random_stream(1, "links", 1))
    for number in range(int(300.0 * often_hz)):
        channel.pass_on(60, at((number + 0.37) / often_hz), impairment)
    assert channel.statistics.mean_delay_s == pytest.approx(0.332, rel=0.03)
    assert channel.statistics.lost == 0


def test_two_processes_add_their_delays_and_either_loses() -> None:
    trace = Trace([0.0, 1.0], [0.1, math.nan], 1.0, gaps=False)
    both = together(trace, lambda size_bytes, now: None if size_bytes > 100 else 0.5)
    assert (both(50, at(0.0)), both(200, at(0.0)), both(50, at(1.0))) == (0.6, None, None)
    assert together(trace, None) is trace


@pytest.mark.parametrize(("begin_s", "now_s", "expected_s"), [(0.0, 1.0, 0.2), (1.0, 0.0, 0.2), (2.0, 2.0, 0.2)])
def test_a_run_may_begin_at_any_part_of_the_record(begin_s, now_s, expected_s):
    """Three samples a second apart are repeated after 3 s."""
    trace = Trace([0.0, 1.0, 2.0], [0.1, 0.2, 0.3], 1.0, gaps=True, begin_s=begin_s)
    assert trace.delay_s(at(now_s)) == pytest.approx(expected_s, abs=1e-6)


def test_drawn_delays_vary_as_much_as_recorded_ones_and_interpolated_ones_by_two_thirds_of_that() -> None:
    """Of (1 - f) a + f b, f from 0 to 1, the variance is the mean of (1 - f)^2 + f^2: 2/3 of that of a and b."""
    delays_s = np.random.default_rng(5).normal(0.25, 0.03, 3000)
    variances = []
    for drawn in (True, False):
        trace = Trace([0.1 * each for each in range(3000)], list(delays_s), 0.1, gaps=True, drawn=drawn)
        variances.append(np.var([trace.delay_s(at(0.0137 * number)) or 0.0 for number in range(20_000)]))
    assert variances == pytest.approx([np.var(delays_s), 2.0 / 3.0 * np.var(delays_s)], rel=0.05)


def test_drawn_delays_are_those_of_samples_around_and_independent() -> None:
    """Those of one instant, too, as the datagrams of a burst."""
    trace = Trace(list(range(20)), [0.1 * each for each in range(20)], 1.0, gaps=True, drawn=True)
    drawn = [trace.delay_s(at(8.5)) or 0.0 for _ in range(2000)]
    assert {round(10.0 * each) for each in drawn} == set(range(4, 14))
    assert abs(float(np.corrcoef(drawn[:-1], drawn[1:])[0, 1])) < 0.1


def test_what_is_nearest_to_a_lost_sample_is_lost_where_delays_are_drawn_too() -> None:
    trace = Trace([0.0, 1.0, 2.0], [0.1, math.nan, 0.3], 1.0, gaps=True, drawn=True)
    assert trace.delay_s(at(0.9)) is None
    assert {trace.delay_s(at(0.4)) for _ in range(100)} == {0.1, 0.3}

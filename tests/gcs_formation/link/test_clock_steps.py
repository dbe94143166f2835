"""How far off the mapped clock can be, and which steps of it are a pause, a restart or another vehicle's clock."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import NANOSECONDS, Instant, after
from gcs_formation.link.clock_sync import ClockSync

DELAYS_S = st.lists(st.tuples(st.floats(0.0, 0.4), st.floats(0.0, 0.4)), min_size=1, max_size=20)


def exchange(sync: ClockSync, at_s: float, up_s: float, down_s: float, offset_s: float) -> bool:
    """Ask at a time; the vehicle's clock is ahead of ours by `offset_s` when the request arrives."""
    sent = after(Instant(0), at_s)
    return sync.observe(sent, round((at_s + up_s + offset_s) * NANOSECONDS), after(sent, up_s + down_s))


def steady(offset_s: float, probes: int = 60, half_s: float = 0.1) -> ClockSync:
    sync = ClockSync()
    for number in range(probes):
        assert not exchange(sync, 0.25 * number, half_s, half_s, offset_s)
    return sync


@given(st.floats(1e3, 1e6), DELAYS_S, st.floats(0.0, 5e-5))
def test_the_clock_is_off_by_no_more_than_half_of_the_longest_round_trip(
    offset_s: float, delays_s: list[tuple[float, float]], drift: float
) -> None:
    """Whatever the delays are: the vehicle read its clock while the round trip lasted (Cristian 1989).

    What the filters add is a drift that one sample can't tell from an offset; the unequal parts of alike round trips
    are left.
    """
    sync, longest_s = ClockSync(), 0.0
    assert all(math.isnan(each) for each in (sync.offset_s, sync.one_way_s, sync.round_trip_s))
    for number, (up_s, down_s) in enumerate(delays_s):
        exchange(sync, 0.25 * number, up_s, down_s, offset_s + drift * (0.25 * number + up_s))
        longest_s = max(longest_s, up_s + down_s)
        assert abs(sync.offset_s - offset_s) <= longest_s / 2.0 + 1e-3
        assert sync.samples == number + 1
        assert 0.0 <= sync.one_way_s <= longest_s / 2.0 + 1e-9
        assert abs(sync.asymmetry_s) <= sync.one_way_s
        assert sync.last_one_way_s() == pytest.approx((up_s + down_s) / 2.0, abs=1e-9)


@given(st.lists(st.floats(0.0, 0.4), min_size=1, max_size=20), st.floats(0.0, 0.4))
def test_jitter_that_is_alike_both_ways_leaves_the_clock_exact_and_a_constant_difference_half_of_it(
    halves_s: list[float], more_s: float
) -> None:
    """Offset = (up - down) / 2 too much."""
    equal, uneven = ClockSync(), ClockSync()
    for number, half_s in enumerate(halves_s):
        exchange(equal, 0.25 * number, half_s, half_s, 2000.0)
        exchange(uneven, 0.25 * number, half_s + more_s, half_s, 2000.0)
    assert equal.offset_s == pytest.approx(2000.0, abs=1e-7)
    assert uneven.offset_s == pytest.approx(2000.0 + more_s / 2.0, abs=1e-7)
    assert equal.offset_at_s(1e4) == pytest.approx(2000.0, abs=1e-4)


@pytest.mark.parametrize(("behind_s", "followed"), [(1.099, False), (1.101, True)])
def test_a_clock_that_is_off_by_more_than_a_second_and_half_the_round_trip_has_stepped(
    behind_s: float, followed: bool
) -> None:
    """A pause: it is followed at once; less is taken for delay, of which one sample moves the clock by a part."""
    sync = steady(500.0)
    assert not exchange(sync, 20.0, 0.1, 0.1, 500.0 - behind_s)
    assert (sync.offset_s == pytest.approx(500.0 - behind_s, abs=1e-9)) == followed
    assert sync.offset_s < 500.0 - 1e-6


@pytest.mark.parametrize(("ahead_s", "another"), [(0.099, False), (0.101, True)])
def test_a_paused_clock_makes_up_for_no_more_than_it_had_lost(ahead_s: float, another: bool) -> None:
    """It had been farthest ahead at first, 20.1 s before, and may run 2 % fast; half the round trip is uncertain."""
    sync = steady(500.0, 40)
    for number in range(60, 80):
        assert not exchange(sync, 0.25 * number, 0.1, 0.1, 495.0)
    assert exchange(sync, 20.0, 0.1, 0.1, 500.0 + 0.02 * 20.0 + ahead_s) == another


@pytest.mark.parametrize(("more_ns", "another"), [(-1, True), (0, False)])
def test_a_clock_that_shows_less_than_before_is_another_one(more_ns: int, another: bool) -> None:
    """One that was paused all the while shows the same."""
    sync = ClockSync()
    for number in range(40):
        exchange(sync, 0.25 * number, 0.1, 0.1, 500.0)
    sent = after(Instant(0), 15.0)
    assert sync.observe(sent, 509_850_000_000 + more_ns, after(sent, 0.2)) == another


@pytest.mark.parametrize(("shown_s", "restarted"), [(102.203, True), (102.205, False)])
def test_a_clock_that_has_run_since_it_was_last_asked_or_shorter_has_restarted(shown_s: float, restarted: bool) -> None:
    """From 0 s, when it was asked last, to 100.2 s; it may run 2 % fast, and shows 1.1 s more than expected."""
    sync = ClockSync()
    exchange(sync, 0.0, 0.1, 0.1, 1.0)
    assert exchange(sync, 100.0, 0.1, 0.1, shown_s - 100.1) == restarted
    assert sync.samples == 2


def test_what_is_asked_last_counts_in_whatever_order_answers_come() -> None:
    sync = ClockSync()
    for sent_s in (5.0, 4.0):
        exchange(sync, sent_s, 0.1, 0.1 + (5.0 - sent_s), 1.0)
        assert sync.asked == after(Instant(0), 5.0)
    exchange(sync, 6.0, 0.1, 0.1, 1.0)
    assert sync.asked == after(Instant(0), 6.0)


def test_a_restarted_clock_begins_without_what_was_known() -> None:
    sync = ClockSync()
    for number in range(60):
        exchange(sync, 0.25 * number, 0.05 if number < 40 else 0.35, 0.05, 500.0 + 0.015 * 0.25 * number)
    assert abs(sync.asymmetry_s) > 0.01
    assert sync.drift > 1e-3
    assert exchange(sync, 15.0, 0.2, 0.2, -14.0)
    assert (sync.asymmetry_s, sync.drift) == (0.0, 0.0)
    assert sync.offset_s == pytest.approx(-14.0, abs=1e-9)
    assert sync.drift_deviation == pytest.approx(5e-5)
    assert not exchange(sync, 15.25, 0.2, 0.2, -14.0)


@pytest.mark.parametrize(("jitter_s", "wants"), [(0.0, False), (0.004, False), (0.009, True), (0.02, True)])
def test_more_round_trips_are_wanted_while_jitter_leaves_the_clock_uncertain(jitter_s: float, wants: bool) -> None:
    """Beyond 5 ms of round trips, until the clock's deviation is 0.25 ms. The wait for the loop, 5.8 ms, isn't counted.

    It is s / 2 / √n, at the end of a line of unknown slope twice as much; the estimate is on the safe side.
    """
    rng, sync = np.random.default_rng(2), ClockSync(0.02)
    assert math.isnan(sync.offset_deviation_s)
    for number in range(300):
        wait_s, more_s = 0.02 * ((0.618034 * number) % 1.0), jitter_s / math.sqrt(2.0) * rng.standard_normal(2)
        exchange(sync, 0.25 * number, 0.1 + wait_s + float(more_s[0]), 0.1 + float(more_s[1]), 3.0)
        if number > 100:
            assert sync.wants_more == (wants and sync.offset_deviation_s > 0.25e-3)
    expected_s = jitter_s / math.sqrt(300.0)
    assert 0.8 * expected_s < sync.offset_deviation_s < 1.3 * expected_s + 0.3e-3


def test_more_round_trips_are_wanted_until_two_vehicles_clocks_put_them_off_by_less_than_a_centimetre() -> None:
    """Of 7 ms jitter 0.25 ms is left after some 1000: at 22 m/s, and by both clocks, 0.8 cm.

    Fewer would leave twice as much, which is seen between vehicles; a quarter of it would take an hour.
    """
    rng, sync, number = np.random.default_rng(1), ClockSync(), 0
    while number < 100 or (sync.wants_more and number < 1500):
        up_s, down_s = (0.1 + 7e-3 / math.sqrt(2.0) * rng.standard_normal(2)).tolist()
        exchange(sync, 0.25 * number, up_s, down_s, 3.0)
        number += 1
    off_m = 22.0 * math.sqrt(2.0) * sync.offset_deviation_s
    assert 0.7e-2 < off_m < 0.9e-2


@pytest.mark.parametrize("split_s", [0.05, -0.05, 0.4, -0.4])
def test_stamps_are_mapped_as_by_another_link_as_far_as_delays_can_be_split(split_s: float) -> None:
    """Two links with delays 0.1 s on average, of which one is split unequally; no delay is less than nothing."""
    known, uneven = steady(500.0), ClockSync()
    for number in range(60):
        exchange(uneven, 0.25 * number, 0.1, 0.1, 500.0 + split_s)
    now = after(Instant(0), 15.0)
    uneven.continue_from(known, now)
    assert uneven.asymmetry_s == pytest.approx(max(-0.1, min(0.1, split_s)), abs=1e-6)
    if abs(split_s) < 0.1:
        assert uneven.to_instant(512.0) == pytest.approx(known.to_instant(512.0), abs=1e3)
        assert uneven.age_s(512.0, now) == pytest.approx(3.0, abs=1e-6)
    uneven.continue_from(uneven, now)
    assert uneven.asymmetry_s == pytest.approx(max(-0.1, min(0.1, split_s)), abs=1e-6)


@pytest.mark.parametrize("wait_s", [0.0, 0.005, 0.02])
@pytest.mark.parametrize("jitter_s", [0.0, 0.1])
def test_the_wait_for_the_answering_loop_is_known_where_it_alone_makes_round_trips_vary(
    wait_s: float, jitter_s: float
) -> None:
    """The first sample of a clock that was paused shows what it is off by: half of what isn't known of the wait.

    With other jitter that is up to half of 10 ms.
    """
    sync = ClockSync(0.02)
    for number in range(32):
        each_s = 0.02 * (number % 16 + 0.5) / 16.0
        exchange(sync, 0.25 * number, 0.1 + each_s + jitter_s * (number % 2), 0.1 + jitter_s * (number % 2), 503.0)
    exchange(sync, 20.0, 0.1 + wait_s + jitter_s / 2.0, 0.1 + jitter_s / 2.0, 498.0)
    expected_s = 498.0 if jitter_s == 0.0 else 498.0 + (wait_s - 0.01) / 2.0
    assert sync.offset_s == pytest.approx(expected_s, abs=0.5e-3)


def mapped(up_s: np.ndarray, down_s: np.ndarray, delay_s: float = 0.1, drift: float = 0.0) -> ClockSync:
    sync = ClockSync()
    for number, (more_s, less_s) in enumerate(zip(up_s.tolist(), down_s.tolist(), strict=True)):
        at_s = 0.25 * number
        exchange(sync, at_s, delay_s + more_s, delay_s + less_s, 7.0 + drift * (at_s + delay_s + more_s))
    return sync


@pytest.mark.parametrize(("delay_s", "drift"), [(0.1, 0.0), (0.5, 5e-5)])
def test_sharp_bounds_of_the_delays_tell_the_clock_where_they_say_what_the_means_do(
    delay_s: float, drift: float
) -> None:
    """Uniform over 40 ms each way. The mean would be off by 1.05 ms: 2 / √240 of 40 ms / √24 (the end of a line)."""
    off_s, at_s = list[float](), 0.25 * 239 + delay_s
    for seed in range(2):
        up_s, down_s = np.random.default_rng(seed).uniform(0.0, 0.04, (2, 240))
        sync = mapped(up_s, down_s, delay_s, drift)
        off_s.append(sync.offset_at_s(at_s) - 7.0 - drift * at_s)
        assert sync.offset_deviation_s < 0.5e-3
    assert np.sqrt(np.mean(np.square(off_s))) < 0.5e-3


def test_where_one_way_alone_varies_the_means_are_kept() -> None:
    """By 200 ms at most, of density 4 (1 - x)³, mean 1/5: the shortest say 0, the means 20 ms less; one isn't right."""
    for seed in range(3):
        sync = mapped(np.zeros(100), 0.2 * np.random.default_rng(seed).beta(1.0, 4.0, 100))
        assert sync.offset_s - 7.0 == pytest.approx(-0.02, abs=0.008)


@pytest.mark.parametrize(("width_s", "by_edges"), [(0.004, False), (0.0055, True)])
def test_edges_count_from_a_deviation_of_both_delays_of_two_milliseconds_on(width_s: float, by_edges: bool) -> None:
    """Of uniform delays the width / √6; by the means the clock's would be 0.13 and 0.16 ms, 2 / √240 of a sample's."""
    sync = mapped(*np.random.default_rng(1).uniform(0.0, width_s, (2, 240)))
    assert (sync.offset_deviation_s < 0.08e-3) == by_edges

"""TIMESYNC requests: which message answers which, how many are overdue, and how long the last round trips were."""

from __future__ import annotations

import math

import pytest

from airlink.clock import Instant, after
from airlink.messages.system import Timesync
from gcs_formation.link.round_trips import KNOWN_TRIPS, MAX_PENDING, RoundTrips

BOOTED_NS = 500_000_000_000


def at(seconds: float) -> Instant:
    return after(Instant(0), seconds)


def answer(request: Timesync) -> Timesync:
    """Return what a vehicle answers, whose clock is 500 s ahead."""
    return Timesync(request.ts1_ns + BOOTED_NS, request.ts1_ns)


def test_an_answer_counts_once_and_one_to_nothing_that_was_asked_doesnt() -> None:
    """Other stations' answers come here too where a router passes on all, and a second link delivers each twice."""
    trips = RoundTrips(0.0)
    first, second = (answer(trips.request(at(each))) for each in (1.0, 1.25))
    others = answer(Timesync(0, at(1.1)))
    assert not trips.awaits(others)
    assert not trips.is_answer(others)
    for late in (second, first):
        assert trips.awaits(late)
        assert trips.is_answer(late)
        assert not trips.awaits(late)
        assert not trips.is_answer(late)


def test_a_request_is_no_answer() -> None:
    trips = RoundTrips(0.0)
    request = trips.request(at(1.0))
    assert not trips.awaits(request)
    assert not trips.awaits(None)


def test_requests_are_overdue_that_nothing_has_answered_within_the_usual_time() -> None:
    trips = RoundTrips(0.0)
    asked = [trips.request(at(each)) for each in (1.0, 1.25, 1.5, 1.75)]
    assert [trips.overdue(0.4, at(now_s)) for now_s in (1.3, 1.45, 1.7, 2.0, 2.2)] == [0, 1, 2, 3, 4]
    second = answer(asked[1])
    assert trips.is_answer(second)
    trips.measure(second, at(2.0))
    assert trips.overdue(0.4, at(2.2)) == 2, "an answer to a later one shows that the link passes"
    trips.record_answer(at(2.0))
    assert trips.overdue(0.4, at(2.2)) == 1, "a command that was answered shows so too, for those of 0.4 s before"


@pytest.mark.parametrize(("late_s", "counts"), [(60.0, True), (100.0, False)])
def test_an_answer_counts_that_a_link_delivers_a_minute_late_and_no_later_one(late_s: float, counts: bool) -> None:
    """A modem may hold frames for so long; four requests a second go out meanwhile, which aren't kept for ever."""
    trips, asked_s = RoundTrips(0.0), [0.25 * number for number in range(round(4.0 * late_s))]
    first, *_ = [answer(trips.request(at(each))) for each in asked_s]
    assert trips.awaits(first) == counts


def test_of_requests_that_are_never_answered_the_newest_are_kept() -> None:
    trips = RoundTrips(0.0)
    asked = [answer(trips.request(at(0.25 * number))) for number in range(MAX_PENDING + 1)]
    assert [trips.awaits(each) for each in asked[:2]] == [False, True]
    assert trips.awaits(asked[-1])
    trips.forget_requests(at(100.0))
    assert not any(trips.awaits(each) for each in asked)


def test_the_longest_and_the_shortest_of_the_last_round_trips_are_those_that_ended_since() -> None:
    trips = RoundTrips(0.0)
    for sent_s, trip_s in ((1.0, 0.3), (2.0, 0.1), (3.0, 0.2)):
        trips.measure(answer(trips.request(at(sent_s))), at(sent_s + trip_s))
    assert (trips.longest_s(at(0.0)), trips.shortest_s(at(0.0), 3)) == (pytest.approx(0.3), pytest.approx(0.1))
    assert (trips.longest_s(at(1.5)), trips.shortest_s(at(2.5), 1)) == (pytest.approx(0.2), pytest.approx(0.2))
    assert math.isnan(trips.longest_s(at(3.5)))
    assert math.isnan(trips.shortest_s(at(1.5), 3))


@pytest.mark.parametrize(("last_s", "steady"), [(0.302, True), (0.31, False), (0.29, False)])
def test_a_clock_is_steady_once_it_is_known_by_many_round_trips_of_which_the_last_are_alike(
    last_s: float, steady: bool
) -> None:
    trips = RoundTrips(0.0)
    for number in range(KNOWN_TRIPS):
        assert not trips.steady
        sent, trip_s = at(0.5 * number), last_s if number == KNOWN_TRIPS - 1 else 0.3
        request = answer(trips.request(sent))
        assert trips.is_answer(request)
        trips.measure(request, after(sent, trip_s))
    assert trips.steady == steady
    trips.request(at(200.0))
    trips.request(at(201.0))
    assert not trips.steady, "two requests haven't been answered"


def test_a_clock_is_steady_once_the_wait_for_the_vehicles_loop_leaves_a_fifth_of_a_millisecond_of_it() -> None:
    """Uniform over a loop of 20 ms it deviates by 5.8 ms, and a midpoint by half of that.

    Requests become rarer then: after fewer the clock would stay less certain, and more tell little that is new.
    """
    trips, number = RoundTrips(0.02), 0
    while not trips.steady and number < 1000:
        sent, wait_s = at(0.25 * number), 0.02 * ((0.618034 * number) % 1.0)
        request = trips.request(sent)
        reply = Timesync(after(sent, 0.05 + wait_s) + BOOTED_NS, request.ts1_ns)
        assert trips.is_answer(reply)
        trips.measure(reply, after(sent, 0.1 + wait_s))
        number += 1
    left_s = 0.02 / math.sqrt(12.0) / 2.0 / math.sqrt(number)
    assert left_s == pytest.approx(0.2e-3, rel=0.1)
    assert abs(trips.clock.offset_s - BOOTED_NS / 1e9) < 1e-3

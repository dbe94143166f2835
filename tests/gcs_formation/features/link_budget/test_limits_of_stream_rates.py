"""How many messages are too many, and how often a vehicle is asked, at the limits."""

from __future__ import annotations

from itertools import pairwise

import pytest

from airlink import mavlink as m
from tests.gcs_formation.features.link_budget.test_stream_rates import WIND, Streamed

POSITION = m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT


@pytest.mark.parametrize(("rate_hz", "asked"), [(1, False), (2, True)])
def test_two_more_than_half_as_many_again_in_five_seconds_are_too_many(rate_hz: int, asked: bool) -> None:
    """Of 0.6 Hz: 4.5 and two more."""
    assert bool(Streamed().receive(7, {WIND: rate_hz}, 0.6)) is asked


@pytest.mark.parametrize(("wanted_hz", "asked"), [(0.4, False), (0.39, True)])
def test_as_many_are_not_too_many(wanted_hz: float, asked: bool) -> None:
    """Five in five seconds: 3 by 0.4 Hz, and two more."""
    assert bool(Streamed().receive(7, {WIND: 1}, wanted_hz)) is asked


def test_one_that_begins_in_a_window_is_counted_from_its_first() -> None:
    """Six in five seconds, by 0.4 Hz; beside others that come as they should."""
    streamed = Streamed()
    assert streamed.receive(1, {POSITION: 4}, 0.4) == []
    assert streamed.receive(3, {POSITION: 4, WIND: 2}, 0.4) == []
    assert streamed.receive(2, {POSITION: 4}, 0.4) == [(WIND, 2_500_000)]


def test_windows_are_counted_again_after_other_rates_are_wanted() -> None:
    streamed = Streamed()
    streamed.receive(5, {WIND: 4})
    streamed.streams.clear()
    assert streamed.receive(5, {WIND: 4}) == []
    assert streamed.receive(1, {WIND: 4}) != []


def test_requests_go_on_every_five_minutes_and_a_third() -> None:
    streamed = Streamed()
    asked_at = [second for second in range(1700) if streamed.receive(1, {WIND: 1}, 0.0)]
    assert max(later - earlier for earlier, later in pairwise(asked_at)) == 320

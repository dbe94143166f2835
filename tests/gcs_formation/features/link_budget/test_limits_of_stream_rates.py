"""How many messages are too many, and how often a vehicle is asked, at the limits."""

from __future__ import annotations

from itertools import pairwise

import pytest

from tests.gcs_formation.features.link_budget.test_stream_rates import WIND, Streamed


@pytest.mark.parametrize(("rate_hz", "asked"), [(1, False), (2, True)])
def test_two_more_than_half_as_many_again_in_five_seconds_are_too_many(rate_hz: int, asked: bool) -> None:
    """Of 0.6 Hz: 4.5 and two more."""
    assert bool(Streamed().receive(7, {WIND: rate_hz}, 0.6)) is asked


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

"""When heartbeats leave: once a second, at the tick nearest to each second, at any rate of ticks."""

from __future__ import annotations

import pytest

from airlink.clock import NANOSECONDS, Instant, after
from gcs_formation.fleet.heartbeats import HeartbeatScheduler

SECONDS = 120


def times_s(rate_hz: float) -> list[float]:
    """Return when heartbeats leave, s, by ticks on the station's grid."""
    tick_s, now, found = 1.0 / rate_hz, Instant(0), list[float]()
    schedule = HeartbeatScheduler({}, lambda *_: None, tick_s=tick_s)
    while now < (SECONDS - 0.5) * NANOSECONDS:
        if schedule.heartbeat_due(now):
            found.append(now / NANOSECONDS)
        now = after(now, tick_s)
    return found


@pytest.mark.parametrize("rate_hz", [1.5, 3.0, 7.0, 9.0, 30.0, 60.0])
def test_a_heartbeat_leaves_once_a_second_where_ticks_do_not_divide_one(rate_hz: float) -> None:
    found = times_s(rate_hz)
    assert len(found) == SECONDS
    assert found == pytest.approx(range(SECONDS), abs=0.5 / rate_hz + 1e-6)


@pytest.mark.parametrize("rate_hz", [1.0, 2.0, 5.0, 10.0, 20.0, 50.0])
def test_a_heartbeat_leaves_at_each_full_second_where_ticks_divide_one(rate_hz: float) -> None:
    assert times_s(rate_hz) == list(range(SECONDS))


def test_a_heartbeat_leaves_at_every_tick_where_these_are_rarer_than_one_a_second() -> None:
    assert times_s(0.5) == list(range(0, SECONDS, 2))


def test_a_late_heartbeat_is_followed_by_the_next_one_a_second_later() -> None:
    schedule = HeartbeatScheduler({}, lambda *_: None, tick_s=0.1)
    assert schedule.heartbeat_due(Instant(0))
    assert schedule.heartbeat_due(after(Instant(0), 3.2))
    assert not schedule.heartbeat_due(after(Instant(0), 4.1))
    assert schedule.heartbeat_due(after(Instant(0), 4.2))


def test_a_hastened_heartbeat_is_due_at_once_and_the_next_one_a_second_later() -> None:
    schedule = HeartbeatScheduler({}, lambda *_: None, tick_s=0.1)
    assert schedule.heartbeat_due(Instant(0))
    schedule.hasten(after(Instant(0), 0.4))
    assert schedule.heartbeat_due(after(Instant(0), 0.4))
    assert not schedule.heartbeat_due(after(Instant(0), 1.3))
    assert schedule.heartbeat_due(after(Instant(0), 1.4))

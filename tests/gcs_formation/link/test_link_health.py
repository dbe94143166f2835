"""The table of link states."""

from __future__ import annotations

import pytest

from airlink.clock import Instant, after
from gcs_formation.link.frame_loss import STALE_AFTER_S
from gcs_formation.link.link_health import LOST_AFTER_S, Connection, LinkState

START = Instant(0)


def test_silence_leads_through_stale_to_lost_and_a_heartbeat_back() -> None:
    connection = Connection(0)
    assert connection.record_frame(START, heartbeat=True)
    assert connection.check(after(START, STALE_AFTER_S + 0.1))
    assert connection.state is LinkState.STALE
    assert connection.check(after(START, LOST_AFTER_S + 0.1))
    assert connection.state is LinkState.LOST
    assert not connection.record_frame(after(START, 7.0), heartbeat=False)
    assert connection.record_frame(after(START, 7.1), heartbeat=True)
    assert connection.state is LinkState.CONNECTED


def test_telemetry_without_heartbeats_is_a_link_without_heartbeats() -> None:
    connection = Connection(0)
    connection.record_frame(START, heartbeat=True)
    for tenth in range(1, 36):
        assert not connection.record_frame(after(START, 0.1 * tenth), heartbeat=False)
        assert not connection.check(after(START, 0.1 * tenth))
    connection.record_frame(after(START, 3.6), heartbeat=False)
    assert connection.check(after(START, 3.6))
    assert connection.state is LinkState.MUTE
    assert not connection.record_frame(after(START, 4.0), heartbeat=True)  # because of a change of mode
    assert connection.record_frame(after(START, 5.0), heartbeat=True)
    assert connection.state is LinkState.CONNECTED


def received_without_heartbeats(lost_s: tuple[float, ...], before: tuple[float, ...] = ()) -> Connection:
    """Return a connection of 3.6 s in which a frame came each 0.1 s, but for those lost after these times.

    The last heartbeat came at the start, others `before` by so many seconds.
    """
    connection = Connection(0)
    for each in before:
        connection.record_frame(after(START, -each), heartbeat=True)
    connection.record_frame(START, heartbeat=True)
    for tenth in range(1, 37):
        now = after(START, 0.1 * tenth)
        if any(0.05 < 0.1 * tenth - each < 0.15 for each in lost_s):
            connection.skipped(now)
        connection.record_frame(now, heartbeat=False)
    return connection


@pytest.mark.parametrize("lost_s", [(1.0, 2.0, 3.0), (0.8, 2.2, 2.9), tuple(0.1 * tenth for tenth in range(36))])
def test_heartbeats_may_have_been_lost_where_frames_were_when_each_was_due(lost_s: tuple[float, ...]) -> None:
    connection = received_without_heartbeats(lost_s)
    assert not connection.check(after(START, 3.6), loss=0.2)  # five are lost with a probability of 1/3000
    assert connection.check(after(START, 3.6), loss=0.001)


@pytest.mark.parametrize("lost_s", [(), (1.0, 2.0), (1.0, 2.0, 2.5), (1.5, 2.0, 3.0)])
def test_a_heartbeat_that_was_due_while_no_frame_was_lost_was_not_sent(lost_s: tuple[float, ...]) -> None:
    assert received_without_heartbeats(lost_s).check(after(START, 3.6), loss=0.2)


@pytest.mark.parametrize("off_s", [0.0, 0.02, -0.02])
def test_punctual_heartbeats_are_not_among_frames_lost_well_before_or_after_they_were_due(off_s: float) -> None:
    before = tuple(each + off_s * (-1) ** each for each in range(12, 0, -1))
    lost_s = (0.75, 2.15, 2.75)
    assert received_without_heartbeats(lost_s, before).check(after(START, 3.6), loss=0.2)
    assert not received_without_heartbeats(lost_s).check(after(START, 3.6), loss=0.2)
    assert not received_without_heartbeats((0.9, 2.0, 2.9), before).check(after(START, 3.6), loss=0.2)


def test_heartbeats_that_come_by_chance_may_be_among_frames_lost_at_some_distance() -> None:
    before = tuple(each + 0.12 * (-1) ** each for each in range(12, 0, -1))
    assert not received_without_heartbeats((0.75, 2.15, 2.75), before).check(after(START, 3.6), loss=0.2)


def test_heartbeats_are_not_missing_after_a_silence_of_everything() -> None:
    connection = Connection(0)
    connection.record_frame(START, heartbeat=True)
    assert connection.check(after(START, 4.0))
    assert connection.record_frame(after(START, 4.1), heartbeat=False)
    assert not connection.check(after(START, 4.2))
    assert connection.state is LinkState.CONNECTED


def test_only_a_heartbeat_makes_the_first_contact() -> None:
    connection = Connection(0)
    assert not connection.record_frame(START, heartbeat=False)
    assert connection.state is LinkState.SEARCHING


def test_searching_never_becomes_lost() -> None:
    connection = Connection(0)
    assert not connection.check(after(START, 1e6))

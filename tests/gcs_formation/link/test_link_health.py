"""The table of link states."""

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
    assert not connection.check(after(START, 3.6), loss=0.2)  # five are lost with a probability of 1/3000
    assert connection.check(after(START, 3.6))
    assert connection.state is LinkState.MUTE
    assert not connection.record_frame(after(START, 4.0), heartbeat=True)  # because of a change of mode
    assert connection.record_frame(after(START, 5.0), heartbeat=True)
    assert connection.state is LinkState.CONNECTED


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

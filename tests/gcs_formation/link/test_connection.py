"""The connection table."""

from airlink.clock import Instant, after
from gcs_formation.link.connection import LOST_AFTER_S, STALE_AFTER_S, Connection, LinkState

START = Instant(0)


def test_silence_leads_through_stale_to_lost_and_a_heartbeat_back() -> None:
    connection = Connection(0)
    assert connection.heard(START, heartbeat=True)
    assert connection.check(after(START, STALE_AFTER_S + 0.1))
    assert connection.state is LinkState.STALE
    assert connection.check(after(START, LOST_AFTER_S + 0.1))
    assert connection.state is LinkState.LOST
    assert not connection.heard(after(START, 7.0), heartbeat=False)
    assert connection.heard(after(START, 7.1), heartbeat=True)
    assert connection.state is LinkState.CONNECTED


def test_only_a_heartbeat_makes_the_first_contact() -> None:
    connection = Connection(0)
    assert not connection.heard(START, heartbeat=False)
    assert connection.state is LinkState.SEARCHING


def test_searching_never_becomes_lost() -> None:
    connection = Connection(0)
    assert not connection.check(after(START, 1e6))

"""Silence, heartbeats and reports of radios: each limit from both sides."""

from __future__ import annotations

import math

import pytest

from airlink.clock import LONG_AGO, Instant, after, seconds_between
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.messages.system import RadioStatus
from airlink.receiver import Receiver
from gcs_formation.link.jitter import JitterMeter
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.link.missing_heartbeats import Heartbeats
from gcs_formation.link.radio_reports import RadioReports

LINE = Address("127.0.0.1", 14551)


def at(seconds: float) -> Instant:
    return after(Instant(0), 100.5 + seconds)


def connected() -> Connection:
    connection = Connection(0, LINE)
    connection.record_frame(at(0.0), heartbeat=True)
    return connection


@pytest.mark.parametrize(
    ("state", "silent_s", "following"),
    [
        (LinkState.SEARCHING, 1e6, LinkState.SEARCHING),
        (LinkState.CONNECTED, 1.5, LinkState.CONNECTED),
        (LinkState.CONNECTED, 1.501, LinkState.STALE),
        (LinkState.CONNECTED, 4.999, LinkState.STALE),
        (LinkState.CONNECTED, 5.001, LinkState.LOST),
        (LinkState.MUTE, 1.499, LinkState.MUTE),
        (LinkState.MUTE, 1.501, LinkState.STALE),
        (LinkState.MUTE, 5.001, LinkState.LOST),
        (LinkState.STALE, 5.0, LinkState.STALE),
        (LinkState.STALE, 5.001, LinkState.LOST),
        (LinkState.LOST, 1e6, LinkState.LOST),
    ],
)
def test_a_link_is_stale_after_a_second_and_a_half_of_silence_and_lost_after_five(
    state: LinkState, silent_s: float, following: LinkState
) -> None:
    connection = connected()
    connection.state = state
    assert connection.check(at(silent_s)) == (following is not state)
    assert connection.state is following
    assert connection.talks == (following in {LinkState.CONNECTED, LinkState.MUTE})
    assert connection.in_order(at(silent_s)) == (following is LinkState.CONNECTED)


@pytest.mark.parametrize(("received_s", "mute"), [(3.499, False), (3.5, False), (3.501, True)])
def test_heartbeats_are_missing_after_three_and_a_half_seconds_of_other_frames(received_s: float, mute: bool) -> None:
    connection = connected()
    assert not connection.record_frame(at(received_s), heartbeat=False)
    assert connection.overdue == mute
    assert connection.in_order(at(received_s)) == (not mute)
    assert connection.mute_s(0.0) == pytest.approx(received_s - 3.5)
    assert connection.check(at(received_s)) == mute
    assert connection.state is (LinkState.MUTE if mute else LinkState.CONNECTED)


@pytest.mark.parametrize(("apart_s", "again"), [(3.499, True), (3.5, True), (3.501, False)])
def test_the_second_heartbeat_shows_that_they_are_sent_again(apart_s: float, again: bool) -> None:
    """If both come within the limit for missing ones."""
    connection = connected()
    connection.record_frame(at(4.0), heartbeat=False)
    assert connection.check(at(4.0))
    assert not connection.record_frame(at(4.1), heartbeat=True)
    assert connection.state is LinkState.MUTE
    assert connection.record_frame(at(4.1 + apart_s), heartbeat=True) == again
    assert connection.state is (LinkState.CONNECTED if again else LinkState.MUTE)


@pytest.mark.parametrize(
    ("state", "heartbeat", "changed", "following"),
    [
        (LinkState.SEARCHING, False, False, LinkState.SEARCHING),
        (LinkState.SEARCHING, True, True, LinkState.CONNECTED),
        (LinkState.CONNECTED, True, False, LinkState.CONNECTED),
        (LinkState.STALE, False, True, LinkState.CONNECTED),
        (LinkState.STALE, True, True, LinkState.CONNECTED),
        (LinkState.LOST, False, False, LinkState.LOST),
        (LinkState.LOST, True, True, LinkState.CONNECTED),
        (LinkState.MUTE, False, False, LinkState.MUTE),
    ],
)
def test_what_leads_back_to_a_connection(
    state: LinkState, heartbeat: bool, changed: bool, following: LinkState
) -> None:
    """Any frame does after a short silence, a heartbeat after any; when the link was lost, that is noted."""
    connection = connected()
    connection.state = state
    assert connection.record_frame(at(2.0), heartbeat=heartbeat) == changed
    assert (connection.state, connection.last_received) == (following, at(2.0))
    assert connection.back_at == (at(2.0) if changed and state is LinkState.LOST else LONG_AGO)
    counts = heartbeat or state is LinkState.STALE
    assert connection.heartbeats.last == (at(2.0) if counts else at(0.0))


def test_the_clock_of_stamps_may_become_another() -> None:
    """Without its sample the jump would be a jitter of 500 s / 16."""
    meter = JitterMeter()
    for number in range(5):
        meter.observe(7.0 + 0.1 * number, at(0.1 * number), 0.0)
    assert meter.jitter_s == pytest.approx(0.0, abs=1e-9)
    meter.drop_sample()
    assert math.isnan(meter.jitter_s)
    meter.observe(500.0, at(1.0), 0.0)
    assert math.isnan(meter.jitter_s)
    meter.observe(500.1, at(1.1), 0.0)
    assert meter.jitter_s == pytest.approx(0.0, abs=1e-9)


def heard(punctual: int, off_s: float = 0.0, each_s: float = 1.0) -> Heartbeats:
    """Return heartbeats that came each second, the last one at 0 s, alternately `off_s` too late."""
    heartbeats = Heartbeats()
    for number in range(punctual, -1, -1):
        heartbeats.record(at(-each_s * number + off_s * (number % 2)))
    return heartbeats


@pytest.mark.parametrize(("loss", "missing_s"), [(0.0, 6.5), (0.1, 5.0), (0.5, 10.0 - 16.61), (0.01, 6.5)])
def test_heartbeats_that_were_lost_with_other_frames_are_missing_once_chance_does_not_explain_it(
    loss: float, missing_s: float
) -> None:
    """Ten seconds after the last: 0.1 ** 5 = 0.5 ** 16.61 = 1e-5; at least 3.5 s."""
    heartbeats = heard(0)
    for due_s in range(1, 11):
        heartbeats.record_gap(at(due_s - 0.05), at(due_s + 0.05))
    assert heartbeats.missing_s(at(10.0), loss) == pytest.approx(missing_s, abs=1e-3)
    heartbeats.record(at(9.0))
    assert heartbeats.missing_s(at(10.0), loss) == pytest.approx(-2.5)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(
    ("punctual", "off_s", "near_s"),
    [(0, 0.0, 0.25), (1, 0.0, 0.1875), (4, 0.0, 0.0791), (5, 0.0, 0.0625), (40, 0.0, 0.0625), (40, 0.03, 0.12)],
)
def test_a_lost_frame_may_have_been_the_heartbeat_within_four_mean_deviations_of_when_it_was_due(
    punctual: int, off_s: float, near_s: float, side: int
) -> None:
    """They begin with 1/16 s, of which each punctual one leaves three quarters (RFC 6298); 1/16 to 1/4 s count.

    Those that come by turns 30 ms late have a mean deviation of 30 ms from a second.
    """
    for share, missing in ((0.98, False), (1.02, True)):
        heartbeats, edge_s = heard(punctual, off_s), side * share * near_s
        begun_s, ended_s = (1.0 + edge_s, 1.4) if side > 0 else (0.6, 1.0 + edge_s)
        heartbeats.record_gap(at(begun_s), at(ended_s))
        for due_s in (2.0, 3.0, 4.0):
            heartbeats.record_gap(at(due_s), at(due_s))
        assert (heartbeats.missing_s(at(4.0), 0.5) > 0.0) == missing


@pytest.mark.parametrize(("each_s", "near_s"), [(2.0, 0.0791), (3.0, 0.0791), (2.5, 0.25)])
def test_heartbeats_are_punctual_that_come_whole_seconds_apart(each_s: float, near_s: float) -> None:
    """Those between were lost."""
    for share, missing in ((0.98, False), (1.02, True)):
        heartbeats = heard(4, each_s=each_s)
        heartbeats.record_gap(at(1.0 + share * near_s), at(1.4))
        for due_s in (2.0, 3.0, 4.0):
            heartbeats.record_gap(at(due_s), at(due_s))
        assert (heartbeats.missing_s(at(4.0), 0.5) > 0.0) == missing


def test_a_heartbeat_is_known_not_to_have_been_sent_once_frames_came_after_it() -> None:
    """The one due at 4 s, up to 0.25 s later."""
    for received_s, missing in ((4.24, False), (4.26, True)):
        heartbeats = heard(0)
        for due_s in (1.0, 2.0, 3.0):
            heartbeats.record_gap(at(due_s), at(due_s))
        assert (heartbeats.missing_s(at(received_s), 0.5) > 0.0) == missing


@pytest.mark.parametrize(("gaps", "missing"), [(63, True), (64, False)])
def test_of_more_gaps_than_are_remembered_the_first_ones_may_have_had_the_heartbeat(gaps: int, missing: bool) -> None:
    """64 are, from 1.5 s on here; a heartbeat that was due at 1 s may have been in one before."""
    heartbeats = heard(0)
    for number in range(gaps):
        heartbeats.record_gap(at(1.5 + 0.04 * number), at(1.52 + 0.04 * number))
    assert (heartbeats.missing_s(at(4.0), 0.5) > 0.0) == missing


def test_one_that_was_due_after_the_first_gap_that_is_remembered_was_not_sent() -> None:
    """At 2 s, between the first gap and the others, of which the one due at 3 s may be in."""
    heartbeats = heard(0)
    heartbeats.record_gap(at(1.7), at(1.72))
    for number in range(63):
        heartbeats.record_gap(at(2.26 + 0.02 * number), at(2.27 + 0.02 * number))
    assert heartbeats.missing_s(at(4.0), 0.5) > 0.0


def test_reports_of_a_radio_are_kept_five_times_a_second_at_most_and_the_newest_counts() -> None:
    vehicle, elsewhere = Connection(0, LINE), Connection(0)
    reports = RadioReports([vehicle, elsewhere])
    for number, later_s in enumerate((0.0, 0.1, 0.199, 0.2, 0.39, 0.4, 3.0)):
        status = RadioStatus(100 + number, 1, 100, 2, 3, 4, 5)
        datagram = Datagram(0, LINE, FrameWriter(51, 68).encode(status))
        frame = Receiver().first(datagram, at(later_s))
        assert frame is not None
        assert reports.receive(frame, datagram, at(later_s))
        newest = reports.of(vehicle, at(later_s))
        assert newest is not None
        assert (newest.rssi, newest.at) == (100 + number, at(later_s))
    kept = reports.all_of(vehicle)
    assert [each.rssi for each in kept] == [100, 103, 105, 106]
    assert reports.all_of(elsewhere) == []
    assert reports.all_of(Connection(1, LINE)) == []
    assert reports.of(vehicle, at(8.0)) == kept[-1]
    assert reports.of(vehicle, at(8.01)) is None
    assert seconds_between(kept[0].at, kept[-1].at) == 3.0


def test_reports_are_recorded_and_not_acted_on_where_they_can_be_forged() -> None:
    vehicle = Connection(0, LINE)
    reports = RadioReports([vehicle], lambda connection: connection is not vehicle)
    datagram = Datagram(0, LINE, FrameWriter(51, 68).encode(RadioStatus(100, 1, 7, 2, 3, 4, 5)))
    frame = Receiver().first(datagram, at(0.0))
    assert frame is not None
    assert reports.receive(frame, datagram, at(0.0))
    assert reports.of(vehicle, at(0.0)) is None
    assert [each.txbuf_percent for each in reports.all_of(vehicle)] == [7]

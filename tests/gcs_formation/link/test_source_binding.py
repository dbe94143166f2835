"""Which address is a vehicle's, frame by frame."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant, after
from airlink.endpoint import Address
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.frame_history import TURN_S
from gcs_formation.link.frame_loss import STALE_AFTER_S
from gcs_formation.link.link_health import LOST_AFTER_S, Connection, LinkState
from gcs_formation.link.source_binding import BOTH_TALK_S, DISBELIEVED_S, MAX_RIVALS, SourceBinding

HERE, THERE = Address("127.0.0.1", 40000), Address("127.0.0.1", 50000)
BEAT = Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA)
BOOTED_S = 500.0
"""The vehicle's time since boot at our time 0."""


class Ruling(NamedTuple):
    """The decision on a frame."""

    admitted: bool
    finding: str | None = None


class Ground:
    """The binding of one vehicle that is received from `HERE` and whose clock is known."""

    def __init__(self, *, clock_known: bool = True) -> None:
        self.connection, self.clock = Connection(0), ClockSync()
        self.source_binding = SourceBinding(self.connection, self.clock)
        self.now = Instant(0)
        self.receive()
        if clock_known:
            self.clock.observe(self.now, round(BOOTED_S * NANOSECONDS), self.now)
            self.receive(BOOTED_S)

    def receive(self, stamp_s: float | None = None, peer: Address = HERE, *, at_s: float | None = None) -> Ruling:
        """Take a heartbeat, or telemetry with a stamp, as the station does."""
        self.now = self.now if at_s is None else after(Instant(0), at_s)
        message = BEAT if stamp_s is None else Attitude(stamp_s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        ruling = Ruling(*self.source_binding.rule(message, 0, peer, self.now))
        if ruling.admitted:
            self.connection.record_frame(self.now, heartbeat=stamp_s is None)
        return ruling

    def silence(self, until_s: float) -> None:
        self.now = after(Instant(0), until_s)
        while self.connection.check(self.now):
            pass


def test_before_it_is_heard_the_first_address_counts_and_a_heartbeat_s_more() -> None:
    connection = Connection(0)
    source_binding = SourceBinding(connection, ClockSync())
    assert source_binding.rule(None, 0, HERE, Instant(0)) == (True, None)
    assert connection.peer == HERE
    source_binding.rule(None, 0, THERE, Instant(0))
    assert connection.peer == HERE
    source_binding.rule(BEAT, 1, THERE, Instant(0))
    assert (connection.socket, connection.peer) == (1, THERE)


def test_while_it_is_heard_none_takes_its_place_and_two_that_talk_for_a_second_are_two() -> None:
    ground = Ground()
    rulings = []
    for tenth in range(1, 21):
        ground.receive(BOOTED_S + 0.1 * tenth, at_s=0.1 * tenth)
        rulings.append(ground.receive(BOOTED_S + 0.1 * tenth, THERE))
    assert not any(ruling.admitted for ruling in rulings)
    found = [(0.1 * (1 + i), ruling.finding) for i, ruling in enumerate(rulings) if ruling.finding]
    ((at_s, finding),) = found
    assert at_s == pytest.approx(0.1 + BOTH_TALK_S)
    assert finding is not None
    assert finding.endswith("beside 127.0.0.1:40000, its clock goes on; it is ignored")
    assert ground.connection.peer == HERE


def test_one_that_moved_is_refused_until_its_old_address_is_silent_and_is_no_second_vehicle() -> None:
    ground = Ground()
    ground.receive(BOOTED_S + 1.0, at_s=1.0)
    assert ground.receive(BOOTED_S + 1.1, THERE, at_s=1.1) == Ruling(False)
    ground.silence(1.0 + STALE_AFTER_S + 0.1)
    assert ground.connection.state is LinkState.STALE
    moved = ground.receive(BOOTED_S + 2.6, THERE)
    assert moved.admitted
    assert moved.finding is not None
    assert moved.finding.endswith("127.0.0.1:40000 fell silent 1.6 s ago, its clock goes on")
    assert ground.connection.peer == THERE


@pytest.mark.parametrize(
    ("stamp_s", "words"),
    [(0.5, "its clock began after that"), (BOOTED_S + 3.0, "its clock goes on")],
)
def test_who_speaks_elsewhere_after_silence_is_it_if_its_clock_goes_on_or_began_since(
    stamp_s: float, words: str
) -> None:
    ground = Ground()
    ground.silence(3.0)
    taken = ground.receive(stamp_s, THERE)
    assert taken.admitted
    assert taken.finding is not None
    assert taken.finding.endswith(words)


@pytest.mark.parametrize("stamp_s", [40.0, BOOTED_S - 60.0, BOOTED_S + 60.0])
def test_another_clock_never_takes_a_silent_vehicle_s_place_nor_do_its_heartbeats(stamp_s: float) -> None:
    ground = Ground()
    ground.silence(LOST_AFTER_S + 1.0)
    refused = ground.receive(stamp_s, THERE)
    assert not refused.admitted
    assert refused.finding is not None
    assert refused.finding.endswith("its clock is another's; it is ignored")
    assert ground.receive(None, THERE) == ground.receive(stamp_s, THERE) == Ruling(False)  # reported once
    assert ground.connection.peer == HERE


def test_heartbeats_alone_take_the_place_of_one_that_is_lost_and_not_before() -> None:
    ground = Ground()
    ground.silence(LOST_AFTER_S - 1.0)
    assert ground.receive(None, THERE) == Ruling(False)
    ground.silence(LOST_AFTER_S + 0.1)
    taken = ground.receive(None, THERE)
    assert taken.finding is not None
    assert taken.finding.endswith("nothing tells its clock")


def test_two_behind_one_address_are_distinguished_by_their_clocks() -> None:
    ground = Ground()
    rulings = []
    for tenth in range(1, 21):
        assert ground.receive(BOOTED_S + 0.1 * tenth, at_s=0.1 * tenth).admitted
        rulings.append(ground.receive(7.0 + 0.1 * tenth))
    assert not any(ruling.admitted for ruling in rulings)
    (finding,) = [ruling.finding for ruling in rulings if ruling.finding]
    assert "from the same address, its clock is another's" in finding


def test_the_answer_of_another_clock_is_accepted_only_once_its_own_has_not_been_seen_for_2_s() -> None:
    ground = Ground()
    assert ground.source_binding.accepts(BOOTED_S, ground.now)
    assert not ground.source_binding.accepts(7.0, after(ground.now, DISBELIEVED_S - 0.1))
    assert ground.source_binding.accepts(7.0, after(ground.now, DISBELIEVED_S + 0.1))


def test_a_crowd_of_claimants_is_not_remembered_without_limit() -> None:
    ground = Ground()
    for port in range(1000):
        ground.receive(7.0, Address("127.0.0.1", 1024 + port))
    assert len(ground.source_binding._duplicates) == MAX_RIVALS


def at_turn(shown_s: float) -> Ground:
    """Return the binding of a vehicle whose clock has a given time at our time 0."""
    ground = Ground(clock_known=False)
    ground.clock.observe(ground.now, round(shown_s * NANOSECONDS), ground.now)
    return ground


def test_stamps_of_32_bits_go_on_where_they_begin_again_after_49_days() -> None:
    """2^32 ms are 4294967.296 s; it is silent for a minute around that, and may continue from another address."""
    ground = at_turn(4294960.0)
    assert ground.receive(4294960.0).admitted
    assert (ground.source_binding.turned_s, TURN_S) == (0.0, 4294967.296)
    assert ground.receive(0.704, at_s=8.0).admitted
    assert ground.source_binding.turned_s == TURN_S
    assert ground.receive(4294967.2, at_s=8.0).admitted, "sent before that, and overtaken"
    assert ground.source_binding.turned_s == 0.0
    ground.silence(70.0)
    moved = ground.receive(62.704, THERE)
    assert moved.admitted
    assert "its clock goes on" in (moved.finding or "")
    assert at_turn(3 * 4294967.296 + 5.0).receive(5.0).admitted, "up for half a year"


def test_no_other_stamp_is_taken_for_one_that_has_begun_again() -> None:
    ground = at_turn(4294960.0)
    assert not ground.receive(100.0, at_s=8.0).admitted
    assert ground.source_binding.turned_s == 0.0
    ground = at_turn(BOOTED_S)
    assert not ground.receive(4294967.0, at_s=1.0).admitted, "of the turn before"
    assert ground.receive(0.5, at_s=1.0).admitted
    assert ground.source_binding.turned_s == 0.0, "it has restarted"

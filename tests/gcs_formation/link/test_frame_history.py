"""Which frames are news, copies, or overtaken: of a vehicle whose stamps, numbers and states are known."""

from __future__ import annotations

from typing import Literal

import pytest

from airlink import mavlink as m
from airlink.clock import LONG_AGO, NANOSECONDS, Instant, after
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame, FrameWriter
from airlink.messages import Message
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude, ExtendedSysState, GlobalPositionInt, VfrHud
from airlink.receiver import Receiver
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.frame_history import CopyEvidence, FrameHistory

AT_S, BOOTED_S = 1000.0, 500.0
"""When the tests begin, and what the vehicle's clock shows then."""
TURN_S = 4294967.296
"""2^32 ms."""
SPEEDS = VfrHud(20.0, 20.0, 0.0, 50, 100.0, 0.0)


def at(later_s: float) -> Instant:
    return after(Instant(0), AT_S + later_s)


def beat(status: int = m.MAV_STATE_ACTIVE, mode: int = 0) -> Heartbeat:
    return Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, mode, status)


def attitude(later_s: float) -> Attitude:
    """Return the attitude of when the vehicle's clock showed its time at the beginning and so much more."""
    return Attitude(BOOTED_S + later_s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Ground:
    """The history of one vehicle's frames, as the station keeps it."""

    def __init__(self, *, clock_known: bool = True, booted_s: float = BOOTED_S) -> None:
        self.clock = ClockSync()
        if clock_known:
            self.clock.observe(at(0.0), round(booted_s * NANOSECONDS), at(0.0))
        self.history = FrameHistory(self.clock)
        self._writer, self._receiver = FrameWriter(3, 1), Receiver()

    def frame(self, message: Message, number: int | None = None, version: Literal[1, 2] = 2) -> Frame:
        """Return the vehicle's next frame, or one with a number."""
        if number is not None:
            self._writer = FrameWriter(3, 1)
            for _ in range(number):
                self._writer.encode(beat())
        datagram = Datagram(0, Address("127.0.0.1", 1), self._writer.encode(message, version))
        found = self._receiver.first(datagram, Instant(0))
        assert found is not None
        return found

    def take(
        self,
        frame: Frame,
        later_s: float,
        *,
        elsewhere: bool = False,
        follows: bool = True,
        overtaken: bool = False,
        silent: bool = False,
        awaited: bool = False,
    ) -> str:
        history, now = self.history, at(later_s)
        if history.is_copy(frame, now, elsewhere=elsewhere, follows=follows, overtaken=overtaken, silent=silent):
            assert (history.is_news, history.was_copy) == (False, True)
            return "copy"
        if history.is_lost_one(frame, now, elsewhere=elsewhere):
            return "lost one"
        late = history.late
        history.record(frame, now, follows=follows, awaited=awaited)
        assert (history.was_copy, history.late) == (False, late + (not history.is_news))
        return "news" if history.is_news else "late"

    def bring_copies(self, later_s: float, *, elsewhere: bool = False) -> None:
        """Have three frames come twice."""
        frames = [self.frame(attitude(later_s - 0.003 + 0.001 * number)) for number in range(3)]
        for frame in frames:
            self.take(frame, later_s)
        for frame in frames:
            assert self.take(frame, later_s, elsewhere=elsewhere) == "copy"


def test_three_that_seem_to_be_copies_show_that_copies_come_and_a_few_by_chance_do_not() -> None:
    """Four others make up for one; however many seemed to be, seventeen others make one more a chance."""
    evidence = CopyEvidence()
    for now, (suspicious, last) in enumerate([(True, LONG_AGO), (True, LONG_AGO), (True, 2), (False, 2), (True, 4)]):
        evidence.weigh(now, suspicious=suspicious)
        assert evidence.last == last
    chance = CopyEvidence()
    for now in range(200):
        chance.weigh(now, suspicious=now % 5 == 0)
    assert chance.last == LONG_AGO
    for calm, reported in ((16, True), (17, False)):
        evidence = CopyEvidence()
        for now in range(50):
            evidence.weigh(now, suspicious=True)
        for now in range(50, 50 + calm):
            evidence.weigh(now, suspicious=False)
        evidence.weigh(100, suspicious=True)
        assert (evidence.last == 100) == reported


@pytest.mark.parametrize("clock_known", [False, True])
@pytest.mark.parametrize("elsewhere", [False, True])
@pytest.mark.parametrize("late_s", [0.05, 3.0, 60.0])
def test_of_telemetry_that_comes_twice_each_is_news_once(clock_known: bool, elsewhere: bool, late_s: float) -> None:
    """From one address or two, however late: every first one is news, every second one a copy."""
    ground, arrivals = Ground(clock_known=clock_known), list[tuple[float, Frame, bool]]()
    for number in range(60):
        sent_s = 0.25 * number
        for message in (attitude(sent_s), GlobalPositionInt(BOOTED_S + sent_s, *[0.0] * 8)):
            frame = ground.frame(message)
            arrivals += [(sent_s, frame, False), (sent_s + late_s, frame, True)]
    arrivals.sort(key=lambda each: each[0])
    found = [ground.take(frame, at_s, elsewhere=again and elsewhere) for at_s, frame, again in arrivals]
    assert found == ["copy" if again else "news" for _, _, again in arrivals]
    assert (ground.history.copies, ground.history.late) == (120, 0)


@pytest.mark.parametrize(
    ("sent_s", "arrives_s", "clock_known", "found"),
    [
        (-0.1, 0.0, True, "late"),
        (-0.1, 0.0, False, "news"),
        (-9.9, 0.0, True, "late"),
        (-10.1, 0.0, True, "news"),
        (0.5, 1.0, True, "news"),
        (0.0, 9.9, True, "news"),
        (-2.0, 7.9, True, "late"),
        (-2.2, 7.9, True, "news"),
    ],
)
def test_one_that_a_newer_one_overtook_is_late_if_both_are_of_the_present_clock(
    sent_s: float, arrives_s: float, clock_known: bool, found: str
) -> None:
    """Stamps are of the present clock up to 10 s after, and 2 s before, it showed them."""
    ground = Ground(clock_known=clock_known)
    assert ground.take(ground.frame(attitude(0.0)), 0.0) == "news"
    assert ground.take(ground.frame(attitude(sent_s)), arrives_s) == found


@pytest.mark.parametrize(("ahead_s", "found"), [(1.9, "late"), (2.1, "news")])
def test_a_stamp_of_the_future_is_of_another_clock(ahead_s: float, found: str) -> None:
    ground = Ground()
    ground.take(ground.frame(attitude(ahead_s)), 0.0)
    assert ground.take(ground.frame(attitude(ahead_s - 0.1)), 0.0) == ("late" if ahead_s < 2.05 else "news")
    assert ground.take(ground.frame(attitude(ahead_s - 0.01)), 0.0) == found


def test_each_kind_of_message_has_its_own_newest_stamp_until_the_vehicle_restarts() -> None:
    ground = Ground()
    ground.take(ground.frame(attitude(1.0)), 1.0)
    assert ground.take(ground.frame(GlobalPositionInt(BOOTED_S + 0.5, *[0.0] * 8)), 1.0) == "news"
    assert ground.take(ground.frame(attitude(0.5)), 1.0) == "late"
    assert ground.take(ground.frame(attitude(0.9)), 1.0) == "late"
    ground.history.restart()
    assert ground.take(ground.frame(attitude(0.8)), 1.0) == "news"


def test_stamps_go_on_after_49_days() -> None:
    """2^32 ms: 100 ms after the turn aren't older than 100 ms before it."""
    ground = Ground(booted_s=TURN_S)
    before, since = (Attitude(stamp_s, *[0.0] * 6) for stamp_s in (TURN_S - 0.1, 0.1))
    assert ground.take(ground.frame(before), 0.0) == "news"
    first = ground.frame(since)
    assert ground.take(first, 0.2) == "news"
    assert ground.take(first, 0.3) == "copy"
    assert ground.take(ground.frame(Attitude(0.05, *[0.0] * 6)), 0.3) == "late"
    assert ground.take(ground.frame(Attitude(0.3, *[0.0] * 6)), 0.3) == "news"


def test_a_known_frame_of_another_clock_is_a_copy_however_new_its_stamp_is() -> None:
    """After the vehicle has restarted, frames of before come again: the newest of their kind, and not of now."""
    ground = Ground()
    old, new = ground.frame(attitude(0.0)), ground.frame(attitude(1.0))
    for frame, later_s in ((old, 0.0), (new, 1.0)):
        ground.take(frame, later_s)
    ground.history.restart()
    assert ground.take(new, 5.0) == "news", "it can't be reported that it was received before the restart"
    ground.history.restart()
    assert ground.take(new, 20.0) == "copy"


@pytest.mark.parametrize("version", [1, 2])
def test_a_heartbeat_comes_again_with_its_number_after_255_others_and_is_news(version: Literal[1, 2]) -> None:
    """The same bytes; so it is where no copies come, if its number is in its turn or its state is the present one."""
    ground = Ground()
    one, other = ground.frame(beat(), 7, version), ground.frame(beat(m.MAV_STATE_CRITICAL), 9, version)
    assert ground.take(one, 0.0) == "news"
    assert not ground.history.may_be_copy
    assert ground.take(one, 64.0) == "news"
    assert ground.history.may_be_copy
    assert ground.take(one, 65.0, follows=False) == "news"
    ground = Ground()
    for later_s, frame in ((0.0, one), (1.0, other)):
        ground.take(frame, later_s)
    assert ground.take(one, 3.4, follows=False) == "copy", "it contradicts the newest"
    assert ground.take(one, 3.6, follows=False) == "news", "that wasn't sent again for 2.5 s"
    assert ground.take(other, 3.7) == "news"


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("change", [beat(m.MAV_STATE_CRITICAL), beat(mode=5)])
def test_while_copies_come_a_known_heartbeat_is_news_in_its_turn_if_its_state_is_the_present_one(
    change: Heartbeat, version: Literal[1, 2]
) -> None:
    ground = Ground()
    one, other, again = (ground.frame(*each, version) for each in ((beat(), 7), (change, 9), (change, 20)))
    for later_s, frame in ((0.0, one), (0.5, other), (1.0, again)):
        assert ground.take(frame, later_s) == "news"
    ground.bring_copies(1.0)
    assert ground.take(one, 1.5) == "copy", "the newest was another state"
    assert ground.take(other, 1.5) == "news"
    assert ground.take(other, 1.5, silent=True) == "copy"
    assert ground.take(other, 1.5, follows=False) == "copy"
    assert ground.take(one, 4.1) == "news", "2.5 s later, another state may be the present one"


def test_what_states_something_else_or_nothing_contradicts_no_other() -> None:
    """Airspeed and height have no state; another kind of state has its own."""
    ground = Ground()
    one, other = ground.frame(SPEEDS, 7), ground.frame(VfrHud(25.0, 25.0, 0.0, 50, 100.0, 0.0), 9)
    landed, flying = (ground.frame(ExtendedSysState(0, each), 30 + each) for each in (1, 2))
    for frame in (one, other, landed, flying):
        ground.take(frame, 0.0)
    assert ground.take(one, 0.1, follows=False) == "news"
    assert ground.take(landed, 0.1, follows=False) == "copy"
    ground.take(ground.frame(beat(), 40), 0.2)
    assert ground.take(flying, 0.3, follows=False) == "news"


def test_while_copies_come_what_has_no_time_is_news_if_it_is_in_its_turn_or_awaited() -> None:
    """For ten seconds after the last copy."""
    ground = Ground()
    ground.take(ground.frame(SPEEDS, 100), 0.0)
    assert ground.take(ground.frame(SPEEDS, 101), 0.0, follows=False) == "news"
    ground.bring_copies(0.0)
    number = 110
    for later_s, options, found in (
        (1.0, {"follows": False}, "late"),
        (1.0, {"follows": True}, "news"),
        (1.0, {"follows": False, "awaited": True}, "news"),
        (9.9, {"follows": False}, "late"),
        (10.1, {"follows": False}, "news"),
    ):
        number += 1
        assert ground.take(ground.frame(SPEEDS, number), later_s, **options) == found
    assert ground.history.late == 2


def test_a_state_that_came_out_of_its_turn_is_not_the_present_one() -> None:
    ground = Ground()
    one, other = ground.frame(beat(), 7), ground.frame(beat(m.MAV_STATE_CRITICAL), 9)
    ground.take(one, 0.0)
    ground.bring_copies(0.0)
    assert ground.take(other, 0.5, follows=False) == "late"
    assert ground.take(one, 0.6) == "news"


@pytest.mark.parametrize(("clock_known", "elsewhere"), [(True, False), (True, True), (False, True)])
def test_while_copies_come_one_that_was_lost_shows_no_other_sender(clock_known: bool, elsewhere: bool) -> None:
    """Copies of a minute ago, of which one never came itself; from another address also what has no time."""
    ground = Ground(clock_known=clock_known)
    lost, present = ground.frame(attitude(-60.0)), ground.frame(attitude(1.0))
    assert not ground.history.is_lost_one(lost, at(1.0), elsewhere=elsewhere)
    ground.bring_copies(0.5, elsewhere=elsewhere)
    assert ground.history.is_lost_one(lost, at(1.0), elsewhere=elsewhere)
    assert not ground.history.is_lost_one(present, at(1.0), elsewhere=elsewhere)
    assert ground.history.is_lost_one(ground.frame(SPEEDS), at(1.0), elsewhere=elsewhere) == elsewhere
    assert ground.history.is_lost_one(ground.frame(attitude(0.4)), at(1.0), elsewhere=elsewhere) == elsewhere
    if clock_known:
        future = ground.frame(attitude(60.0))
        assert ground.history.is_lost_one(future, at(1.0), elsewhere=elsewhere) == elsewhere
    assert not ground.history.is_lost_one(lost, at(10.6), elsewhere=elsewhere)


@pytest.mark.parametrize(
    ("follows", "elsewhere", "come"), [(False, False, True), (True, False, False), (False, True, False)]
)
def test_known_frames_without_a_time_show_that_copies_come_where_they_are_out_of_their_turn(
    follows: bool, elsewhere: bool, come: bool
) -> None:
    """From another address they don't: it may be the vehicle's own."""
    ground = Ground()
    frame = ground.frame(SPEEDS)
    ground.take(frame, 0.0)
    for number in range(3):
        assert not ground.history.copies_come(at(0.1), elsewhere=elsewhere)
        ground.take(frame, 0.01 * number, follows=follows, elsewhere=elsewhere)
    assert ground.history.copies_come(at(0.1), elsewhere=elsewhere) == come


def test_copies_from_one_address_say_nothing_of_another() -> None:
    for elsewhere in (False, True):
        ground = Ground()
        ground.bring_copies(0.0, elsewhere=elsewhere)
        assert ground.history.copies_come(at(0.1), elsewhere=elsewhere)
        assert not ground.history.copies_come(at(0.1), elsewhere=not elsewhere)
        assert ground.history.copies_come(at(9.9), elsewhere=elsewhere)
        assert not ground.history.copies_come(at(10.1), elsewhere=elsewhere)


@pytest.mark.parametrize(("own", "come"), [(11, True), (12, False)])
def test_an_address_from_which_twelve_unknown_frames_came_in_a_row_sends_its_own(own: int, come: bool) -> None:
    ground = Ground()
    ground.bring_copies(0.0, elsewhere=True)
    known = ground.frame(attitude(0.1))
    ground.take(known, 0.1)
    for number in range(own):
        ground.take(ground.frame(attitude(0.2 + 0.01 * number)), 0.2, elsewhere=True)
    assert ground.history.copies_come(at(0.3), elsewhere=True) == come
    ground.take(known, 0.3, elsewhere=True)
    assert ground.history.copies_come(at(0.3), elsewhere=True)


def test_from_another_address_a_known_frame_without_a_time_is_a_copy_unless_the_vehicle_may_have_moved() -> None:
    ground = Ground()
    frame = ground.frame(beat())
    ground.take(frame, 0.0)
    assert ground.take(frame, 0.1, elsewhere=True) == "copy"
    assert ground.take(frame, 3.0, elsewhere=True, silent=True) == "news"
    ground.bring_copies(3.0, elsewhere=True)
    assert ground.take(frame, 3.1, elsewhere=True, silent=True) == "copy"


def test_a_number_that_was_skipped_just_now_no_copy_has_but_from_another_address() -> None:
    """By chance its mark is a known one."""
    ground = Ground()
    frame = ground.frame(attitude(0.0))
    ground.take(frame, 0.0)
    assert ground.take(frame, 0.1, overtaken=True) == "news"
    assert ground.take(frame, 0.1, overtaken=True, elsewhere=True) == "copy"
    assert ground.take(frame, 0.1) == "copy"


@pytest.mark.parametrize(("later_s", "known"), [(0.0, True), (121.0, True), (239.0, True), (243.0, False)])
def test_frames_are_known_for_two_minutes_at_least_and_four_at_most(later_s: float, known: bool) -> None:
    ground = Ground()
    frame = ground.frame(SPEEDS, 7)
    ground.take(frame, 0.0)
    for each in range(1, int(later_s)):
        ground.take(ground.frame(attitude(float(each))), float(each))
    ground.take(frame, later_s)
    assert ground.history.may_be_copy == known


def test_frames_with_one_checksum_are_reported_apart_by_their_first_byte() -> None:
    """Of 1000 frames some have the checksum of another; of two bits' values four are reported apart."""
    ground, seen, found = Ground(), dict[bytes, Frame](), 0
    for mode in range(1000):
        frame = ground.frame(beat(mode=2654435761 * mode % 2**32), 5)
        other = seen.setdefault(frame.raw[-2:], frame)
        if other is not frame and other.raw[10] % 4 != frame.raw[10] % 4:
            found += 1
            separate = Ground()
            separate.take(other, 0.0)
            separate.take(frame, 0.1)
            assert not separate.history.may_be_copy
    assert found

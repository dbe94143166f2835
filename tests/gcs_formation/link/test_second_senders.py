"""Another sender with a vehicle's system id: each limit of what its clock and its frames prove, from both sides."""

from __future__ import annotations

import math

import pytest

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant, after
from airlink.endpoint import Address
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.link.source_binding import SourceBinding, second_sender

HERE, THERE = Address("127.0.0.1", 40000), Address("127.0.0.1", 50000)
BEAT = Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA)
BOOTED_S = 500.0
"""The vehicle's time since boot at the beginning."""


def at(seconds: float) -> Instant:
    return after(Instant(0), 100.0 + seconds)


class Bound:
    """A vehicle that was received from `HERE`, socket 0, at the beginning."""

    def __init__(self, *, clock_known: bool = True) -> None:
        self.connection, self.clock = Connection(0, HERE, LinkState.CONNECTED, at(0.0)), ClockSync()
        self.binding = SourceBinding(self.connection, self.clock)
        if clock_known:
            self.clock.observe(at(0.0), round(BOOTED_S * NANOSECONDS), at(0.0))
            assert self.stamped(0.0, 0.0) == (True, None)

    def stamped(self, shown_s: float, later_s: float, peer: Address = HERE, socket: int = 0) -> tuple[bool, str | None]:
        """Take a stamp of when the vehicle's clock showed so much more than at the beginning."""
        message = Attitude(BOOTED_S + shown_s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return self.binding.rule(message, socket, peer, at(later_s))

    def beats(self, later_s: float, peer: Address = THERE) -> tuple[bool, str | None]:
        return self.binding.rule(BEAT, 0, peer, at(later_s))


@pytest.mark.parametrize(
    ("age_s", "is_its_own"), [(-2.01, False), (-1.99, True), (0.0, True), (9.99, True), (10.01, False)]
)
def test_a_stamp_is_the_vehicles_own_up_to_two_seconds_before_and_ten_after_its_clock_shows_it(
    age_s: float, is_its_own: bool
) -> None:
    """From its own address another one is refused, which is reported and said."""
    bound = Bound()
    admitted, finding = bound.stamped(20.0 - age_s, 20.0)
    assert admitted == is_its_own
    assert finding is None
    found_s = bound.binding.refused_stamp_s
    assert math.isnan(found_s) if is_its_own else found_s == BOOTED_S + 20.0 - age_s


@pytest.mark.parametrize(("booted_s", "admitted"), [(-0.99, True), (-1.01, False), (3.0, True)])
def test_a_clock_that_began_no_sooner_than_a_second_before_its_last_stamp_is_the_restarted_vehicles(
    booted_s: float, admitted: bool
) -> None:
    """The last stamp of its own was seen at 0 s."""
    for peer in (HERE, THERE):
        bound = Bound()
        bound.connection.state = LinkState.STALE
        found = bound.stamped(4.0 - booted_s - BOOTED_S, 4.0, peer)
        assert found[0] == admitted
        if peer is THERE and admitted:
            assert found[1] == (
                "is heard from 127.0.0.1:50000; 127.0.0.1:40000 fell silent 4.0 s ago, its clock began after that"
            )
            assert bound.connection.peer == THERE


@pytest.mark.parametrize(("since_s", "accepted"), [(1.99, False), (2.01, True)])
def test_an_answer_of_another_clock_counts_once_its_own_stamps_have_been_missing_for_two_seconds(
    since_s: float, accepted: bool
) -> None:
    bound = Bound()
    bound.stamped(1.0, 1.0)
    assert bound.binding.accepts(BOOTED_S + 1.0, at(1.0))
    assert bound.binding.accepts(7.0, at(1.0 + since_s)) == accepted


@pytest.mark.parametrize("peer", [HERE, THERE])
def test_a_sender_elsewhere_is_a_second_one_if_the_vehicle_is_received_a_second_after_its_first_of_four_frames(
    peer: Address,
) -> None:
    """Another socket is elsewhere, too. What a second link delivers is a few frames; it is said once."""
    for frames, received_s, expected in ((3, 1.5, False), (4, 1.499, False), (4, 1.5, True), (9, 1.6, True)):
        bound = Bound()
        bound.connection.last_received = at(received_s)
        found = [bound.stamped(0.5, 0.5 + 0.01 * number, peer, 1) for number in range(frames)]
        assert not any(admitted for admitted, _ in found)
        texts = [text for _, text in found if text is not None]
        assert len(texts) == expected
        if expected:
            where = "from the same address" if peer is HERE else "from 127.0.0.1:50000, beside 127.0.0.1:40000"
            assert texts == [f"another sender has its system id, {where}, its clock goes on; it is ignored"]


def test_heartbeats_tell_no_clock_and_one_whose_clock_is_anothers_is_a_second_vehicle_at_once() -> None:
    bound = Bound()
    bound.connection.last_received = at(9.0)
    texts = [bound.beats(1.0 + 0.01 * number)[1] for number in range(4)]
    assert texts == [None] * 3 + [second_sender(THERE, HERE)]
    bound = Bound()
    assert bound.stamped(-90.0, 1.0, THERE)[1] == second_sender(THERE, HERE, ", its clock is another's")
    assert math.isnan(bound.binding.refused_stamp_s)


def test_two_behind_one_address_are_two_once_the_vehicles_own_stamps_come_a_second_after_the_others_first() -> None:
    for own_s, expected in ((1.49, False), (1.51, True)):
        bound = Bound()
        assert bound.stamped(-90.0, 0.5) == (False, None)
        bound.stamped(own_s, own_s)
        admitted, text = bound.stamped(-89.0, own_s)
        assert (admitted, text is not None) == (False, expected)
        if text is not None:
            assert text == second_sender(HERE, HERE, ", its clock is another's")


@pytest.mark.parametrize(("silent_s", "again"), [(59.9, False), (60.1, True)])
def test_a_sender_that_was_silent_for_a_minute_is_said_again(silent_s: float, again: bool) -> None:
    bound = Bound()
    assert bound.stamped(-90.0, 1.0, THERE)[1] is not None
    assert (bound.stamped(-90.0, 1.0 + silent_s, THERE)[1] is not None) == again


def test_of_more_than_eight_senders_the_first_ones_are_said() -> None:
    bound = Bound()
    found = [bound.stamped(-90.0, 1.0, Address("127.0.0.1", 1000 + port))[1] for port in range(12)]
    assert [text is not None for text in found] == [True] * 8 + [False] * 4


@pytest.mark.parametrize(
    ("ages_s", "may_be"),
    [([2.99], True), ([3.01], False), ([0.0, 5.0], False), ([5.0, 0.0], False), ([0.0, 1.0], True), ([], False)],
)
def test_it_may_be_the_vehicle_by_another_port_if_all_its_stamps_are_of_now(ages_s: list[float], may_be: bool) -> None:
    """By the vehicle's clock, no more than three seconds old."""
    bound = Bound()
    assert not bound.binding.may_be_second_port(0, THERE)
    bound.beats(20.0)
    for number, age_s in enumerate(ages_s):
        bound.connection.last_received = at(20.0 + number)
        bound.stamped(20.0 + number - age_s, 20.0 + number, THERE)
    bound.beats(22.0)
    assert bound.binding.may_be_second_port(0, THERE) == may_be
    assert not bound.binding.may_be_second_port(1, THERE)
    assert not bound.binding.may_be_second_port(0, HERE)
    bound.stamped(-90.0, 22.0, THERE)
    assert not bound.binding.may_be_second_port(0, THERE)


def test_its_own_address_is_no_second_port() -> None:
    bound = Bound()
    bound.stamped(0.1, 0.1, THERE)
    assert bound.binding.may_be_second_port(0, THERE)
    bound.connection.peer = THERE
    assert not bound.binding.may_be_second_port(0, THERE)
    bound.connection.socket = 1
    assert bound.binding.may_be_second_port(0, THERE)


@pytest.mark.parametrize(
    ("state", "clock_known", "refuted", "admitted"),
    [
        (LinkState.STALE, True, False, False),
        (LinkState.STALE, False, False, True),
        (LinkState.LOST, True, False, True),
        (LinkState.LOST, True, True, False),
        (LinkState.MUTE, False, False, False),
        (LinkState.CONNECTED, False, False, False),
    ],
)
def test_heartbeats_without_a_clock_take_its_place_if_it_is_lost_or_its_clock_was_never_known(
    state: LinkState, clock_known: bool, refuted: bool, admitted: bool
) -> None:
    """Unless their sender's clock was shown to be another's; what is no heartbeat doesn't."""
    bound = Bound(clock_known=clock_known)
    if refuted:
        bound.stamped(-90.0, 0.1, THERE)
    bound.connection.state = state
    assert not bound.binding.rule(None, 0, THERE, at(2.0))[0]
    found = bound.beats(2.0)
    assert found[0] == admitted
    assert (bound.connection.peer == THERE) == admitted
    if admitted:
        expected = "is heard from 127.0.0.1:50000; 127.0.0.1:40000 fell silent 2.0 s ago, nothing tells its clock"
        assert found == (True, expected)


def test_one_that_has_moved_is_no_rival_at_its_new_address() -> None:
    bound = Bound()
    bound.stamped(1.0, 1.0, THERE)
    bound.connection.state = LinkState.STALE
    assert bound.stamped(2.0, 2.0, THERE)[0]
    bound.connection.peer, bound.connection.state = HERE, LinkState.CONNECTED
    assert not bound.binding.may_be_second_port(0, THERE)


def test_before_its_clock_is_known_every_frame_is_its_own_and_proves_that_it_is_there() -> None:
    """At 50 s: a clock that began a second before that, or later, may be its own, and no older one."""
    bound = Bound(clock_known=False)
    assert bound.stamped(7.0, 50.0) == (True, None)
    bound.clock.observe(at(50.0), round(BOOTED_S * NANOSECONDS), at(50.0))
    assert not bound.binding.accepts(2.5, at(51.0))
    assert bound.binding.accepts(1.5, at(51.0))

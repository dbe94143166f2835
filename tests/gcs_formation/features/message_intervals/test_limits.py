"""Limits of what counts as too few messages, from both sides, and who isn't asked at all."""

from __future__ import annotations

import math
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from librt.vecs import vec
from mypy_extensions import i64

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.messages import KINDS
from gcs_formation.features.message_intervals.requested_again import MessageCounts, _is_too_few, _window_s
from gcs_formation.features.message_intervals.stages import RequestedAgain
from gcs_formation.link.link_health import LinkState
from gcs_formation.phases import Phase
from gcs_formation.vehicle.command_delivery import Outcome
from tests.gcs_formation.features.message_intervals.test_requested_again import (
    AIRSPEED,
    ASKED_HZ,
    ATTITUDE,
    HEARTBEAT,
    STATUS,
    Sender,
)


@pytest.fixture
def sender() -> Sender:
    """Return a vehicle that has sent what was requested for 20 s: the rarest is counted over 16 s."""
    sends = Sender()
    sends.run(20.0)
    return sends


def asked(sends: Sender) -> set[int]:
    return {message_id for _, message_id, _ in sends.asked}


@pytest.mark.parametrize(("rate_hz", "missing"), [(4.4, True), (5.6, False)])
def test_half_as_often_is_the_limit(sender: Sender, rate_hz: float, missing: bool) -> None:
    sender.rates_hz[ATTITUDE] = rate_hz
    sender.run(4.0)
    assert asked(sender) == ({ATTITUDE} if missing else set())


@pytest.mark.parametrize(("rate_hz", "together"), [(8.0, True), (10.0, False)])
def test_another_of_motion_that_is_slowed_is_asked_for_together_with_one_that_is_missing(
    sender: Sender, rate_hz: float, together: bool
) -> None:
    sender.rates_hz |= {ATTITUDE: 0.0, AIRSPEED: rate_hz}
    sender.run(3.0)
    assert asked(sender) == ({ATTITUDE, AIRSPEED} if together else {ATTITUDE})


def test_after_a_request_those_of_motion_are_counted_over_the_same_two_seconds(sender: Sender) -> None:
    """Three of twenty are missing, at their beginning."""
    sender.rates_hz[ATTITUDE] = 0.0
    while not sender.asked:
        sender.run(0.1)
    first_s = sender.asked[0][0]
    for seconds, rate_hz in ((0.5, 10.0), (0.3, 0.0), (2.0, 10.0)):
        sender.rates_hz[AIRSPEED] = rate_hz
        sender.run(seconds)
    later = {message_id: at_s - first_s for at_s, message_id, _ in sender.asked if at_s > first_s}
    assert later == {ATTITUDE: pytest.approx(2.5), AIRSPEED: pytest.approx(2.5)}


def test_nine_tenths_as_often_is_not_slowed(sender: Sender) -> None:
    sender.rates_hz[AIRSPEED] = 9.0
    sender.run(4.0)
    sender.rates_hz[ATTITUDE] = 0.0
    sender.run(3.0)
    assert asked(sender) == {ATTITUDE}


def test_two_that_were_missing_come_again_once_the_rarer_has_been_counted(sender: Sender) -> None:
    """Messages of 2 Hz are counted over 8 s, and looked at each half of a second."""
    sender.rates_hz |= {ATTITUDE: 0.0, STATUS: 0.0}
    sender.run(20.0)
    assert asked(sender) == {ATTITUDE, STATUS}
    sender.rates_hz |= {ATTITUDE: 10.0, STATUS: 2.0}
    sender.run(60.0)
    again = sender.logged[-1]
    assert again.text == "sends ATTITUDE, SYS_STATUS again"
    assert 8.0 <= again.at_s - sender.asked[-1][0] <= 9.0


def test_a_refusal_after_it_came_again_is_reported_again(sender: Sender) -> None:
    sender.answer = m.MAV_RESULT_DENIED
    for _ in range(2):
        sender.rates_hz[ATTITUDE] = 0.0
        sender.run(12.0)
        sender.rates_hz[ATTITUDE] = 10.0
        sender.run(12.0)
    words = "refuses to send ATTITUDE as often as asked for", "sends ATTITUDE again"
    said = sender.logged.of("streams", 2)
    assert [text for text in said if text in words] == [*words, *words]


def test_rare_ones_of_motion_are_counted_since_the_request_before() -> None:
    """Of 2 Hz as asked for, 1.2 Hz come: over 2 s as over the usual 8 s they are slowed, and not missing."""
    sends = Sender()
    sends.vehicle.rates_hz = ASKED_HZ | {AIRSPEED: 2.0}
    sends.rates_hz[AIRSPEED] = 2.0
    sends.run(20.0)
    assert sends.asked == []
    sends.rates_hz |= {ATTITUDE: 0.0, AIRSPEED: 1.2}
    sends.run(5.0)
    first_s, second_s = sorted({at_s for at_s, *_ in sends.asked})
    assert second_s - first_s == pytest.approx(2.5)
    assert {message_id for at_s, message_id, _ in sends.asked if at_s == second_s} == {ATTITUDE, AIRSPEED}


def test_one_that_never_comes_is_missing_after_two_seconds_of_looks() -> None:
    """Of which the first is at 0.1 s."""
    sends = Sender()
    sends.rates_hz[ATTITUDE] = 0.0
    sends.run(3.0)
    assert sends.asked[0][0] == pytest.approx(2.1)


def test_one_that_rejects_an_interval_for_now_and_accepts_it_then_does_not_refuse(sender: Sender) -> None:
    sender.rates_hz[ATTITUDE], sender.answer = 0.0, m.MAV_RESULT_TEMPORARILY_REJECTED
    sender.run(3.0)
    sender.answer = m.MAV_RESULT_ACCEPTED
    sender.run(10.0)
    assert len(sender.asked) > 2
    assert [text for text in sender.logged.of("streams") if text.startswith("refuses")] == []


def test_those_that_are_not_of_motion_are_not_asked_for_together(sender: Sender) -> None:
    sender.rates_hz |= {STATUS: 1.6, ATTITUDE: 0.0}
    sender.run(3.0)
    assert asked(sender) == {ATTITUDE}
    others = Sender()
    others.run(20.0)
    others.rates_hz |= {STATUS: 0.0, ATTITUDE: 8.0}
    others.run(8.0)
    assert asked(others) == {STATUS}


def test_with_one_of_motion_missing_beside_another_those_of_motion_that_are_slowed_are_asked_for_too(
    sender: Sender,
) -> None:
    sender.rates_hz |= {ATTITUDE: 0.0, STATUS: 0.0, AIRSPEED: 8.0}
    sender.run(20.0)
    (both_s,) = {at_s for at_s, message_id, _ in sender.asked if message_id == STATUS}
    assert {message_id for at_s, message_id, _ in sender.asked if at_s == both_s} == {ATTITUDE, STATUS, AIRSPEED}


def test_rare_messages_are_counted_over_sixteen_of_them_and_quick_ones_over_two_seconds() -> None:
    assert [_window_s(each) for each in (50.0, 10.0, 5.0)] == [2.0] * 3
    assert [_window_s(each) for each in (4.0, 2.0, 1.0, 0.5)] == [4.0, 8.0, 16.0, 32.0]


@settings(deadline=None, max_examples=25, derandomize=True)
@given(sent=st.floats(8.0, 400.0), arriving=st.floats(0.3, 1.0))
def test_too_few_are_less_than_half_and_less_than_chance_explains(sent: float, arriving: float) -> None:
    """The mean of a binomial distribution is n p, its variance n p (1 - p)."""
    mean, sigma = sent * arriving, math.sqrt(sent * arriving * (1.0 - arriving))
    limit = min(mean / 2.0, mean - 4.0 * sigma)
    few = [count for count in range(int(sent) + 1) if _is_too_few(count, sent, arriving)]
    assert few == [count for count in range(int(sent) + 1) if count < limit and mean > 1.0]


def test_where_less_than_eight_should_have_come_since_a_silence_none_is_missing(sender: Sender) -> None:
    """Looks are at 22.1 s and 22.6 s: of attitudes 5 and 10 should have come."""
    sender.rates_hz[ATTITUDE] = 0.0
    sender.run(2.0, silent=True)
    sender.run(1.0)
    assert sender.asked[0][0] == pytest.approx(22.6)
    assert ATTITUDE in asked(sender)


def test_where_hardly_any_should_come_none_is_missing() -> None:
    assert not _is_too_few(0, 9.0, 0.1)
    assert _is_too_few(0, 1.5, 1.0)
    assert not _is_too_few(0, 0.9, 1.0)
    assert [_is_too_few(count, 20.0, 1.0) for count in (9, 10)] == [True, False]


def counted(vehicle: Any, counts: MessageCounts, received: int, lost: int, attitudes: int, since_s: float) -> None:
    """Let frames arrive, of which some are attitudes, and look."""
    vehicle.sequence.received += received
    vehicle.sequence.lost += lost
    vehicle.messages_in[KINDS[ATTITUDE].index] += attitudes
    counts.add(vehicle, vec[i64]([KINDS[ATTITUDE].index]), since_s)


def test_a_ring_of_looks_gives_what_came_in_the_last_of_them_wherever_it_begins() -> None:
    """Look k brings k attitudes and as many lost frames; of no news the time isn't counted."""
    vehicle: Any = SimpleNamespace(messages_in=[0] * len(KINDS), sequence=SimpleNamespace(received=7, lost=3))
    counts = MessageCounts(5, 1)
    assert counts.looks == 0
    for look in range(23):
        counted(vehicle, counts, look, look, look, 0.5)
        if look >= 4:
            for span in (1, 2, 4):
                newest = sum(look - back for back in range(span))
                assert counts.arrived(0, span) == newest
                assert counts.received_s(span) == pytest.approx(0.5 * span)
                assert counts.share_arriving(span) == 0.5
    counted(vehicle, counts, 0, 0, 0, 0.5)
    assert counts.received_s(2) == pytest.approx(0.5)
    assert counts.share_arriving(1) == 1.0
    counted(vehicle, counts, 4, -2, 4, 0.5)
    assert counts.share_arriving(1) == 1.0
    counted(vehicle, counts, 0, 1, 0, 0.5)
    assert counts.share_arriving(1) == 0.0
    counts.clear()
    counted(vehicle, counts, 1, 0, 1, 0.5)
    counted(vehicle, counts, 1, 3, 1, 0.25)
    assert (counts.looks, counts.received_s(1), counts.share_arriving(1)) == (2, 0.25, 0.25)


@pytest.mark.parametrize("why", ["not asked yet", "a command is under way", "not heard"])
def test_nothing_is_asked_of_one_that_has_not_been_asked_or_is_busy(sender: Sender, why: str) -> None:
    vehicle = sender.vehicle
    sender.rates_hz[ATTITUDE] = 0.0
    if why == "not asked yet":
        vehicle.start_up.asked_for_telemetry = False
    elif why == "not heard":
        vehicle.connection.state = LinkState.LOST
    else:
        queue, vehicle.commands = vehicle.commands, SimpleNamespace(outcome=Outcome.WAITING, due=lambda _: None)
    sender.run(10.0)
    assert sender.asked == []
    if why == "not asked yet":
        vehicle.start_up.asked_for_telemetry = True
    elif why == "not heard":
        vehicle.connection.state = LinkState.CONNECTED
    else:
        vehicle.commands = queue
    asked_s = sender.now * 1e-9
    sender.run(4.0)
    at_s = sender.asked[0][0] - asked_s
    assert at_s <= 0.6 if why == "a command is under way" else 2.0 <= at_s <= 3.0, "counted again"


def test_requests_come_2_5_and_5_and_10_s_after_one_another(sender: Sender) -> None:
    sender.rates_hz[ATTITUDE] = 0.0
    sender.run(22.0)
    times_s = [at_s for at_s, *_ in sender.asked]
    assert [later_s - earlier_s for earlier_s, later_s in pairwise(times_s)] == pytest.approx([2.5, 5.0, 10.0])


def test_other_rates_are_expected_from_when_they_are_asked_for(sender: Sender) -> None:
    sender.vehicle.rates_hz = ASKED_HZ | {ATTITUDE: 2.0}
    sender.rates_hz[ATTITUDE] = 2.0
    sender.run(20.0)
    assert sender.asked == []
    sender.vehicle.rates_hz = dict(ASKED_HZ)
    sender.run(4.0)
    assert [(each, interval_s) for _, each, interval_s in sender.asked[:1]] == [(ATTITUDE, pytest.approx(0.1))]


def test_another_link_is_counted_again(sender: Sender) -> None:
    """Its numbers begin at 0: the loss of both together would be none of either."""
    sender.vehicle.sequence = SimpleNamespace(received=0, lost=0)
    sender.run(10.0)
    assert sender.asked == []
    assert sender._watch._streams[0][1].sequence is sender.vehicle.sequence


def test_the_second_message_that_is_missing_is_named_with_the_first_and_both_come_again(sender: Sender) -> None:
    sender.rates_hz[ATTITUDE] = 0.0
    sender.run(4.0)
    sender.rates_hz[AIRSPEED] = 0.0
    sender.run(12.0)
    sender.rates_hz |= {ATTITUDE: 10.0, AIRSPEED: 10.0}
    sender.run(20.0)
    ends = " less than half as often as asked for, or not at all; it is asked again"
    first, second, again = sender.logged.of("streams", 2)
    assert first == f"sends ATTITUDE{ends}"
    assert second.endswith(ends)
    assert "VFR_HUD" in second
    assert again == "sends ATTITUDE, VFR_HUD again"
    assert sender.logged[0].details == {"messages": "ATTITUDE"}


@pytest.mark.parametrize(
    ("command", "said"), [(m.MAV_CMD_SET_MESSAGE_INTERVAL, True), (m.MAV_CMD_DO_REPOSITION, False)]
)
def test_only_a_refusal_of_the_interval_is_one(sender: Sender, command: int, said: bool) -> None:
    sender.rates_hz[ATTITUDE] = 0.0
    sender.run(3.0)
    sender.vehicle.commands = SimpleNamespace(
        outcome=Outcome.REFUSED, refusal=(command, 2), due=lambda _: None, send=lambda *_: None
    )
    sender.run(1.0)
    assert len([each for each in sender.logged.of("streams") if each.startswith("refuses")]) == said


def test_without_heartbeats_they_are_asked_for_once_and_beside_what_is_missing(sender: Sender) -> None:
    sender.rates_hz |= {HEARTBEAT: 0.0, ATTITUDE: 0.0}
    sender.run(18.0)
    assert asked(sender) >= {ATTITUDE}
    sender.vehicle.connection.state = LinkState.MUTE
    sender.run(70.0)
    for text in sender.logged.of("streams"):
        assert text.count("HEARTBEAT") <= 1


@pytest.mark.parametrize("phase", list(Phase))
def test_while_all_loiter_at_the_end_none_looks(phase: Phase) -> None:
    looked = list[Instant]()
    intervals: Any = SimpleNamespace(check_all=looked.append)
    cycle: Any = SimpleNamespace(flight=SimpleNamespace(phase=phase), now=Instant(3))
    RequestedAgain(intervals).run(cycle)
    assert looked == ([] if phase is Phase.LOITERING else [Instant(3)])

"""What is measured of each of a vehicle's links, and from which limits on another one is used."""

from __future__ import annotations

import math

import pytest

from airlink.clock import LONG_AGO, NANOSECONDS, Instant, after
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame, FrameWriter
from airlink.messages import Message
from airlink.messages.command import CommandAck
from airlink.messages.system import Heartbeat, Timesync
from airlink.messages.telemetry import Attitude, GlobalPositionInt
from airlink.receiver import Receiver
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.link.vehicle_links import Link, Links, is_one_clock, links_by

BEGUN_S = 100.0
PORTS = [Address("127.0.0.1", 14550 + number) for number in range(4)]


def at(later_s: float) -> Instant:
    return after(Instant(0), BEGUN_S + later_s)


def exchange(link: Link, sent_s: float, half_s: float, ahead_s: float = 0.0) -> None:
    """Send a request and have it answered; the vehicle's clock is ahead of ours."""
    trips, request = link.round_trips, link.round_trips.request(at(sent_s))
    assert trips.is_answer(request)
    answer = Timesync(at(sent_s + half_s + ahead_s), request.ts1_ns)
    trips.measure(answer, at(sent_s + 2.0 * half_s))


def linked(*halves_s: float, ahead_s: tuple[float, ...] = (0.0, 0.0, 0.0), answers: int = 8) -> Links:
    """Return links that have been received until 0 s, and by which the clock is known by so many answers."""
    connections = [Connection(number, PORTS[number]) for number, _ in enumerate(halves_s)]
    links = Links(links_by(connections, 0.0, by_utc=False))
    for link, half_s, each_s in zip(links.each, halves_s, ahead_s, strict=False):
        for number in range(answers):
            exchange(link, 0.25 * number - 10.0, half_s, each_s)
        link.connection.record_frame(at(0.0), heartbeat=True)
    links.compare_clocks(at(0.0))
    return links


def received(links: Links, later_s: float) -> None:
    for link in links.each:
        link.connection.record_frame(at(later_s), heartbeat=True)


def chosen(links: Links, later_s: float) -> int:
    received(links, later_s)
    links.compare_clocks(at(later_s))
    links.choose(at(later_s))
    return links.in_use.number


@pytest.mark.parametrize(
    ("down", "up", "jitter_s", "expected_s"),
    [
        (0.0, 0.0, math.nan, 0.1),
        (0.0, 0.0, 0.02, 0.12),
        (0.5, 0.0, 0.02, 0.12 + 0.35),
        (0.1, 0.2, math.nan, 0.1 + 0.25 * 0.35),
        (1.0, 0.0, math.nan, 0.1 + 99.0 * 0.35),
    ],
)
def test_a_setpoint_comes_through_after_delay_jitter_and_as_many_tries_as_losses_take(
    down: float, up: float, jitter_s: float, expected_s: float
) -> None:
    """p / (1 - p) tries are lost on average, each takes a round trip of 0.2 s and 0.15 s more."""
    (link,) = linked(0.1).each
    link.loss_down, link.loss_up, link.jitter.jitter_s = down, up, jitter_s
    assert link.expected_s == pytest.approx(expected_s)
    link.loss_down, link.loss_up = up, down
    assert link.expected_s == pytest.approx(expected_s)


@pytest.mark.parametrize(("answers", "known"), [(3, False), (4, True)])
def test_a_link_is_known_by_four_answers(answers: int, known: bool) -> None:
    (link,) = linked(0.1, answers=answers).each
    assert link.is_known == known
    assert math.isfinite(link.expected_s) == known
    assert link.usable(at(0.0)) == known
    for number in range(20):
        link.round_trips.request(at(-3.0 + 0.1 * number))
    assert link.unanswered(at(0.0)) == (20 if known else 0)
    assert bool(link.failing(at(0.0))) == known


class Lossy:
    """A link on which 5 frames come a second, and an answer to each of 5 requests, but for what is lost."""

    def __init__(self) -> None:
        (self.link,) = linked(0.05).each
        self.tick = 0

    def run(self, seconds: float, down: int = 0, up: int = 0) -> None:
        """Lose every `down`-th frame, and of the requests every `up`-th; of the answers every `down`-th."""
        trips = self.link.round_trips
        for _ in range(round(5.0 * seconds)):
            self.tick += 1
            now_s, sent = 0.2 * self.tick, self.tick
            if not down or sent % down:
                self.link.sequence.observe(sent % 256, at(now_s), at(now_s - 0.2))
                self.link.connection.record_frame(at(now_s), heartbeat=True)
            request = trips.request(at(now_s - 0.1))
            if not (up and sent % up == 0) and not (down and sent % down == 1):
                assert trips.is_answer(request)
                trips.record_answer(at(now_s))
                self.link.clock.samples += 1
            self.link.look(at(now_s))


@pytest.mark.parametrize(("down", "up"), [(5, 0), (0, 4), (4, 3)])
def test_the_shares_lost_up_and_down_are_those_that_are_lost_and_forgotten_within_20_s(down: int, up: int) -> None:
    """An answer has passed both ways, a frame one. Of 60 s 1 - e^-3 is remembered, a share of 1/e 20 s later."""
    lossy = Lossy()
    lossy.run(60.0, down, up)
    lost_down, lost_up = (1.0 / each if each else 0.0 for each in (down, up))
    assert lossy.link.loss_down == pytest.approx(lost_down, abs=0.01)
    assert lossy.link.loss_up == pytest.approx(lost_up, abs=0.03)
    lossy.run(20.0)
    old, new = (1.0 - math.exp(-3.0)) / math.e, 1.0 - 1.0 / math.e
    left = lost_down * old / (old + new)
    assert lossy.link.loss_down == pytest.approx(left, abs=0.01)
    both = ((1.0 - lost_down) * (1.0 - lost_up) * old + new) / (old + new)
    assert lossy.link.loss_up == pytest.approx(1.0 - both / (1.0 - left), abs=0.02)


def test_what_is_lost_when_nothing_passes_is_no_share_of_a_link_that_does() -> None:
    """It counts again from when something comes, without the requests of meanwhile."""
    lossy = Lossy()
    lossy.run(60.0, 5)
    link = lossy.link
    before = link.loss_down, link.loss_up
    for tick in range(50):
        link.round_trips.request(at(60.0 + 0.2 * tick))
        link.look(at(60.6 + 0.2 * tick))
        assert (link.loss_down, link.loss_up) == before
    link.round_trips.forget_requests(at(70.5))
    lossy.tick = 353
    link.sequence.observe(353 % 256, at(70.6), at(60.0))
    link.connection.record_frame(at(70.6), heartbeat=True)
    link.look(at(70.6))
    lossy.run(1.0)
    assert link.loss_down == pytest.approx(before[0], abs=0.03)
    assert link.loss_up < 0.03


@pytest.mark.parametrize(("silent_s", "why"), [(0.49, ""), (0.51, "nothing has come for 0.5 s")])
def test_a_link_on_which_nothing_comes_for_half_a_second_is_silent(silent_s: float, why: str) -> None:
    (link,) = linked(0.1).each
    assert link.failing(at(silent_s)) == why
    assert link.usable(at(silent_s)) == (not why)


@pytest.mark.parametrize(
    ("down", "up", "requests"), [(0.0, 0.0, 2), (0.5, 0.0, 10), (0.0, 0.5, 10), (0.2, 0.375, 10), (0.02, 0.0, 2)]
)
def test_requests_in_a_row_that_are_not_answered_are_the_links_end_where_losses_do_not_explain_them(
    down: float, up: float, requests: int
) -> None:
    """Half of the answers are lost: ten in a row once in 1024 times. Two at least."""
    (link,) = linked(0.1).each
    link.loss_down, link.loss_up = down, up
    for number in range(requests):
        assert link.failing(at(0.4)) == ""
        link.round_trips.request(at(-1.0 + 0.01 * number))
    assert link.failing(at(0.4)) == f"{requests} requests in a row aren't answered"


def test_a_failure_bars_for_two_seconds_and_again_within_a_minute_for_twice_as_long() -> None:
    (link,) = linked(0.1).each
    barred_s = []
    for failed_s in (0.0, 59.9, 100.0, 160.1, 170.0, 180.0, 190.0, 200.0, 210.0):
        link.bar(at(failed_s))
        barred_s.append((link.barred_until - at(failed_s)) / NANOSECONDS)
    assert barred_s == [2.0, 4.0, 8.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0]


@pytest.mark.parametrize(("other_s", "better"), [(0.119, True), (0.121, False)])
def test_another_is_better_by_a_third_and_more_once_it_has_been_for_a_second(other_s: float, better: bool) -> None:
    """0.7 · 0.2 s - 0.02 s = 0.12 s."""
    links = linked(0.2, other_s)
    assert [chosen(links, each) for each in (0.1, 0.6, 1.09)] == [1, 1, 1]
    links.each[1].jitter.jitter_s = 0.05
    assert chosen(links, 1.1) == 1
    links.each[1].jitter.jitter_s = 0.0
    assert [chosen(links, each) for each in (1.2, 2.19, 2.2)] == [1, 1, 2 if better else 1]
    assert links.used == ([(Instant(0), 1), (at(2.2), 2)] if better else [(Instant(0), 1)])


def test_of_several_the_one_by_which_a_setpoint_comes_soonest_is_taken_unless_it_is_barred() -> None:
    links = linked(0.3, 0.1, 0.05)
    links.each[2].barred_until = at(3.0)
    assert [chosen(links, 0.5 * each) for each in range(1, 10)] == [1] * 7 + [3] * 2
    assert links.used[-1] == (at(4.0), 3)


@pytest.mark.parametrize(("jitter_s", "drains_s"), [(math.nan, 0.35), (0.01, 0.38)])
def test_setpoints_on_a_slower_link_come_for_as_long_as_it_is_slower_and_its_jitter(
    jitter_s: float, drains_s: float
) -> None:
    links = linked(0.4, 0.05)
    links.each[0].jitter.jitter_s = jitter_s
    chosen(links, 0.1)
    assert chosen(links, 1.2) == 2
    assert links.drains_until == pytest.approx(at(1.2 + drains_s), abs=1e3)


def test_one_that_fails_is_left_at_once_and_barred_and_a_faster_one_drains_nothing() -> None:
    links = linked(0.05, 0.4)
    links.each[1].connection.record_frame(at(0.6), heartbeat=True)
    text = links.choose(at(0.6))
    assert text == "link 2 is in use: on link 1 nothing has come for 0.6 s"
    assert (links.in_use.number, links.drains_until) == (2, LONG_AGO)
    assert links.each[0].barred_until == at(2.6)
    text = ""
    for tick in range(7, 40):
        received(links, 0.1 * tick)
        text = text or links.choose(at(0.1 * tick))
        assert (links.in_use.number == 2) == (tick < 36)
    assert text == "link 1 is in use: a setpoint comes through in 50 ms instead of 400 ms"


def test_none_is_taken_that_is_not_usable() -> None:
    links = linked(0.2, 0.05)
    links.each[1].connection.state = LinkState.STALE
    for tick in range(30):
        links.each[0].connection.record_frame(at(0.1 * tick), heartbeat=True)
        links.each[1].connection.last_received = at(0.1 * tick)
        assert links.choose(at(0.1 * tick)) == ""
    links.each[1].connection.state = LinkState.MUTE
    links.each[1].agrees = False
    assert links.choose(at(3.0)) == ""
    links.each[1].agrees = True
    links.each[0].connection.last_received = links.each[1].connection.last_received = at(4.0)
    assert links.choose(at(4.0)) == ""
    links.each[0].connection.last_received = links.each[1].connection.last_received = at(5.0)
    assert links.choose(at(5.0)) != ""


@pytest.mark.parametrize(("ahead_s", "one"), [(0.249, True), (-0.249, True), (0.251, False), (-0.251, False)])
def test_two_clocks_may_be_one_if_they_differ_by_half_of_both_round_trips_and_a_tenth(
    ahead_s: float, one: bool
) -> None:
    """0.1 s + 0.05 s + 0.1 s; another's is said once, after three seconds, and never of a link that may be alone."""
    links = linked(0.1, 0.05, ahead_s=(0.0, ahead_s))
    first, second = links.each
    assert is_one_clock(first.clock, second.clock, at(0.0)) == second.agrees == one
    said = [links.compare_clocks(at(each)) for each in (1.0, 2.99, 3.0, 3.1, 60.0)]
    assert said == ([[]] * 5 if one else [[], [], [second], [], []])
    first.connection.state = LinkState.LOST
    assert links.compare_clocks(at(60.1)) == []
    assert second.agrees


def test_a_clock_that_agrees_meanwhile_is_watched_for_three_seconds_again() -> None:
    links = linked(0.1, 0.05, ahead_s=(0.0, 0.3))
    first, second = links.each
    first.connection.state = LinkState.SEARCHING
    assert links.compare_clocks(at(2.0)) == []
    first.connection.state = LinkState.CONNECTED
    assert [links.compare_clocks(at(each)) for each in (2.5, 5.4, 5.5)] == [[], [], [second]]


def test_a_link_whose_clock_is_not_known_neither_agrees_nor_differs() -> None:
    links = linked(0.1, 0.05, ahead_s=(0.0, 9.0), answers=3)
    first, second = links.each
    assert [links.compare_clocks(at(each)) for each in (0.0, 9.0)] == [[], []]
    assert (first.agrees, second.agrees, second.reported) == (True, False, False)
    for number in range(4):
        exchange(second, 0.25 * number, 0.05, 9.0)
    assert [links.compare_clocks(at(each)) for each in (10.0, 20.0)] == [[], []], "the first isn't known yet"
    assert not second.agrees


def frame(message: Message) -> Frame:
    found = Receiver().first(Datagram(0, PORTS[0], FrameWriter(3, 1).encode(message)), Instant(0))
    assert found is not None
    return found


def attitude(stamp_s: float) -> Frame:
    return frame(Attitude(stamp_s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_telemetry_is_taken_once_from_whichever_link_brings_it_first() -> None:
    links = linked(0.1, 0.05)
    first, second = links.each
    assert [links.is_news(attitude(50.0), each) for each in (second, first, second)] == [True, False, False]
    assert [links.is_news(attitude(49.9), each) for each in (second, first)] == [False, False]
    assert [links.is_news(attitude(50.1), each) for each in (first, second)] == [True, False]
    assert links.is_news(frame(GlobalPositionInt(50.0, *[0.0] * 8)), second), "another kind of message"
    second.agrees = False
    assert not links.is_news(attitude(51.0), second)
    assert links.is_news(attitude(51.0), first)


def test_a_stamp_that_is_older_by_ten_seconds_is_of_a_clock_that_has_restarted_on_the_link_in_use() -> None:
    links = linked(0.1, 0.05)
    first, second = links.each
    links.is_news(attitude(50.0), first)
    assert not links.is_news(attitude(40.1), first)
    assert not links.is_news(attitude(39.9), second)
    assert links.is_news(attitude(39.9), first)
    assert links.is_news(attitude(40.0), second)
    links.restart()
    assert links.is_news(attitude(39.0), second)


def test_what_has_no_stamp_counts_on_the_link_in_use_and_answers_on_each_that_is_the_vehicles() -> None:
    links = linked(0.1, 0.05)
    first, second = links.each
    for message, elsewhere in ((Heartbeat(1, 3), False), (CommandAck(400, 0), True)):
        assert links.is_news(frame(message), first)
        assert links.is_news(frame(message), second) == elsewhere
    unknown = frame(Heartbeat(1, 3))
    unknown.message = None
    assert [links.is_news(unknown, each) for each in (first, second)] == [True, False]
    second.agrees = False
    assert not links.is_news(frame(CommandAck(400, 0)), second)


def test_a_link_is_found_by_its_connection_and_by_where_it_is() -> None:
    links = linked(0.1, 0.05)
    first, second = links.each
    assert [link.number for link in links.each] == [1, 2]
    assert (links.of(second.connection), links.of(Connection(1, PORTS[1]))) == (second, first)
    assert (links.at(1, PORTS[3]), links.at(0, PORTS[3]), links.at(7, PORTS[0])) == (second, first, first)
    links.try_port(1, PORTS[2], at(1.0))
    third = links.each[-1]
    assert (third.number, third.connection.socket, third.connection.peer) == (3, 1, PORTS[2])
    assert (third.on_trial_since, first.on_trial_since == third.on_trial_since) == (at(1.0), False)
    assert links.at(1, PORTS[2]) is third
    assert third.history is not first.history
    assert (links.at(1, PORTS[1]), links.at(0, PORTS[2])) == (second, first)
    links.each.remove(second)
    links.try_port(0, PORTS[3], at(1.0))
    assert links.each[-1].number == 4


@pytest.mark.parametrize(
    ("near", "far", "ahead_s", "later_s", "proven"),
    [
        (3, 0, 0.0, 1.0, True),
        (2, 0, 0.0, 1.0, None),
        (3, 2, 0.0, 1.0, True),
        (3, 3, 0.0, 1.0, False),
        (3, 0, 1.0, 1.0, False),
        (0, 0, 1.0, 1.0, False),
        (3, 0, 0.0, 6.0, True),
        (3, 0, 0.0, 6.01, False),
    ],
)
def test_a_link_that_has_appeared_by_itself_is_proven_by_three_positions_and_the_clock_within_five_seconds(
    near: int, far: int, ahead_s: float, later_s: float, proven: bool | None
) -> None:
    links = linked(0.1)
    links.try_port(0, PORTS[2], at(1.0))
    trial = links.each[-1]
    assert links.judge_trial(trial, at(1.0)) is None
    for number in range(8):
        exchange(trial, 1.0 + 0.01 * number, 0.05, ahead_s)
    for _ in range(near):
        trial.compare_position(5.0)
    for _ in range(far):
        trial.compare_position(5.01)
    assert links.judge_trial(trial, at(later_s)) is proven
    links.compare_clocks(at(later_s))
    assert not trial.agrees, "it is on trial still"


def test_it_is_doubtful_whether_the_vehicle_receives_while_an_answer_is_overdue() -> None:
    links = linked(0.1, 0.05)
    assert not links.doubtful(at(0.0))
    links.each[1].round_trips.request(at(0.0))
    assert not links.doubtful(at(1.0))
    links.each[0].round_trips.request(at(0.0))
    assert not links.doubtful(at(0.27))
    assert links.doubtful(at(0.29))

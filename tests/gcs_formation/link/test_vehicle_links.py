"""Which of a vehicle's links is in use, by what each has measured."""

from __future__ import annotations

import math

import pytest

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import Address
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.link.vehicle_links import BARRED_MAX_S, BARRED_S, BETTER_S, JITTERS, OVERDUE_S, Links, links_by

TICK_S = 0.1


def at(seconds: float) -> Instant:
    return Instant(round(seconds * NANOSECONDS))


class Vehicle:
    """A vehicle that is received on its links, with delays each way, ms, and answers; its clock is ours."""

    def __init__(self, *delays_ms: float, ahead_s: tuple[float, ...] = (0.0, 0.0)) -> None:
        self.links = Links(
            links_by([Connection(n, Address("127.0.0.1", n)) for n, _ in enumerate(delays_ms)], 0.0, by_utc=False)
        )
        self.delays_ms, self.ahead_s = list(delays_ms), ahead_s
        self.up, self.down = [True] * len(delays_ms), [True] * len(delays_ms)
        self.now_s, self.said = 0.0, list[tuple[float, str]]()
        self._answers = list[tuple[float, int, float]]()

    def run(self, seconds: float) -> None:
        """Let frames come each 0.1 s, requests go out each 0.2 s, and choose."""
        for _ in range(round(seconds / TICK_S)):
            self.now_s = round(self.now_s + TICK_S, 3)
            for place, link in enumerate(self.links.each):
                one_way_s = self.delays_ms[place] / 1e3
                if self.down[place]:
                    link.connection.record_frame(at(self.now_s), heartbeat=True)
                    link.sequence.observe((link.sequence.received + link.sequence.lost) % 256, at(self.now_s), at(0))
                if round(self.now_s / TICK_S) % 2 == 0:
                    link.round_trips.request(at(self.now_s))
                    if self.up[place] and self.down[place]:
                        self._answers.append((self.now_s + 2.0 * one_way_s, place, self.now_s))
            self._answer()
            self.links.compare_clocks(at(self.now_s))
            text = self.links.choose(at(self.now_s))
            if text:
                self.said.append((self.now_s, text))

    def _answer(self) -> None:
        for due_s, place, sent_s in [each for each in self._answers if each[0] <= self.now_s]:
            self._answers.remove((due_s, place, sent_s))
            trips, shown_s = self.links.each[place].round_trips, (sent_s + due_s) / 2 + self.ahead_s[place]
            answer = trips.request(at(sent_s))
            trips.requests -= 1
            answer.tc1_ns = at(shown_s)
            if trips.is_answer(answer):
                trips.record_answer(at(due_s))
                trips.measure(answer, at(due_s))

    @property
    def used(self) -> int:
        return self.links.in_use.number


def test_the_first_is_used_as_long_as_no_other_is_better() -> None:
    vehicle = Vehicle(50, 50)
    vehicle.run(20.0)
    assert vehicle.used == 1
    assert not vehicle.said


def test_a_better_one_is_taken_once_it_has_been_better_for_a_second() -> None:
    vehicle = Vehicle(200, 50)
    vehicle.run(10.0)
    assert vehicle.used == 2
    known_s = 0.8 + 2 * 0.2
    assert known_s + BETTER_S - TICK_S <= vehicle.said[0][0] < known_s + BETTER_S + 1.0


@pytest.mark.parametrize("dies", ["up", "down"])
def test_one_that_dies_is_left_within_a_second(dies: str) -> None:
    vehicle = Vehicle(40, 300)
    vehicle.run(10.0)
    getattr(vehicle, dies)[0] = False
    vehicle.run(0.9)
    assert vehicle.used == 2


def test_a_slow_one_on_which_nothing_comes_is_left_before_an_answer_is_overdue() -> None:
    vehicle = Vehicle(400, 400)
    vehicle.run(10.0)
    vehicle.down[0] = False
    vehicle.run(0.7)
    assert vehicle.used == 2


def test_an_answer_is_overdue_later_where_round_trips_vary() -> None:
    """The link isn't left because of what jitter explains."""
    vehicle = Vehicle(200)
    vehicle.run(10.0)
    (link,) = vehicle.links.each
    for jitter_s in (math.nan, 0.0, 0.03):
        link.jitter.jitter_s = jitter_s
        known_s = 0.0 if math.isnan(jitter_s) else jitter_s
        sent_s, usual_s = vehicle.now_s + 1.0, 0.4 + OVERDUE_S + JITTERS * known_s
        link.round_trips.forget_requests(at(sent_s - 0.5))
        link.round_trips.request(at(sent_s))
        assert link.unanswered(at(sent_s + usual_s - 0.001)) == 0
        assert link.unanswered(at(sent_s + usual_s + 0.001)) == 1


def test_one_that_fails_again_and_again_is_barred_for_longer_each_time() -> None:
    vehicle = Vehicle(40, 300)
    vehicle.run(10.0)
    barred_s = list[float]()
    for _ in range(6):
        vehicle.down[0] = False
        vehicle.run(1.0)
        barred_s.append(vehicle.links.each[0].barred_s)
        vehicle.down[0] = True
        vehicle.run(barred_s[-1] + 3.0)
        assert vehicle.used == 1
    assert barred_s == [min(BARRED_S * 2**n, BARRED_MAX_S) for n in range(6)]


def test_where_both_die_the_one_in_use_stays_and_the_first_to_return_is_taken() -> None:
    vehicle = Vehicle(40, 50)
    vehicle.run(10.0)
    vehicle.down[:] = [False, False]
    vehicle.run(3.0)
    assert vehicle.used == 1
    vehicle.down[1] = True
    vehicle.run(1.0)
    assert vehicle.used == 2


def test_a_clock_that_is_another_s_is_not_the_vehicle_s_link() -> None:
    vehicle = Vehicle(40, 20, ahead_s=(0.0, 1.0))
    vehicle.run(10.0)
    assert vehicle.used == 1
    assert not vehicle.links.each[1].agrees
    assert vehicle.links.each[1].reported


def test_half_of_both_round_trips_may_be_between_two_readings_of_one_clock() -> None:
    vehicle = Vehicle(400, 20, ahead_s=(0.4, 0.0))
    vehicle.run(10.0)
    assert vehicle.used == 2


@pytest.mark.parametrize("first_ahead_s", [0.0, 0.5])
def test_stamps_are_mapped_on_as_before_when_another_link_is_used(first_ahead_s: float) -> None:
    vehicle = Vehicle(40, 100, ahead_s=(first_ahead_s, first_ahead_s + 0.05))
    vehicle.run(10.0)
    stamp_s = 9.9
    before = vehicle.links.in_use.clock.to_instant(stamp_s)
    vehicle.down[0] = False
    vehicle.run(0.8)
    assert vehicle.used == 2
    assert vehicle.links.in_use.clock.to_instant(stamp_s) == pytest.approx(before, abs=2e6)
    assert vehicle.links.in_use.clock.asymmetry_s == pytest.approx(0.05, abs=0.005)


def test_setpoints_of_a_slower_link_may_come_for_as_long_as_it_is_slower() -> None:
    vehicle = Vehicle(400, 50)
    vehicle.run(10.0)
    (at_s, _), drains = vehicle.said[0], vehicle.links.drains_until
    assert drains / NANOSECONDS == pytest.approx(at_s + 0.35, abs=0.02)


def test_a_link_that_received_nothing_is_replaced_by_another() -> None:
    vehicle = Vehicle(40, 50)
    vehicle.down[0] = False
    vehicle.run(3.0)
    assert vehicle.links.each[0].connection.state is LinkState.SEARCHING
    assert vehicle.used == 2

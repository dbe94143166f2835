"""When a link counts as full: a queue that never empties and losses, or a radio that says so."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.messages.system import Timesync
from flight_model.earth import GeodeticOrigin
from gcs_formation.budget.levels import LEVELS
from gcs_formation.budget.traffic import Stated, bytes_per_s, flight_hz
from gcs_formation.features.link_budget.link_budget import CALM_S, IN_VAIN_S, SETTLES_S, TRY_AGAIN_S, LinkBudget
from gcs_formation.features.link_budget.link_load import LinkLoad
from gcs_formation.fleet.heartbeats import PROBE_S, HeartbeatScheduler
from gcs_formation.link.link_health import Connection
from gcs_formation.link.radio_reports import RadioReports
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.vehicle import Vehicle
from tests.gcs_formation.event_log import EventLog

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
AT_ONCE, WAITS = 0.03, 0.8


class Link:
    """A vehicle whose link has some delay and losses, watched once a second."""

    def __init__(self, stated: Stated | None = None) -> None:
        self.vehicle = Vehicle(VehicleId(1, 2), 0, ArduPlane(2, ORIGIN, 0.25), Connection(0), 10.0)
        self.vehicle.connection.record_frame(Instant(0), heartbeat=True)
        self.load, self.logged, self.now = LinkLoad(self.vehicle), EventLog(), Instant(0)
        named = {} if stated is None else {self.vehicle.identity: stated}
        vehicles = {self.vehicle.identity: self.vehicle}
        self.heartbeats = HeartbeatScheduler(vehicles, self.logged)
        self.budget = LinkBudget(vehicles, self.logged, RadioReports(()), self.heartbeats, named)

    def second(self, round_trip_s: float, lost: float = 0.0, free_percent: float | None = None) -> None:
        """Let a second pass, in which this share is lost both ways."""
        for quarter in range(4):
            sent = after(self.now, 0.25 * quarter)
            self.vehicle.round_trips.request(sent)
            middle = after(sent, 10.0 + round_trip_s / 2)
            self.vehicle.round_trips.measure(Timesync(int(middle), int(sent)), after(sent, round_trip_s))
        sequence = self.vehicle.sequence
        sequence.received, sequence.lost = sequence.received + 100, sequence.lost + round(100 * lost / (1 - lost))
        sequence.asked += 100
        sequence.answers += round(100 * (1 - lost) ** 2)
        self.vehicle.bytes_in += 1000
        self.now = after(self.now, 1.0)
        self.load.look(self.now, free_percent)
        self.budget.due_requests(self.now)

    def seconds(self, count: float, *given: float) -> None:
        for _ in range(round(count)):
            self.second(*given)

    def full_seconds(self, count: float, capacity: float) -> None:
        """Let seconds pass in which it carries a share of what is sent at full rates, and loses the rest."""
        autopilot, all_hz = self.vehicle.autopilot, self.budget._each[0]._all_hz
        needs = [bytes_per_s(autopilot, flight_hz(autopilot, each, all_hz), each) for each in LEVELS]
        for _ in range(round(count)):
            self.second(WAITS, max(0.0, 1.0 - capacity * needs[0] / needs[self.level]))

    @property
    def level(self) -> int:
        return self.budget._each[0].level


@pytest.mark.parametrize(
    ("round_trip_s", "lost", "free_percent", "full"),
    [
        (AT_ONCE, 0.0, None, False),
        (AT_ONCE, 0.3, None, False),
        (WAITS, 0.0, None, False),
        (WAITS, 0.3, None, True),
        (AT_ONCE, 0.0, 10.0, True),
        (AT_ONCE, 0.3, 80.0, False),
    ],
    ids=["empty", "losing", "longer", "waiting and losing", "the radio's buffer", "losing, with a radio"],
)
def test_a_link_is_full_where_messages_wait_and_are_lost_or_its_radio_says_so(
    round_trip_s: float, lost: float, free_percent: float | None, full: bool
) -> None:
    link = Link()
    link.seconds(8, AT_ONCE)
    for _ in range(10):
        link.second(round_trip_s, lost, free_percent)
    assert link.load.full == full


def test_a_link_on_which_messages_wait_for_longer_and_longer_is_full_before_anything_is_lost() -> None:
    link = Link()
    link.seconds(8, AT_ONCE)
    for number in range(1, 13):
        link.second(AT_ONCE + 0.06 * number)
        if link.load.full:
            break
    assert number < 12
    assert link.load.lost_up == link.load.lost_down == 0.0


def test_answers_that_are_under_way_since_the_link_has_become_longer_are_not_lost() -> None:
    """1.4 s of requests, of 5 s: 28 % would seem to be lost up."""
    link = Link()
    link.seconds(8, AT_ONCE)
    link.vehicle.sequence.answers -= 140
    for _ in range(10):
        link.second(1.4)
        assert not link.load.full


@pytest.mark.parametrize("round_trip_s", [0.5, 1.5, 3.5])
def test_where_looks_are_late_requests_under_way_are_in_proportion_to_the_time_between_them(
    round_trip_s: float,
) -> None:
    """50 a second, and a look each two seconds; all are answered after a round trip."""
    now, sequence = Instant(0), SimpleNamespace(received=0, lost=0, asked=0, answers=0)
    trips = SimpleNamespace(shortest_s=lambda *_: round_trip_s, longest_s=lambda *_: round_trip_s)
    vehicle: Any = SimpleNamespace(sequence=sequence, round_trips=trips, bytes_in=0, bytes_out=0)
    load = LinkLoad(vehicle)
    for number in range(12):
        sequence.asked, sequence.answers = 100 * number, max(0, round(100 * number - 50 * round_trip_s))
        load.look(now, None)
        now = after(now, 2.0)
    assert load.lost_up == pytest.approx(0.0, abs=1e-9)
    assert load._looks[-1].due == pytest.approx(sequence.answers)


def test_where_no_round_trip_is_known_nothing_waits() -> None:
    link = Link()
    for _ in range(10):
        link.vehicle.sequence.received += 100
        link.vehicle.sequence.lost += 50
        link.now = after(link.now, 1.0)
        link.load.look(link.now, None)
        assert link.load.queue_s == 0.0
        assert not link.load.full
    assert link.load.lost_down == pytest.approx(1 / 3)


def test_losses_are_reported_by_direction() -> None:
    link = Link()
    link.seconds(10, AT_ONCE, 0.2)
    assert link.load.lost_down == pytest.approx(0.2)
    assert link.load.lost_up == pytest.approx(0.2)


def test_where_nothing_was_asked_nothing_is_lost_up() -> None:
    link = Link()
    for _ in range(3):
        link.vehicle.sequence.received, link.vehicle.bytes_in = link.vehicle.sequence.received + 100, 1000
        link.now = after(link.now, 1.0)
        link.load.look(link.now, None)
    assert (link.load.lost_up, link.load.lost_down) == (0.0, 0.0)


def test_requests_over_a_full_link_are_rare_and_irregular() -> None:
    """At regular times messages that come regularly would delay all of them, or none."""
    link = Link()
    link.seconds(8, AT_ONCE)
    assert link.heartbeats._slower[link.vehicle.identity] == (PROBE_S, False)
    link.seconds(6, WAITS, 0.3)
    assert link.level == 1
    assert link.heartbeats._slower[link.vehicle.identity] == (LEVELS[1].probe_s, True)


def test_rates_go_down_one_level_at_a_time_and_up_again_after_a_time_with_events() -> None:
    link = Link()
    link.seconds(8, AT_ONCE)
    link.full_seconds(6 + SETTLES_S + 2, 0.3)
    assert link.level == 2
    assert link.vehicle.limits.full
    assert link.vehicle.setpoints.interval_s == LEVELS[2].setpoint_s
    assert link.vehicle.commands.spares
    link.seconds(CALM_S + 8, AT_ONCE)
    assert link.level == 2, "what it would need at level 1 is more than it carried when it was full"
    link.seconds(TRY_AGAIN_S, AT_ONCE)
    assert link.level < 2
    assert not link.vehicle.limits.full
    full, fuller, again = link.logged.of("link_load", 2)[:3]
    assert full.startswith("the link of vehicle 2 is full (messages wait for 0.8 s, ")
    assert full.endswith(LEVELS[1].words)
    assert fuller.endswith(LEVELS[2].words)
    assert again == f"the link of vehicle 2 has room again: {LEVELS[1].words}"


def test_a_link_that_is_still_full_at_the_lowest_rates_gets_them_back() -> None:
    link = Link()
    link.seconds(8, AT_ONCE)
    link.full_seconds((len(LEVELS) - 1) * SETTLES_S + 4, 0.03)
    assert link.level == len(LEVELS) - 1
    link.full_seconds(IN_VAIN_S + 4, 0.03)
    assert link.level == 0
    assert link.logged.of("link_load", 2)[-1].startswith("the link of vehicle 2 is bad, not full")


@pytest.mark.parametrize("lost", [0.2, 0.3, 0.5])
def test_a_link_that_loses_as_much_of_fewer_bytes_gets_them_back_soon(lost: float) -> None:
    """It has become longer, and loses by itself: 42 s passed until it had telemetry as often as before."""
    link = Link()
    link.seconds(8, AT_ONCE)
    link.seconds(6 + SETTLES_S, WAITS, lost)
    assert link.level == 2
    link.seconds(SETTLES_S, WAITS, lost)
    assert link.level == 0
    assert (
        link.logged.of("link_load", 2)[-1]
        == f"the link of vehicle 2 is bad, not full: fewer bytes change nothing, and {LEVELS[0].words} again"
    )
    link.seconds(60, WAITS, lost)
    assert link.level == 0


def test_a_radio_that_the_scenario_states_begins_at_what_it_carries_and_stays_there() -> None:
    link = Link(Stated(3, 1000.0))
    assert link.vehicle.start_up_hz[33] == 2.0
    link.seconds(300, AT_ONCE)
    assert link.level == 3
    assert link.logged == []

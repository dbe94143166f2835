"""Each limit from both sides, of what counts as full and of what follows; counts are by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.budget.levels import LEVELS
from gcs_formation.features.link_budget.feature import FEATURE
from gcs_formation.features.link_budget.link_budget import CALM_S, SETTLES_S, LinkBudget
from gcs_formation.features.link_budget.link_load import LinkLoad
from gcs_formation.features.link_budget.stages import Budget
from gcs_formation.fleet.heartbeats import HeartbeatScheduler
from gcs_formation.link.link_health import Connection
from gcs_formation.link.radio_reports import RadioReports
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.setpoint_delivery import EVERYTHING, LOSSY_S
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog
from tests.gcs_formation.features.link_budget.test_link_load import AT_ONCE, ORIGIN, Link


class Load:
    """What a vehicle's counts show once a second, of round trips that are given."""

    def __init__(self) -> None:
        self.trips_s = [math.nan, math.nan]
        self.sequence = SimpleNamespace(received=0, lost=0, asked=0, answers=0)
        trips = SimpleNamespace(shortest_s=lambda *_: self.trips_s[0], longest_s=lambda *_: self.trips_s[1])
        vehicle: Any = SimpleNamespace(sequence=self.sequence, round_trips=trips, bytes_in=0, bytes_out=0)
        self.vehicle, self.load, self.now = vehicle, LinkLoad(vehicle), Instant(0)

    def second(
        self, trip_s: float, *, up: float = 0.0, down: float = 0.0, free: float | None = None, longest_s: float = 0.0
    ) -> LinkLoad:
        """Let a second pass, in which 1000 frames and 1000 requests are sent."""
        self.trips_s = [trip_s, longest_s or trip_s]
        self.sequence.received += round(1000 * (1.0 - down))
        self.sequence.lost += round(1000 * down)
        self.sequence.asked += 1000
        self.sequence.answers += round(1000 * (1.0 - up) * (1.0 - down))
        self.vehicle.bytes_in, self.vehicle.bytes_out = self.vehicle.bytes_in + 700, self.vehicle.bytes_out + 300
        self.now = after(self.now, 1.0)
        self.load.look(self.now, free)
        return self.load

    def seconds(self, count: int, trip_s: float, **given: Any) -> LinkLoad:
        for _ in range(count):
            self.second(trip_s, **given)
        return self.load


@pytest.mark.parametrize(
    ("queue_s", "loss", "full"),
    [(0.19, 0.16, False), (0.2, 0.16, False), (0.21, 0.16, True), (0.21, 0.14, False)],
)
@pytest.mark.parametrize("way", ["up", "down"])
def test_two_tenths_of_a_second_and_fifteen_percent_one_way_are_a_full_link(
    way: str, queue_s: float, loss: float, full: bool
) -> None:
    link = Load()
    link.seconds(10, 0.0)
    assert link.seconds(10, queue_s, **{way: loss}).full is full
    assert link.load.lost == pytest.approx(loss, abs=0.002)
    assert link.load.queue_s == pytest.approx(queue_s)


def test_five_seconds_of_losses_are_needed() -> None:
    link = Load()
    link.second(0.1)
    found = [link.second(0.5, up=0.3).full for _ in range(6)]
    assert found == [False] * 4 + [True] * 2


def test_what_was_lost_before_the_last_five_seconds_does_not_count() -> None:
    link = Load()
    link.seconds(8, 0.1)
    link.second(0.1, down=0.5)
    assert [round(link.second(0.1).lost_down, 3) for _ in range(6)] == [0.1] * 4 + [0.0] * 2


def test_round_trips_of_the_last_five_seconds_count_and_four_at_least() -> None:
    link, given_to = Load(), list[Any]()
    link.vehicle.round_trips.shortest_s = lambda *given: given_to.append(given) or 0.1
    link.seconds(9, 0.1)
    assert given_to[-1] == (after(Instant(0), 4.0), 4)


@settings(deadline=None, max_examples=25, derandomize=True)
@given(up=st.floats(0.0, 0.9), down=st.floats(0.0, 0.9))
def test_losses_up_and_down_are_reported_apart(up: float, down: float) -> None:
    """An answer comes only if neither is lost; of 300 bytes a second sent those that weren't lost were carried."""
    link = Load()
    load = link.seconds(12, 0.1, up=up, down=down)
    assert load.lost_down == pytest.approx(down, abs=0.001)
    assert load.lost_up == pytest.approx(up, abs=0.02)
    assert load.lost == max(load.lost_up, load.lost_down)
    assert load.bytes_per_s == pytest.approx(700.0 + 300.0 * (1.0 - load.lost_up))


def test_where_everything_is_lost_down_nothing_is_known_of_the_way_up() -> None:
    load = Load().seconds(8, 0.1, down=1.0)
    assert (load.lost_down, load.lost_up) == (1.0, 0.0)


@pytest.mark.parametrize("trip_s", [0.3, 1.0, 2.5])
def test_requests_of_the_last_round_trip_are_under_way_and_not_lost(trip_s: float) -> None:
    """Of a steady rate, so that the count between two looks is in proportion."""
    link = Load()
    link.seconds(10, trip_s)
    link.sequence.answers -= round(1000 * trip_s)
    link.load._looks.clear()
    assert link.seconds(5, trip_s).lost_up == pytest.approx(0.0)
    assert link.load._due(link.now) == pytest.approx(15_000 - 1000 * trip_s)


def test_messages_that_were_never_asked_and_never_came_are_no_loss() -> None:
    link = Load()
    link.load.look(after(link.now, 1.0), None)
    assert (link.load.lost_up, link.load.lost_down, link.load.bytes_per_s) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("step_s", "full"), [(0.039, False), (0.043, True)])
def test_a_queue_that_grows_by_two_tenths_in_five_seconds_is_full_without_a_loss(step_s: float, full: bool) -> None:
    link = Load()
    link.seconds(10, 0.1)
    link.seconds(1, 0.4)
    for number in range(1, 8):
        link.second(0.4 + step_s * number)
    assert link.load.full is full


def test_a_queue_that_grows_by_no_more_than_two_tenths_is_a_longer_link() -> None:
    link = Load()
    link.seconds(10, 0.0)
    for trip_s in (0.25, 0.29, 0.33, 0.37, 0.41, 0.45):
        link.second(trip_s)
    assert not link.load.full


def test_a_queue_that_is_as_long_once_does_not_grow() -> None:
    link = Load()
    link.seconds(10, 0.1)
    for number in (1, 2, 3, 3, 4, 5, 6):
        assert not link.second(0.4 + 0.1 * number).full


@pytest.mark.parametrize(("free", "full"), [(21.0, False), (20.0, True), (19.0, True)])
def test_a_radio_with_a_fifth_of_its_buffer_free_twice_in_a_row_is_full(free: float, full: bool) -> None:
    link = Load()
    assert not link.second(0.1, free=free).full
    assert not link.second(0.1, free=80.0).full
    assert not link.second(0.1, free=free).full
    assert link.second(0.1, free=free).full is full
    assert link.load.free_percent == free
    assert link.load.words == (
        f"messages wait for 0.0 s, 0% are lost up and 0% down, {free:.0f} % of the radio's buffer are free"
    )


def test_another_link_begins_with_nothing_known() -> None:
    link = Load()
    link.seconds(8, 0.1)
    assert link.seconds(8, 0.5, up=0.3, free=10.0).full
    link.vehicle.sequence = link.sequence = SimpleNamespace(received=0, lost=0, asked=0, answers=0)
    link.second(0.9, free=10.0)
    assert (link.load.queue_s, link.load.lost, link.load.full) == (0.0, 0.0, False)


def test_without_enough_round_trips_the_queue_stays_as_it_was() -> None:
    link = Load()
    link.seconds(3, 0.1)
    link.second(0.4)
    assert link.second(math.nan).queue_s == pytest.approx(0.3)
    assert link.second(0.2).queue_s == pytest.approx(0.1)


def test_a_fall_of_the_count_of_lost_frames_is_no_negative_loss() -> None:
    """A late frame cancels the loss that its gap was counted as."""
    link = Load()
    link.seconds(3, 0.1)
    link.sequence.lost = -50
    assert link.second(0.1).lost_down == 0.0


class Links:
    """Two vehicles whose links are watched together."""

    def __init__(self) -> None:
        self.each = [Vehicle(VehicleId(1, n), n - 1, ArduPlane(n, ORIGIN, 0.25), Connection(0), 10.0) for n in (1, 2)]
        vehicles, self.logged = {each.identity: each for each in self.each}, EventLog()
        self.now, self.free = Instant(0), 80.0
        reports: Any = SimpleNamespace(of=lambda *_: SimpleNamespace(txbuf_percent=self.free))
        self.budget = LinkBudget(vehicles, self.logged, reports, HeartbeatScheduler(vehicles, self.logged), {})

    def seconds(self, count: int, used: tuple[float, ...] = (), **given: Any) -> list[Any]:
        sent = list[Any]()
        for _ in range(count):
            self.now = after(self.now, 1.0)
            for each in self.each:
                each.connection.record_frame(self.now, heartbeat=True)
            sent += self.budget.due_requests(self.now, used, **given)
        return sent


def test_links_that_are_full_at_once_are_one_event() -> None:
    links = Links()
    links.free = 10.0
    links.seconds(2)
    ((_, kind, text, number, details),) = links.logged
    assert (kind, number, details) == ("link_load", None, {"vehicles": "1, 2", "level": 1})
    assert text.startswith("the link of vehicles 1, 2 is full (messages wait for 0.0 s")
    assert text.endswith(f"): {LEVELS[1].words}")


@pytest.mark.parametrize(
    ("used", "held"),
    [
        ((0.3, 0.49), (False, False)),
        ((0.3, 0.5), (False, False)),
        ((0.3, 0.51), (False, True)),
        ((0.51, 0.3), (True, False)),
        ((math.nan, 0.51), (True, True)),
        ((math.nan, 0.49), (False, False)),
        ((0.51,), (True, True)),
        ((), (False, False)),
    ],
)
def test_near_half_of_its_margin_every_change_is_sent(used: tuple[float, ...], held: tuple[bool, bool]) -> None:
    """One without a loop is followed by others, so that it is as near as any of them."""
    links = Links()
    links.seconds(1, used)
    found = tuple(each.setpoints.tolerance for each in links.each)
    assert found == tuple(EVERYTHING if near else 1.0 for near in held)


def test_over_a_full_link_changes_are_held_back_whatever_the_margin() -> None:
    links = Links()
    links.free = 10.0
    links.seconds(3, (0.9, 0.9))
    assert [each.setpoints.tolerance for each in links.each] == [1.0, 1.0]


def test_in_flight_what_is_of_use_at_full_rates_comes_while_the_link_loses_or_a_margin_is_near() -> None:
    """Rates of the start-up come back for `LOSSY_S` after it."""
    links = Links()
    vehicle = links.each[1]
    before = dict(vehicle.rates_hz)
    vehicle.start_up = SimpleNamespace(finished=True, asked_for_telemetry=True, left=False)  # type: ignore[assignment]
    asked = links.seconds(2, (0.1, 0.1))
    flight = dict(vehicle.rates_hz)
    changed = [each for each, rate_hz in flight.items() if rate_hz != before[each]]
    assert changed
    assert len([1 for each, _ in asked if each is vehicle]) == len(changed)
    links.seconds(1, (0.1, 0.9))
    assert vehicle.rates_hz == vehicle.start_up_hz != flight
    links.seconds(math.floor(LOSSY_S) - 1, (0.1, 0.1))
    assert vehicle.rates_hz == vehicle.start_up_hz
    links.seconds(2, (0.1, 0.1))
    assert vehicle.rates_hz == flight
    vehicle.frames_lost_at = links.now
    links.seconds(1, (0.1, 0.1))
    assert vehicle.rates_hz == vehicle.start_up_hz


def test_before_telemetry_was_asked_for_no_rate_is() -> None:
    links = Links()
    links.free = 10.0
    assert links.seconds(20) == []
    assert links.each[0].rates_hz[33] < 10.0


def test_the_time_until_rates_are_tried_again_doubles_whenever_that_fails_up_to_sixteen_minutes() -> None:
    """What the level above needs is more than the link carried, so that time alone raises the rates."""
    link, waits_s = Link(), list[float]()
    link.seconds(8, AT_ONCE)
    link.full_seconds(6 + SETTLES_S + 2, 0.3)
    for _ in range(2):
        assert link.level == 2
        begun = link.now
        while link.level == 2:
            link.seconds(1, AT_ONCE)
        waits_s.append((link.now - begun) * 1e-9)
        link.full_seconds(8, 0.3)
    assert waits_s == pytest.approx([120.0, 240.0], abs=8.0)
    budget = link.budget._each[0]
    for before_s, after_s in ((480.0, 960.0), (960.0, 960.0)):
        link.seconds(30, AT_ONCE)
        budget._try_again_s, budget._full_at = before_s, after(link.now, -2000.0)
        link.seconds(1, AT_ONCE)
        assert link.level == 1
        link.full_seconds(8, 0.3)
        assert (link.level, budget._try_again_s) == (2, after_s)


def test_with_room_rates_go_up_one_level_after_each_twenty_seconds() -> None:
    link, ups_s = Link(), list[float]()
    link.seconds(8, AT_ONCE)
    link.full_seconds(6 + SETTLES_S + 2, 0.3)
    link.budget._each[0]._carried = math.inf
    while link.level:
        before = link.level
        link.seconds(1, AT_ONCE)
        ups_s += [link.now * 1e-9] if link.level < before else []
    assert ups_s[1] - ups_s[0] == 20.0 == CALM_S
    assert ups_s[0] - 22.0 == pytest.approx(CALM_S, abs=6.0)


def test_the_feature_is_this_stage_of_the_vehicles_of_the_cycle() -> None:
    links = Links()
    cycle: Any = SimpleNamespace(
        as_written=load_scenario(scenario(vehicles={"count": 2})),
        vehicles={each.identity: each for each in links.each},
        log_event=links.logged,
        radio_reports=RadioReports(()),
        heartbeats=links.budget._heartbeats,
    )
    (stage,) = FEATURE.stages(cycle)
    assert isinstance(stage, Budget)
    assert [(each.vehicle, each.level) for each in stage._budget._each] == [(each, 0) for each in links.each]


def test_the_stage_sends_what_the_budget_asks_for_by_what_was_found() -> None:
    given, sent = list[Any](), list[Any]()

    def due_requests(*args: Any, **keys: Any) -> list[str]:
        given.append((args, keys))
        return ["request"]

    findings = SimpleNamespace(margin_used=[0.1], others_listen=True)
    cycle: Any = SimpleNamespace(now=Instant(5), findings=findings, send=lambda *args: sent.append(args))
    budget: Any = SimpleNamespace(due_requests=due_requests)
    Budget(budget).run(cycle)
    assert given == [((Instant(5), [0.1]), {"leaves_unread": True})]
    assert sent == [(["request"], Instant(5))]

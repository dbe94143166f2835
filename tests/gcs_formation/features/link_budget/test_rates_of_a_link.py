"""When a link's rates go down, up again, or are given back, and what a vehicle is asked for then."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from gcs_formation.budget.levels import LEVELS
from gcs_formation.budget.traffic import bytes_per_s, flight_hz
from gcs_formation.features.link_budget.link_budget import CALM_S, SETTLES_S, TRY_AGAIN_S
from gcs_formation.vehicle.setpoint_delivery import LOSSY_S
from gcs_formation.vehicle.vehicle import Vehicle
from tests.gcs_formation.features.link_budget.test_limits_of_a_full_link import Links
from tests.gcs_formation.features.link_budget.test_link_load import AT_ONCE, WAITS, Link

POSITION = m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
RAW_IMU = 27


def lowered() -> Link:
    """Return a link at level 2."""
    link = Link()
    link.seconds(8, AT_ONCE)
    link.full_seconds(6 + SETTLES_S + 2, 0.3)
    assert link.level == 2
    return link


def needed(link: Link, level: int) -> float:
    """Return what a level needs, bytes a second."""
    autopilot = link.vehicle.autopilot
    return bytes_per_s(autopilot, flight_hz(autopilot, LEVELS[level], link.budget._each[0]._all_hz), LEVELS[level])


def flies(vehicle: Vehicle, *, finished: bool = True, asked: bool = True) -> None:
    vehicle.start_up = SimpleNamespace(finished=finished, asked_for_telemetry=asked, left=False)  # type: ignore[assignment]


@pytest.mark.parametrize("busy", [0.5, 1.0, 1.4])
@pytest.mark.parametrize(("share", "level"), [(0.74, 1), (0.76, 2)])
def test_rates_go_up_where_they_need_less_than_three_quarters_of_what_was_carried(
    busy: float, share: float, level: int
) -> None:
    """As much more as the present ones take than they need, in turns and climbs; no less if they take less."""
    link = lowered()
    link.budget._each[0]._carried = needed(link, 1) * max(busy, 1.0) / share
    for _ in range(30):
        link.vehicle.bytes_in += round(busy * needed(link, 2)) - 1000
        link.second(AT_ONCE)
    assert link.level == level


def test_a_link_that_was_full_of_what_is_not_needed_has_room_without_it_after_twenty_seconds() -> None:
    """It carried 3000 bytes a second, also for a while after rates had gone down: what waited came first."""
    link, levels = Link(), list[int]()
    link.seconds(8, AT_ONCE)
    for _ in range(8):
        link.vehicle.bytes_in += 2000
        link.second(WAITS, 0.3)
    assert link.level == 1
    assert needed(link, 0) < 0.75 * 3000
    for _ in range(40):
        link.second(AT_ONCE)
        levels.append(link.level)
    assert levels.count(1) == pytest.approx(CALM_S, abs=6.0)
    assert levels[-1] == 0


def test_what_a_link_loses_of_fewer_bytes_tells_whether_it_is_full_or_bad() -> None:
    """Of half as much as at level 1, a full one loses less; a loss nearer to that of before isn't by the bytes."""
    for towards, level in ((0.45, 3), (0.55, 0)):
        link = Link()
        link.seconds(8, AT_ONCE)
        for _ in range(30):
            if link.level == 2:
                break
            link.second(WAITS, 0.5)
        if_full = 1.0 - (1.0 - 0.5) * needed(link, 1) / needed(link, 2)
        assert 0.15 < if_full < 0.5 - 0.1
        link.seconds(SETTLES_S + 1, WAITS, if_full + towards * (0.5 - if_full))
        assert link.level == level


def test_a_link_is_tried_for_more_than_twelve_seconds_at_the_lowest_rates() -> None:
    link, levels = Link(), list[int]()
    link.seconds(8, AT_ONCE)
    for _ in range(60):
        link.full_seconds(1, 0.03)
        levels.append(link.level)
    assert levels.count(len(LEVELS) - 1) == 13


def test_a_bad_link_is_taken_as_it_is_from_then_on() -> None:
    """Its round trips are those of an empty link, also when rates might go down again."""
    link = Link()
    link.seconds(8, AT_ONCE)
    link.seconds(6 + 2 * SETTLES_S, WAITS, 0.3)
    assert (link.level, len(link.logged)) == (0, 3)
    link.seconds(TRY_AGAIN_S + 20, WAITS, 0.3)
    assert not link.vehicle.limits.full
    assert (link.level, len(link.logged)) == (0, 3)
    link.seconds(10, 2 * WAITS, 0.3)
    assert link.level > 0


def test_each_level_is_one_event_while_a_radio_says_that_it_is_full() -> None:
    links = Links()
    links.free = 10.0
    links.seconds(1 + 1 + 5 * 6)
    assert [each.details["level"] for each in links.logged] == [1, 2, 3, 4, 5]
    assert [each.at_s for each in links.logged] == pytest.approx([2.0, 8.0, 14.0, 20.0, 26.0])


def test_nothing_is_spared_while_there_is_room() -> None:
    links = Links()
    links.seconds(3)
    assert [(each.commands.spares, each.setpoints.spares) for each in links.each] == [(False, False)] * 2
    links.free = 10.0
    links.seconds(2)
    assert [(each.commands.spares, each.setpoints.spares) for each in links.each] == [(True, True)] * 2


def test_a_link_that_is_silent_or_left_to_a_pilot_keeps_its_rates() -> None:
    links = Links()
    second = links.each[1]
    links.seconds(1)
    links.free = 10.0
    second.leave_to_pilot(links.now)
    links.seconds(3)
    assert [each.level for each in links.budget._each] == [1, 0]
    silent = Links()
    silent.free = 10.0
    for number in range(1, 4):
        silent.each[0].connection.record_frame(after(Instant(0), float(number)), heartbeat=True)
        assert silent.budget.due_requests(after(Instant(0), float(number))) == []
    assert [each.level for each in silent.budget._each] == [1, 0]


def intervals_of(links: Links, seconds: int, message_id: int, **given: Any) -> list[int]:
    """Return the intervals in µs for which the first vehicle is asked, of a message; it comes 4 times a second."""
    vehicle, found = links.each[0], list[int]()
    for _ in range(seconds):
        vehicle.unknown_in[RAW_IMU] = vehicle.unknown_in.get(RAW_IMU, 0) + 4
        sent = [request for each, request in links.seconds(1, **given) if each is vehicle]
        found += [round(each.param2) for each in sent if round(each.param1) == message_id]
    return found


@pytest.mark.parametrize(
    ("full", "leaves_unread", "intervals"),
    [(False, False, [10_000_000]), (False, True, []), (True, False, [-1]), (True, True, [-1])],
)
def test_for_another_station_what_is_not_read_goes_on_until_the_link_is_full(
    full: bool, leaves_unread: bool, intervals: list[int]
) -> None:
    links = Links()
    flies(links.each[0])
    links.free = 10.0 if full else 80.0
    links.seconds(2)
    links.free = 80.0
    assert intervals_of(links, 8, RAW_IMU, leaves_unread=leaves_unread)[:1] == intervals


@pytest.mark.parametrize(
    ("finished", "asked", "full", "asks"),
    [(False, True, False, False), (False, True, True, True), (False, False, True, False), (True, True, False, True)],
)
def test_before_a_vehicle_is_ready_streams_are_stopped_over_a_full_link_only(
    finished: bool, asked: bool, full: bool, asks: bool
) -> None:
    """They are of use then, as its own station's; once telemetry has been asked for."""
    links = Links()
    flies(links.each[0], finished=finished, asked=asked)
    links.free = 10.0 if full else 80.0
    links.seconds(2)
    links.free = 80.0
    assert bool(intervals_of(links, 8, RAW_IMU)) == asks


def test_at_another_level_what_comes_too_often_is_asked_for_anew() -> None:
    """After 6 s, 11 s, 21 s and 41 s it would be at 81 s only."""
    links = Links()
    flies(links.each[0])
    assert len(intervals_of(links, 45, RAW_IMU)) == 4
    links.free = 10.0
    assert intervals_of(links, 8, RAW_IMU)[:1] == [-1]


def test_one_that_restarted_before_it_was_ready_has_its_telemetry_lowered_over_a_full_link() -> None:
    links = Links()
    links.seconds(1)
    links.each[0].restart(Instant(0))
    flies(links.each[0], finished=False)
    links.free = 10.0
    assert intervals_of(links, 3, POSITION) == [200_000]


def test_one_that_restarted_in_flight_is_asked_for_its_rates_again_and_others_see_no_change_before() -> None:
    """What comes is counted by the rates for as long as these are the same object."""
    links = Links()
    vehicle = links.each[0]
    flies(vehicle)
    asked = len([each for each, _ in links.seconds(2) if each is vehicle])
    flight = vehicle.rates_hz
    links.seconds(5)
    assert vehicle.rates_hz is flight
    vehicle.rates_hz = vehicle.start_up_hz
    assert len([each for each, _ in links.seconds(1) if each is vehicle]) == asked > 0
    assert vehicle.rates_hz == flight


@pytest.mark.parametrize(("silent_s", "full_rates"), [(0.4, True), (0.6, False)])
def test_of_one_that_is_not_received_now_no_more_is_asked_for(silent_s: float, full_rates: bool) -> None:
    """Near its margin at full rates; what a silence loses is counted by those that it had."""
    links = Links()
    vehicle = links.each[0]
    flies(vehicle)
    links.seconds(round(LOSSY_S) + 2, (0.1, 0.1))
    links.budget.due_requests(after(links.now, silent_s), (0.9, 0.1))
    assert (vehicle.rates_hz == vehicle.start_up_hz) == full_rates

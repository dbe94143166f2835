"""One vehicle lands after another: when the next one may, and when landing is given up."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.messages.command import CommandAck
from gcs_formation.features.ending.landings import Landings
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.test_landing import NOW, commanded, hovering, plane, tell

LANDS = m.PLANE_MODE_AUTOLAND


def queue(*vehicles: Vehicle, why: str | None = None) -> Landings:
    """Return landings of vehicles that were commanded to circle 15 m above one another, from 100 m."""
    landings = Landings(lambda _: why)
    for level, vehicle in enumerate(vehicles):
        landings.await_turn(vehicle, 100.0 + 15.0 * level)
    return landings


def down(vehicle: Vehicle, *, rolls_mps: float = 0.0) -> None:
    tell(vehicle, 0.0, 0.0, 0.0, armed=False, rolls_mps=rolls_mps)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_they_land_from_the_lowest_up_in_whatever_order_they_came(order: tuple[int, ...]) -> None:
    each = [plane(number, 0.0, 0.0, 85.0 + 15.0 * number) for number in (1, 2, 3)]
    asked, landed = list[list[int]](), list[int]()

    def why(following: Sequence[VehicleId]) -> None:
        asked.append([identity.system for identity in following])

    landings = Landings(why)
    for index in order:
        landings.await_turn(each[index], 100.0 + 15.0 * index)
    while landings.under_way:
        assert [landings.is_pending(one) for one in each] == [one.identity.system not in landed for one in each]
        landings.advance(NOW)
        (lands,) = [one for one in each if commanded(one) == LANDS]
        lands.commands.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_ACCEPTED), NOW)
        landed.append(lands.identity.system)
        down(lands)
        landings.advance(NOW)
    assert landed == [1, 2, 3]
    assert asked == [[1, 2, 3], [2, 3], [3]]
    assert landings.failure is None


@pytest.mark.parametrize(
    ("north_m", "off_m", "lands"),
    [(0, 4.9, True), (0, -4.9, True), (0, 5.1, False), (0, -5.1, False), (399, 0, True), (401, 0, False)],
)
def test_all_must_circle_over_their_homes_within_a_third_of_a_level(north_m: float, off_m: float, lands: bool) -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 100.0, 50.0)
    tell(high, 100.0 + north_m, 50.0, 115.0 + off_m)
    queue(low, high).advance(NOW)
    assert commanded(low) == (LANDS if lands else None)


@pytest.mark.parametrize(
    ("east_m", "noise_mps", "lands"), [(1.9, 0.0, True), (2.1, 0.0, False), (0.0, 0.95, True), (0.0, 1.05, False)]
)
def test_one_that_hovers_lands_from_within_2_m_and_below_1_mps(east_m: float, noise_mps: float, lands: bool) -> None:
    vehicle = hovering(1, 12.0, 100.0, noise_mps)
    tell(vehicle, 0.5, 12.0 + east_m, 100.0, flies_mps=noise_mps, course_rad=1.0)
    queue(vehicle).advance(NOW)
    assert commanded(vehicle) == (m.COPTER_MODE_LAND if lands else None)


@pytest.mark.parametrize("lacks", ["a position", "a home", "an answer"])
def test_one_that_is_not_known_to_circle_where_it_should_is_waited_for(lacks: str) -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    if lacks == "a position":
        high.telemetry.invalidate()
    elif lacks == "a home":
        high.take_off.stood = None
    else:
        high.commands.send(high.autopilot.hold(), NOW)
    landings = queue(low, high)
    landings.advance(NOW)
    assert commanded(low) is None
    assert landings.under_way


def test_none_lands_while_another_climbs_out() -> None:
    vehicle = plane(1, 0.0, 0.0)
    landings = queue(vehicle)
    landings.advance(NOW, climbs_out=True)
    assert commanded(vehicle) is None
    landings.advance(NOW)
    assert commanded(vehicle) == LANDS


@pytest.mark.parametrize(("rolls_mps", "next_lands"), [(1.4, True), (1.5, False)])
def test_the_next_one_lands_when_the_one_before_rolls_slower_than_1_5_mps(rolls_mps: float, next_lands: bool) -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    landings = queue(low, high)
    landings.advance(NOW)
    down(low, rolls_mps=rolls_mps)
    for _ in range(2):
        landings.advance(NOW)
    assert commanded(high) == (LANDS if next_lands else None)


def test_one_that_is_down_and_tells_no_speed_counts_as_standing() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    landings = queue(low, high)
    landings.advance(NOW)
    down(low, rolls_mps=9.0)
    low.telemetry.motion = None
    for _ in range(2):
        landings.advance(NOW)
    assert commanded(high) == LANDS


@pytest.mark.parametrize(("waited_s", "given_up"), [(900.0, False), (900.1, True)])
def test_15_minutes_are_waited_for_all_to_circle_from_when_the_first_has_come(waited_s: float, given_up: bool) -> None:
    low, high, begun = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 200.0), after(NOW, 500.0)
    landings = queue(low, high)
    landings.advance(begun)
    landings.advance(after(begun, waited_s))
    said = "not every vehicle circled over home at the height it was commanded within 900 s"
    assert landings.failure == (said if given_up else None)
    assert landings.under_way is not given_up
    assert commanded(low) is None


def test_where_none_waits_to_land_time_gives_up_nothing() -> None:
    landings = queue()
    for waited_s in (0.0, 901.0, 5000.0):
        landings.advance(after(NOW, waited_s))
    assert landings.failure is None


@pytest.mark.parametrize(("waited_s", "given_up"), [(900.0, False), (900.1, True)])
def test_each_has_15_minutes_to_land_from_when_it_was_reported_to(waited_s: float, given_up: bool) -> None:
    """The second is reported 700 s after the first."""
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    landings, reported = queue(low, high), after(NOW, 700.0)
    landings.advance(NOW)
    down(low)
    landings.advance(after(NOW, 699.0))
    landings.advance(reported)
    assert high.commands.under_way is not None
    landings.advance(after(reported, waited_s))
    assert landings.failure == ("vehicle 2 has not landed within 900 s" if given_up else None)
    assert landings.is_pending(high) is not given_up


def test_what_was_waited_for_one_landing_does_not_count_for_the_next() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 200.0)
    landings = queue(low)
    landings.advance(NOW)
    landings.await_turn(high, 115.0)
    down(low)
    stopped = after(NOW, 800.0)
    landings.advance(stopped)
    landings.advance(after(stopped, 900.0))
    assert landings.failure is None
    landings.advance(after(stopped, 901.0))
    assert landings.failure is not None


@pytest.mark.parametrize(("waited_s", "given_up"), [(5.0, False), (5.1, True)])
def test_a_refusal_is_final_after_5_s_and_the_command_is_withdrawn(waited_s: float, given_up: bool) -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    landings = queue(low, high)
    landings.advance(NOW)
    assert commanded(low) == LANDS
    low.commands.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_DENIED), NOW)
    landings.advance(after(NOW, waited_s))
    assert landings.failure == ("vehicle 1 refused to land (DENIED)" if given_up else None)
    assert (low.commands.under_way is None) is given_up
    assert landings.under_way is not given_up


def test_one_that_accepts_after_it_rejected_is_left_to_land() -> None:
    vehicle = plane(1, 0.0, 0.0)
    landings = queue(vehicle)
    landings.advance(NOW)
    for at_s, result in ((0.0, m.MAV_RESULT_TEMPORARILY_REJECTED), (2.0, m.MAV_RESULT_ACCEPTED)):
        vehicle.commands.due(after(NOW, at_s))
        vehicle.commands.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, result), after(NOW, at_s))
    landings.advance(after(NOW, 60.0))
    assert landings.failure is None
    assert landings.is_pending(vehicle)


def test_where_the_next_landing_is_not_possible_none_begins_and_why_is_said() -> None:
    vehicle = plane(1, 0.0, 0.0)
    landings = queue(vehicle, plane(2, 0.0, 50.0, 115.0), why="the runway is closed")
    landings.advance(NOW)
    assert (landings.failure, landings.under_way, commanded(vehicle)) == ("the runway is closed", False, None)


def test_the_first_reason_against_landing_stays() -> None:
    landings = queue(plane(1, 0.0, 0.0))
    landings.refuse("one")
    landings.refuse("other")
    assert (landings.failure, landings.under_way) == ("one", False)


def test_one_that_is_commanded_otherwise_is_neither_landing_nor_waiting_any_more() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    landings = queue(low, high)
    landings.advance(NOW)
    landings.drop(high)
    assert (landings.is_pending(low), landings.is_pending(high)) == (True, False)
    landings.drop(low)
    assert not landings.under_way


def test_landings_that_are_called_off_are_kept_only_where_one_has_begun() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    landings = queue(low, high)
    assert landings.call_off() is None
    assert not landings.under_way
    landings = queue(low, high)
    landings.advance(Instant(0))
    assert landings.call_off() is landings
    assert (landings.is_pending(low), landings.is_pending(high)) == (True, False)

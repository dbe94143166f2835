"""Telemetry that somebody else switches off or slows down in flight is requested again."""

from __future__ import annotations

from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import NANOSECONDS
from airlink.endpoint import VehicleId
from airlink.messages import Message
from airlink.messages.command import RequestDataStream
from gcs_formation.phases import Phase
from sim_vehicles.families.arduplane.plane import HANDLERS
from tests.flights.in_memory import World
from tests.flights.other_station import interval, tell

MOTION = (m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, m.MAVLINK_MSG_ID_ATTITUDE, m.MAVLINK_MSG_ID_VFR_HUD)
NAMES = {"GLOBAL_POSITION_INT", "ATTITUDE", "VFR_HUD"}
NONE, UNASKED = -1.0, 0.0
"""Intervals of MAV_CMD_SET_MESSAGE_INTERVAL: message off; default rate."""


def slowed(number: int) -> list[Message]:
    """Return what Mission Planner and MAVProxy send when they connect."""
    return [RequestDataStream(number, 1, m.MAV_DATA_STREAM_ALL, 4, 1)]


def stopped(number: int) -> list[Message]:
    return [interval(number, each, NONE) for each in MOTION]


def unasked(number: int) -> list[Message]:
    return [interval(number, each, UNASKED) for each in MOTION]


def rates_hz(world: World, number: int) -> list[float]:
    return [1e6 / world.vehicle(number).streams.interval_us(each) for each in MOTION]


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (2, stopped),
        *(pytest.param(*each, marks=pytest.mark.slow) for each in ((1, stopped), (2, unasked), (2, slowed))),
    ],
)
def test_a_vehicle_that_another_ground_station_has_commanded_to_send_less_is_asked_again(
    number: int, said: Any
) -> None:
    world = World(duration_s=16 if said is slowed else 10)
    world.fly_to(2.0)
    reported_s = tell(world, number, said(number))
    world.run(6.0)
    assert rates_hz(world, number) == [10.0, 5.0, 10.0]  # of attitudes half as many
    world.run()
    asked_s, *_ = world.times_s("streams", number, "asked again")
    assert asked_s - reported_s < 2.5
    again_s = world.times_s("streams", number, "again")[-1]
    assert again_s - asked_s < (10.0 if said is slowed else 4.0)  # seen after 2 s of 10 Hz, 8 s of 2 Hz, and the delay
    assert world.times_s("streams") == world.times_s("streams", number)
    assert not world.times_s("leader")
    assert not world.times_s("member", text="loiter")
    assert world.worst_m(2.0) < 0.3
    assert world.station.flight.phase is Phase.DONE


@pytest.mark.slow
def test_heartbeats_that_were_switched_off_are_asked_for_before_any_is_commanded_to_loiter() -> None:
    """At 3.5 s, after three missing heartbeats; the next one comes at once."""
    world = World(duration_s=9)
    world.fly_to(2.0)
    tell(world, 2, [interval(2, m.MAVLINK_MSG_ID_HEARTBEAT, NONE)])
    last_s = world.station.vehicles[VehicleId(1, 2)].connection.heartbeats.last / NANOSECONDS
    world.run()
    (mute_s,) = world.times_s("link", 2, "without heartbeats")
    assert mute_s - last_s == pytest.approx(3.5, abs=0.15)
    assert world.words("streams")[0].startswith("sends HEARTBEAT less than half as often")
    assert world.times_s("streams", 2)[0] - mute_s < 0.6
    assert world.times_s("link", 2, "connected")[-1] - mute_s < 1.8
    assert not world.times_s("member", text="loiter")


@pytest.mark.parametrize("number", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_vehicle_that_refuses_to_send_heartbeats_is_commanded_to_loiter_and_comes_back_with_them(
    number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its mode is unknown then; if it leads, another takes over. Its telemetry goes on all the time."""
    world = World(duration_s=40)
    world.fly_to(2.0)
    stopped_s = tell(world, number, [interval(number, m.MAVLINK_MSG_ID_HEARTBEAT, NONE)])
    world.run(0.5)
    with monkeypatch.context() as patch:
        patch.setitem(HANDLERS, m.MAV_CMD_SET_MESSAGE_INTERVAL, lambda *_: m.MAV_RESULT_DENIED)
        world.run(9.5)
        (reported_s,) = world.times_s("member", number, "told to loiter")
        assert 4.0 <= reported_s - stopped_s <= 5.2
        assert world.vehicle(number).pilot.mode.name == "LOITER"
        assert not world.times_s("member", 3, "loiter")
        assert bool(world.times_s("leader")) == (number == 1)
    again_s = tell(world, number, [interval(number, m.MAVLINK_MSG_ID_HEARTBEAT, UNASKED)])
    world.run(3.0)
    assert world.times_s("member", number, "flying")[-1] - again_s < 2.0


@pytest.mark.slow
def test_heartbeats_lost_on_the_way_are_not_missing() -> None:
    world = World(duration_s=60, links={"default": {"loss": 0.5}})
    world.run(60.0)
    assert not world.times_s("link", text="without heartbeats")


@pytest.mark.slow
def test_any_that_keeps_switching_telemetry_off_is_answered_ever_more_rarely_and_the_vehicle_loiters() -> None:
    """It's asked after 2.5, 5, 10 s; after 5 s without telemetry it is told to loiter, as after any silence."""
    world = World(duration_s=40)
    world.fly_to(2.0)
    requests: set[float] = set()
    for _ in range(75):
        tell(world, 2, stopped(2))
        world.run(0.2)
        requests.add(world.stage("message_intervals").intervals._streams[1][1].next_request)
    assert len(requests) == 4  # the first was sent before
    assert len(world.times_s("streams", 2)) == 1
    assert world.times_s("member", 2, "told to loiter")
    assert not world.times_s("member", 3, "told to loiter")


@pytest.mark.slow
def test_a_refusal_is_reported_once(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(duration_s=13)
    world.fly_to(2.0)
    tell(world, 2, slowed(2))
    world.run(0.5)
    monkeypatch.setitem(HANDLERS, m.MAV_CMD_SET_MESSAGE_INTERVAL, lambda *_: m.MAV_RESULT_DENIED)
    world.run()
    first, second = world.words("streams")
    assert first.endswith("it is asked again")
    assert second.startswith("refuses to send")
    assert not world.times_s("member", text="loiter")


def without(message_id: int, monkeypatch: pytest.MonkeyPatch) -> tuple[World, float]:
    """Return a flight in which vehicle 2 stops to send a message and refuses to send it again, and when it stopped."""
    world = World(duration_s=11)
    world.fly_to(2.0)
    stopped_s = tell(world, 2, [interval(2, message_id, NONE)])
    world.run(0.5)
    monkeypatch.setitem(HANDLERS, m.MAV_CMD_SET_MESSAGE_INTERVAL, lambda *_: m.MAV_RESULT_DENIED)
    world.run(8.0)
    return world, stopped_s


def test_without_a_position_a_vehicle_is_commanded_to_loiter(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing older than 5 s is predicted from."""
    world, stopped_s = without(m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, monkeypatch)
    (reported_s,) = world.times_s("member", 2, "told to loiter")
    assert reported_s - stopped_s == pytest.approx(5.0, abs=0.3)
    assert not world.times_s("member", 3, "loiter")


@pytest.mark.slow
@pytest.mark.parametrize("message_id", MOTION[1:])
def test_without_attitude_or_airspeed_a_vehicle_flies_on_by_the_others(
    message_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The heading of VFR_HUD, or the airspeed by velocity and wind."""
    world, stopped_s = without(message_id, monkeypatch)
    assert world.times_s("health", 2)[0] - stopped_s < 3.0
    assert not world.times_s("member", 2, "told to loiter")
    assert world.worst_m(5.0) < 0.5

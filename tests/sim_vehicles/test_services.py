"""Requests of ground stations besides flying: restarts, logs, echoes, capabilities."""

from __future__ import annotations

import pytest

from airlink import mavlink as m
from airlink.clock import after
from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.messages.system import Timesync
from airlink.stream_parser import StreamParser
from tests.sim_vehicles.conftest import GROUND, mavlink
from tests.sim_vehicles.test_copter import MODEL
from tests.sim_vehicles.test_px4 import COPTER, PLANE

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
REBOOT, ARM = m.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, m.MAV_CMD_COMPONENT_ARM_DISARM


@pytest.mark.parametrize(("model", "refused"), [(None, FAILED), (MODEL, FAILED), (COPTER, DENIED)])
def test_a_vehicle_restarts_when_commanded_unless_it_is_armed(make_air, model, refused):
    air = make_air(in_air=False, endpoint="udpin:127.0.0.1:14551", **({} if model is None else {"model": model}))
    air.ground.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    air.run(5.0)
    if model is MODEL:
        air.set_mode(4)
    assert air.command_long(ARM, 1) == ACCEPTED
    assert air.command_long(REBOOT, 1) == refused
    assert air.command_long(ARM, 0) == ACCEPTED
    assert air.command_long(REBOOT, 1) == ACCEPTED
    assert air.command_long(ARM, 1) is not ACCEPTED  # it boots
    air.ground.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    air.run(4.0)
    assert air.fleet.vehicles[0].time_s == pytest.approx(4.0, abs=0.1)


def test_what_is_no_restart_fails(parked):
    assert parked.command_long(REBOOT, 0) == FAILED


def test_there_are_no_logs(flying):
    flying.ground.send(mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    flying.run(0.1)
    (entry,) = flying.ground.of("LOG_ENTRY")
    assert entry.num_logs == 0


def test_a_px4_echoes_a_ping_to_all_alone(make_air):
    air = make_air(model=COPTER)
    air.run(3.5)
    for target in (0, 1):
        air.ground.send(mavlink.MAVLink_ping_message(123, 7 + target, target, 0))
    air.run(0.1)
    (echo,) = air.ground.of("PING")
    assert (echo.time_usec, echo.seq, echo.target_system, echo.target_component) == (123, 7, 255, 190)


@pytest.mark.parametrize(("model", "capabilities"), [(MODEL, 64495), (COPTER, 59647)])
def test_a_multirotor_says_that_it_takes_setpoints(make_air, model, capabilities):
    air = make_air(model=model)
    air.run(3.5)
    air.command_long(m.MAV_CMD_REQUEST_MESSAGE, m.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    assert air.ground.of("AUTOPILOT_VERSION")[0].capabilities == capabilities
    assert capabilities & m.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED


def test_a_px4_has_no_mission_and_takes_none(make_air):
    """A mission written to it would lose its first item, in whose place ArduPilot has home, and never be flown."""
    air = make_air(model=COPTER)
    air.run(3.5)
    for message in (
        mavlink.MAVLink_mission_request_list_message(1, 1, 0),
        mavlink.MAVLink_mission_count_message(1, 1, 2),
    ):
        air.ground.send(message)
    air.ground.send(mavlink.MAVLink_mission_set_current_message(1, 1, 1))
    air.run(0.1)
    assert [each.count for each in air.ground.of("MISSION_COUNT")] == [0]
    assert [each.type for each in air.ground.of("MISSION_ACK")] == [m.MAV_MISSION_UNSUPPORTED]


@pytest.mark.parametrize(("model", "waits"), [(None, True), (MODEL, False), (COPTER, False), (PLANE, False)])
def test_time_is_reported_as_it_is_asked_for_but_by_a_plane_of_ardupilots(make_air, model, waits):
    """A PX4's receiver is a separate thread, an ArduCopter's loop takes 2.5 ms, an ArduPlane's 20 ms."""
    air = make_air(**({"model": model} if model else {}))
    air.run(3.5)
    air.ground.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    air.run(0.1)
    fleet, between = air.fleet, after(air.fleet.next_timer(), -0.007)
    fleet.datagrams_to_send()
    fleet.receive([Datagram(0, GROUND, FrameWriter(255, 190).encode(Timesync(0, 7)))], between)
    messages = [StreamParser().feed(datagram.data)[0].message for datagram in fleet.datagrams_to_send()]
    stamps = [each.tc1_ns for each in messages if isinstance(each, Timesync)]
    assert stamps == ([] if waits else [between // 1000 * 1000])


@pytest.mark.parametrize(("target", "answers"), [(0, 1), (1, 1), (2, 0)])
def test_time_is_reported_to_whom_asked_by_whom_was_asked(make_air, target, answers):
    """So that on a shared line the others keep still, and routers know where the answer goes."""
    air = make_air()
    air.run(1.0)
    air.sent.clear()
    air.ground.send_bytes(FrameWriter(255, 190).encode(Timesync(0, 7, target, target)))
    air.run(0.1)
    messages = [frame.message for _, sent in air.sent for frame in StreamParser().feed(sent.data)]
    found = [each for each in messages if isinstance(each, Timesync) and each.ts1_ns == 7]
    assert [(each.target_system, each.target_component) for each in found] == [(255, 190)] * answers

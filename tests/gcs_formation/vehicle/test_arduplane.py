"""Commands to an ArduPlane, and the meaning of its messages, as measured on ArduPlane 4.7."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from airlink import mavlink as m
from airlink.frame import FrameWriter
from airlink.messages import Message
from airlink.messages.command import CommandInt
from airlink.messages.telemetry import SysStatus
from airlink.stream_parser import StreamParser
from flight_model.flight_state import FlightState, Setpoint
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from tests.gcs_formation.vehicle.conftest import ORIGIN, heartbeat, position

PLANE, HERE = ArduPlane(7, ORIGIN, 0.25), FlightState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def on_the_wire(command: Message) -> CommandInt:
    """Return the command as the autopilot reads it: its numbers are 32-bit floats."""
    (frame,) = StreamParser().feed(FrameWriter(255, 190).encode(command))
    assert isinstance(frame.message, CommandInt)
    return frame.message


@given(st.floats(-1e4, 1e4))
@example(-1e-12)
@example(2 * math.pi)
@example(-2 * math.pi)
@example(math.radians(359.9999999))
def test_headings_reach_the_autopilot_within_0_to_below_360_degrees(heading_rad):
    heading = on_the_wire(PLANE.setpoint(Setpoint(22.0, heading_rad, 100.0), HERE)[2])
    assert 0.0 <= heading.param2 < 360.0
    off = math.remainder(math.radians(heading.param2) - heading_rad, math.tau)
    assert off == pytest.approx(0.0, abs=1e-6)


def test_a_setpoint_is_airspeed_altitude_above_sea_level_and_heading(plane):
    speed, altitude, heading = map(on_the_wire, plane.setpoint(Setpoint(23.5, math.pi / 2, 100.0), HERE))
    assert (speed.command, speed.param1, speed.param2, speed.param3) == (43000, 0.0, 23.5, 0.0)
    assert (altitude.command, altitude.frame, altitude.z, altitude.param3) == (43001, m.MAV_FRAME_GLOBAL, 120.0, 0.0)
    assert (heading.command, heading.param1, heading.param2) == (43002, m.HEADING_TYPE_HEADING, 90.0)
    assert heading.param3 == pytest.approx(23.5 * 0.25)
    assert {each.target_system for each in (speed, altitude, heading)} == {7}


def test_loiter_is_the_mode_then_the_height_which_a_change_of_mode_forgets(plane, telemetry):
    mode, altitude = plane.loiter(130.0, telemetry)
    assert (mode.command, mode.param1, mode.param2) == (m.MAV_CMD_DO_SET_MODE, 1, m.PLANE_MODE_LOITER)
    assert (altitude.command, altitude.param1) == (m.MAV_CMD_DO_CHANGE_ALTITUDE, 150.0)
    assert altitude.param2 == m.MAV_FRAME_GLOBAL


def test_on_the_ground_it_isnt_airborne_in_the_air_it_is(plane, telemetry, tell):
    tell(m.PLANE_MODE_TAKEOFF, armed=True, above_home_m=0.0)
    assert not plane.is_airborne(telemetry)
    tell(m.PLANE_MODE_TAKEOFF, armed=True, above_home_m=1.0, status=m.MAV_STATE_ACTIVE)
    assert plane.is_airborne(telemetry)
    tell(m.PLANE_MODE_RTL, armed=True, above_home_m=100.0, status=m.MAV_STATE_CRITICAL)
    assert plane.is_airborne(telemetry)


def test_its_home_is_flown_to_only_once_its_height_is_accepted(plane, telemetry):
    """RTL_ALTITUDE is the same for all; a height commanded after the mode replaces it."""
    before, mode, after = plane.go_home(130.0, telemetry)
    assert (mode.command, mode.param2) == (m.MAV_CMD_DO_SET_MODE, m.PLANE_MODE_RTL)
    assert before == after
    assert (after.command, after.param1) == (m.MAV_CMD_DO_CHANGE_ALTITUDE, 150.0)


@pytest.mark.parametrize("status", [m.MAV_STATE_CRITICAL, m.MAV_STATE_EMERGENCY])
@pytest.mark.parametrize(("before", "flies"), [(m.MAV_STATE_ACTIVE, True), (m.MAV_STATE_STANDBY, False)])
def test_what_says_that_it_is_in_an_emergency_flies_below_10_m_if_it_flew_before(
    plane, telemetry, tell, status, before, flies
):
    for told in (before, status):
        tell(m.PLANE_MODE_GUIDED, armed=True, above_home_m=9.0, status=told)
    assert plane.is_airborne(telemetry) == flies
    assert plane.is_grounded(telemetry) != flies


def test_without_a_position_it_flies_if_it_says_so_and_isnt_known_to_stand_if_it_says_that(plane, telemetry):
    for status, flies in ((m.MAV_STATE_ACTIVE, True), (m.MAV_STATE_STANDBY, False)):
        telemetry.store(heartbeat(m.PLANE_MODE_GUIDED, armed=True, status=status))
        assert plane.is_airborne(telemetry) == flies
        assert not plane.is_grounded(telemetry)
    telemetry.store(heartbeat(m.PLANE_MODE_GUIDED, armed=False, status=m.MAV_STATE_STANDBY))
    assert plane.is_grounded(telemetry)
    telemetry.store(heartbeat(m.PLANE_MODE_INITIALIZING, armed=False, status=m.MAV_STATE_CALIBRATING))
    assert not plane.is_grounded(telemetry)


def test_a_take_off_is_a_climb_out_until_45_m(plane, telemetry, tell):
    tell(m.PLANE_MODE_TAKEOFF, armed=True, above_home_m=20.0, status=m.MAV_STATE_ACTIVE)
    assert plane.climbs_out(telemetry)
    tell(m.PLANE_MODE_TAKEOFF, armed=True, above_home_m=46.0, status=m.MAV_STATE_ACTIVE)
    assert not plane.climbs_out(telemetry)
    tell(m.PLANE_MODE_GUIDED, armed=True, above_home_m=20.0, status=m.MAV_STATE_ACTIVE)
    assert not plane.climbs_out(telemetry)


def test_setpoints_are_taken_in_guided_and_in_the_air_only(plane, telemetry, tell):
    tell(m.PLANE_MODE_GUIDED, armed=True, above_home_m=0.0)
    assert not plane.takes_setpoints(telemetry)
    tell(m.PLANE_MODE_GUIDED, armed=True, above_home_m=50.0, status=m.MAV_STATE_ACTIVE)
    assert plane.takes_setpoints(telemetry)
    tell(m.PLANE_MODE_RTL, armed=True, above_home_m=50.0, status=m.MAV_STATE_ACTIVE)
    assert not plane.takes_setpoints(telemetry)


def test_ready_to_arm_needs_the_estimator_and_the_autopilots_own_checks(plane, telemetry, tell):
    ready = next(step for step in plane.start_up(plane.rates_hz(10.0)) if "ready" in step.name)
    tell(m.PLANE_MODE_MANUAL)
    assert ready.done(telemetry)
    telemetry.store(SysStatus(0, 0, 0))
    assert not ready.done(telemetry)
    telemetry.store(SysStatus(0, 0, m.MAV_SYS_STATUS_PREARM_CHECK))
    telemetry.ekf_flags = 830
    assert not ready.done(telemetry)


def test_utc_is_asked_for_once_a_second_where_it_is_needed_only(plane):
    """Each further request makes a vehicle ready a little later."""
    utc = m.MAVLINK_MSG_ID_SYSTEM_TIME
    for rates_hz, wanted in ((plane.rates_hz(10.0), []), (plane.rates_hz(10.0, utc=True), [1e6])):
        requests = plane.requests(rates_hz)
        assert [each.param2 for each in requests if each.param1 == utc] == wanted
        assert rates_hz.get(utc) == (1.0 if wanted else None)


def test_a_vehicle_is_kept_down_by_disarming_without_force(plane):
    (command,) = plane.stand_down()
    assert (command.command, command.param1, command.param2) == (m.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, 0.0)


def test_an_unknown_mode_is_named_by_its_number(plane, telemetry, tell):
    assert plane.mode_name(telemetry) == "unknown"
    tell(m.PLANE_MODE_GUIDED)
    assert plane.mode_name(telemetry) == "GUIDED"
    tell(99)
    assert plane.mode_name(telemetry) == "mode 99"
    telemetry.store(position(0.0))

"""Commands to an ArduCopter, and the meaning of its messages, as measured on ArduCopter 4.7."""

from __future__ import annotations

import math

import pytest

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.frame import FrameWriter
from airlink.messages.command import CommandInt, CommandLong, ParamValue, SetPositionTargetLocalNed
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import HomePosition
from airlink.stream_parser import StreamParser
from flight_model.flight_state import FlightState, Setpoint
from gcs_formation.vehicle.checks import ParameterReader
from gcs_formation.vehicle.families.arducopter.arducopter import ArduCopter
from gcs_formation.vehicle.own_fence import FENCE_NAMES
from gcs_formation.vehicle.velocity_setpoint import HEIGHT_S, ground_motion
from tests.gcs_formation.vehicle.conftest import ORIGIN, heartbeat, planned

COPTER, HERE = ArduCopter(7, ORIGIN, 0.4), FlightState(0.0, 0.0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0)
VELOCITY_AND_YAW, VELOCITY_ALONE = 0b100111000111, 0b010111000111


def sent(setpoint: Setpoint, where: FlightState = HERE) -> SetPositionTargetLocalNed:
    (message,) = COPTER.setpoint(setpoint, where)
    (frame,) = StreamParser().feed(FrameWriter(255, 190).encode(message))
    assert isinstance(frame.message, SetPositionTargetLocalNed)
    return frame.message


def test_a_setpoint_is_a_velocity_over_ground_and_the_nose_turns_to_it():
    told = sent(Setpoint(5.0, math.pi / 2, 30.0))
    assert (told.target_system, told.coordinate_frame, told.type_mask) == (7, m.MAV_FRAME_LOCAL_NED, VELOCITY_AND_YAW)
    assert (told.vx_mps, told.vy_mps, told.vz_mps) == pytest.approx((0.0, 5.0, 0.0), abs=1e-6)
    assert told.yaw_rad == pytest.approx(math.pi / 2)


def test_setpoints_do_not_depend_on_wind():
    windy = FlightState(0.0, 0.0, 30.0, 0.0, 0.0, 0.0, 8.0, -3.0)
    assert sent(Setpoint(5.0, 1.0, 30.0), windy) == sent(Setpoint(5.0, 1.0, 30.0))


@pytest.mark.parametrize("speed_mps", [0.001, 0.5])
def test_at_low_speed_the_nose_keeps_its_heading(speed_mps):
    told = sent(Setpoint(speed_mps, 2.0, 30.0))
    assert (told.type_mask, told.yaw_rate_radps) == (VELOCITY_ALONE, 0.0)
    assert math.hypot(told.vx_mps, told.vy_mps) == pytest.approx(speed_mps)


def test_a_leader_that_is_to_stand_turns_its_nose_where_it_is_commanded_to():
    told = sent(Setpoint(0.0, 2.0, 30.0))
    assert (told.type_mask, told.yaw_rad, told.vx_mps, told.vy_mps) == (VELOCITY_AND_YAW, 2.0, 0.0, 0.0)


def test_an_error_of_height_is_flown_off_by_the_vertical_velocity():
    assert sent(Setpoint(0.0, 0.0, 33.0)).vz_mps == pytest.approx(-3.0 / HEIGHT_S)
    assert sent(Setpoint(0.0, 0.0, 28.5)).vz_mps == pytest.approx(1.5 / HEIGHT_S)


def test_it_takes_off_in_guided_armed_first(tell, telemetry):
    tell(m.COPTER_MODE_STABILIZE)
    steps = COPTER.start_up({})
    acts = [command for step in steps for command in step.commands(telemetry)]
    assert [each.command for each in acts] == [
        m.MAV_CMD_DO_SET_MODE,
        m.MAV_CMD_COMPONENT_ARM_DISARM,
        m.MAV_CMD_NAV_TAKEOFF,
    ]
    assert acts[0].param2 == m.COPTER_MODE_GUIDED
    assert isinstance(acts[2], CommandLong)
    assert acts[2].param7 == 20.0
    assert [step.name for step in steps if step.takes_off] == ["armed", "commanded it to take off"]


def test_in_the_air_nothing_is_left_to_do_but_guided(tell, telemetry):
    tell(m.COPTER_MODE_LOITER, armed=True, above_home_m=30.0, status=m.MAV_STATE_ACTIVE)
    assert [step.name for step in COPTER.start_up({})[1:] if not step.done(telemetry)] == ["set mode GUIDED"]


@pytest.mark.parametrize(
    ("kind", "autopilot", "spoken"),
    [
        (m.MAV_TYPE_QUADROTOR, m.MAV_AUTOPILOT_ARDUPILOTMEGA, True),
        (m.MAV_TYPE_HEXAROTOR, m.MAV_AUTOPILOT_ARDUPILOTMEGA, True),
        (m.MAV_TYPE_OCTOROTOR, m.MAV_AUTOPILOT_ARDUPILOTMEGA, True),
        (m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA, False),
        (m.MAV_TYPE_GROUND_ROVER, m.MAV_AUTOPILOT_ARDUPILOTMEGA, False),
        (m.MAV_TYPE_QUADROTOR, m.MAV_AUTOPILOT_PX4, False),
    ],
)
def test_it_is_known_by_its_heartbeat(kind, autopilot, spoken):
    assert COPTER.speaks(Heartbeat(kind, autopilot)) == spoken


def test_it_ends_in_brake_for_in_loiter_a_missing_transmitter_sinks_it(telemetry):
    (stop,) = COPTER.loiter(80.0, telemetry)
    (home,) = COPTER.leave("rtl", 80.0, telemetry)
    assert (stop.param2, home.param2) == (m.COPTER_MODE_BRAKE, m.COPTER_MODE_RTL)


def test_it_waits_over_its_home_at_its_own_height_and_comes_down_there(telemetry):
    """RTL would climb to one height for all, and land at once."""
    (unknown,) = COPTER.leave("land", 80.0, telemetry)
    assert isinstance(unknown, CommandLong)
    assert unknown.param2 == m.COPTER_MODE_RTL
    lat_rad, lon_rad, alt_m = ORIGIN.from_ned(30.0, -20.0, 0.0)
    telemetry.store(HomePosition(lat_rad, lon_rad, alt_m, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0)))
    (home,) = COPTER.leave("land", 80.0, telemetry)
    assert isinstance(home, CommandInt)
    north_m, east_m, down_m = ORIGIN.to_ned(math.radians(home.x * 1e-7), math.radians(home.y * 1e-7), home.z)
    assert (home.command, home.frame, home.param2) == (m.MAV_CMD_DO_REPOSITION, m.MAV_FRAME_GLOBAL_INT, 1)
    assert (north_m, east_m, down_m) == pytest.approx((30.0, -20.0, -80.0), abs=0.01)
    assert [each.param2 for each in COPTER.land()] == [m.COPTER_MODE_LAND]


def test_it_takes_setpoints_in_guided_alone(tell, telemetry):
    for mode, takes in ((m.COPTER_MODE_GUIDED, True), (m.COPTER_MODE_BRAKE, False)):
        tell(mode, armed=True, above_home_m=30.0, status=m.MAV_STATE_ACTIVE)
        assert COPTER.takes_setpoints(telemetry) == takes
    telemetry.store(heartbeat(m.COPTER_MODE_GUIDED, armed=False))
    assert not COPTER.takes_setpoints(telemetry)


def test_its_motion_is_that_over_ground_and_its_nose_counts_where_it_stands():
    assert ground_motion(1.0, 3.0, -4.0, leads=False)[0] == 5.0
    assert ground_motion(0.0, 0.0, 5.0, leads=False)[1] == pytest.approx(math.pi / 2, abs=0.07)
    assert ground_motion(1.0, 0.0, 0.0, leads=False) == pytest.approx((0.0, 1.0))
    backwards_mps, axis_rad = ground_motion(1.0, -1.5 * math.cos(1.0), -1.5 * math.sin(1.0), leads=True)
    assert (backwards_mps, axis_rad) == pytest.approx((-1.5, 1.0))


IN_ORDER = {
    "MAV_GCS_SYSID": 255,
    "FS_GCS_ENABLE": 1,
    "FS_GCS_TIMEOUT": 5,
    "WPNAV_SPEED": 1000,
    "WPNAV_ACCEL": 250,
    "RTL_ALT": 1500,
    "WPNAV_SPEED_UP": 300,
    "WPNAV_SPEED_DN": 300,
    **dict.fromkeys(FENCE_NAMES, 0),
}


IN_ORDER_SINCE_4_7 = {
    "MAV_GCS_SYSID": 255,
    "FS_GCS_ENABLE": 1,
    "FS_GCS_TIMEOUT": 5,
    "WP_SPD": 9,
    "WP_ACC": 2.5,
    "RTL_ALT_M": 15,
    "WP_SPD_UP": 3,
    "WP_SPD_DN": 3,
    **dict.fromkeys(FENCE_NAMES, 0),
}


@pytest.mark.parametrize(
    ("name", "value", "refuses", "allowed"),
    [
        ("WP_SPD", 8, False, "9 m/s or more"),
        ("WP_SPD", 4, True, "9 m/s or more"),
        ("WP_ACC", 1, False, "2.5 m/s² or more"),
        ("RTL_ALT_M", 35, False, "30 m at most"),
    ],
)
def test_names_and_units_since_4_7(name, value, refuses, allowed):
    """ArduPilot, "Parameter Name Changes": WPNAV_SPEED, WPNAV_ACCEL and RTL_ALT became metres under other names."""
    checks = COPTER.checks(
        *planned(5.0, 30.0, speed_min_mps=0.0, speed_max_mps=9.0, turn_rate_max_rps=0.4, accel_max_mps2=2.5)
    )
    reader = ParameterReader(1, checks)
    for each, found in (IN_ORDER_SINCE_4_7 | {name: value}).items():
        reader.receive_parameter(ParamValue(each, found, m.MAV_PARAM_TYPE_REAL32, 1, 0), Instant(0))
    assert reader.complete
    (finding,) = reader.findings()
    assert finding.text.startswith(f"{name}: found {value}; allowed: {allowed}")
    assert finding.refuses == refuses


@pytest.mark.parametrize(
    ("name", "value", "refuses"),
    [
        ("MAV_GCS_SYSID", 254, True),
        ("FS_GCS_ENABLE", 0, False),
        ("FS_GCS_TIMEOUT", 2, False),
        ("WPNAV_SPEED", 800, False),
        ("WPNAV_SPEED", 400, True),
        ("WPNAV_ACCEL", 100, False),
        ("RTL_ALT", 3500, False),
    ],
)
def test_a_parameter_that_bounds_what_is_asked_is_named(name, value, refuses):
    checks = COPTER.checks(
        *planned(5.0, 30.0, speed_min_mps=0.0, speed_max_mps=9.0, turn_rate_max_rps=0.4, accel_max_mps2=2.5)
    )
    assert [found for check in checks if (found := check.finding(IN_ORDER))] == []
    (finding,) = [found for check in checks if (found := check.finding(IN_ORDER | {name: value}))]
    assert finding.text.startswith(f"{name}: found {value}")
    assert finding.refuses == refuses

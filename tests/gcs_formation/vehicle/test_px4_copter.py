"""Commands to a PX4 multirotor, and the meaning of its messages, as in its simulator (1.17, development)."""

from __future__ import annotations

import math

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.frame import FrameWriter
from airlink.messages.command import CommandAck, SetPositionTargetLocalNed
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude, ExtendedSysState, SysStatus, VfrHud
from airlink.stream_parser import StreamParser
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario import load_scenario
from gcs_formation.from_scenario import autopilot_for
from gcs_formation.vehicle.command_delivery import CommandQueue, Outcome
from gcs_formation.vehicle.families.px4.copter import Px4Copter
from gcs_formation.vehicle.families.px4.px4 import LAND
from gcs_formation.vehicle.own_fence import GEOFENCE_NAMES
from gcs_formation.vehicle.startup import StartUp
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.velocity_setpoint import VelocityLead
from tests.gcs_formation.vehicle.conftest import ORIGIN, planned, position

HOLD, TAKEOFF, RTL, OFFBOARD = 0x03040000, 0x02040000, 0x05040000, 0x00060000
COPTER, HERE = Px4Copter(7, ORIGIN, 0.4), FlightState(0.0, 0.0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0)
VELOCITY_AND_YAW, VELOCITY_ALONE = 0x9C7, 0x5C7
NOW = Instant(0)
PATH = {"speed_mps": 5, "waypoints_m": [[0, 0, 30], [200, 0, 30]]}


def beat(mode: int, *, armed: bool = False, kind: int = m.MAV_TYPE_QUADROTOR) -> Heartbeat:
    base = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (m.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    return Heartbeat(kind, m.MAV_AUTOPILOT_PX4, base, mode, m.MAV_STATE_ACTIVE if armed else m.MAV_STATE_STANDBY)


def tell(telemetry: Telemetry, mode: int, *, armed: bool = False, up_m: float = 0.0) -> Telemetry:
    landed = m.MAV_LANDED_STATE_IN_AIR if up_m > 0.0 else m.MAV_LANDED_STATE_ON_GROUND
    for message in (
        beat(mode, armed=armed),
        position(up_m, 60.0),
        Attitude(60.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0),
        VfrHud(0.0, 0.0, 0.5, 50, up_m, 0.0),
        SysStatus(0, 0, m.MAV_SYS_STATUS_PREARM_CHECK),
        ExtendedSysState(0, landed),
    ):
        telemetry.store(message)
    return telemetry


def sent(setpoint: Setpoint) -> SetPositionTargetLocalNed:
    (message,) = COPTER.setpoint(setpoint, HERE)
    (frame,) = StreamParser().feed(FrameWriter(255, 190).encode(message))
    assert isinstance(frame.message, SetPositionTargetLocalNed)
    return frame.message


@pytest.mark.parametrize(
    ("landed_state", "airborne"),
    [
        (m.MAV_LANDED_STATE_ON_GROUND, False),
        (m.MAV_LANDED_STATE_TAKEOFF, True),
        (m.MAV_LANDED_STATE_IN_AIR, True),
        (m.MAV_LANDED_STATE_LANDING, True),
    ],
)
def test_one_that_takes_off_or_lands_is_airborne_below_10_m(landed_state, airborne):
    seen = tell(Telemetry(ORIGIN, COPTER.hovers), COPTER.home_mode, armed=True, up_m=5.0)
    seen.store(ExtendedSysState(0, landed_state))
    assert COPTER.is_airborne(seen) == airborne


def test_a_model_that_hovers_makes_a_px4_a_multirotor():
    keys = {"vehicles": {"count": 1, "autopilot": "px4", "model": "px4_copter"}, "path": PATH}
    scenario = load_scenario(keys)
    (planned,) = scenario.vehicles
    assert isinstance(autopilot_for(planned, scenario), Px4Copter)
    emulated = planned.model_copy(update={"autopilot": "emulator"})
    assert isinstance(autopilot_for(emulated, scenario), Px4Copter)


def test_it_is_known_by_its_heartbeat():
    for kind in (m.MAV_TYPE_QUADROTOR, m.MAV_TYPE_HEXAROTOR, m.MAV_TYPE_OCTOROTOR):
        assert COPTER.speaks(beat(HOLD, kind=kind))
    for kind in (m.MAV_TYPE_FIXED_WING, m.MAV_TYPE_VTOL_TILTROTOR, m.MAV_TYPE_GENERIC):
        assert not COPTER.speaks(beat(HOLD, kind=kind))
    assert not COPTER.speaks(Heartbeat(m.MAV_TYPE_QUADROTOR, m.MAV_AUTOPILOT_ARDUPILOTMEGA))


def test_a_setpoint_is_a_velocity_over_ground_in_the_local_frame_and_the_nose_turns_to_it():
    told = sent(Setpoint(5.0, math.pi / 2, 31.5))
    assert (told.target_system, told.coordinate_frame, told.type_mask) == (7, m.MAV_FRAME_LOCAL_NED, VELOCITY_AND_YAW)
    assert (told.vx_mps, told.vy_mps, told.vz_mps) == pytest.approx((0.0, 5.0, -1.0), abs=1e-6)
    assert told.yaw_rad == pytest.approx(math.pi / 2)


def test_hardly_moving_its_nose_is_held_where_it_was_commanded_to_be_last_and_a_leader_that_stands_turns():
    """With a yaw rate of 0 alone it drifts, and a leader's nose is the formation's direction."""
    copter = Px4Copter(7, ORIGIN, 0.4)
    for speed_mps, heading_rad, yaw_rad in ((5.0, 0.7, 0.7), (0.3, 2.0, 0.7), (0.0, 1.2, 1.2), (0.3, 2.0, 1.2)):
        (told,) = copter.setpoint(Setpoint(speed_mps, heading_rad, 30.0), HERE)
        assert isinstance(told, SetPositionTargetLocalNed)
        assert (told.type_mask, told.yaw_rad) == (VELOCITY_AND_YAW, yaw_rad)


def test_none_is_commanded_to_climb_or_sink_faster_than_its_model_can():
    copter = Px4Copter(7, ORIGIN, 0.4, VelocityLead(climb_max_mps=3.0))
    for up_m, sink_mps in ((12.0, -3.0), (-12.0, 3.0), (3.0, -2.0)):
        (told,) = copter.setpoint(Setpoint(0.0, 0.0, HERE.height_m + up_m), HERE)
        assert isinstance(told, SetPositionTargetLocalNed)
        assert told.vz_mps == sink_mps


def test_before_and_between_setpoints_it_is_commanded_to_stand():
    """PX4 accepts OFFBOARD only while it receives such messages."""
    (told,) = Px4Copter(7, ORIGIN, 0.4).stand_in()
    assert isinstance(told, SetPositionTargetLocalNed)
    assert told.type_mask == VELOCITY_ALONE
    assert (told.vx_mps, told.vy_mps, told.vz_mps, told.yaw_rate_radps) == (0.0, 0.0, 0.0, 0.0)


def test_offboard_is_acknowledged_before_it_is_decided_on_and_is_reported_until_it_is_shown(telemetry):
    queue = CommandQueue()
    queue.send((COPTER.set_mode(OFFBOARD),), NOW)
    for number in range(3):
        now = after(NOW, 0.7 * number)
        assert queue.due(now) is not None
        queue.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_ACCEPTED), now, early=True)
        queue.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_TEMPORARILY_REJECTED), now, early=True)
        assert queue.outcome is Outcome.WAITING
    now = after(NOW, 2.1)
    assert queue.due(now) is not None
    queue.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_ACCEPTED), now)
    assert queue.outcome is Outcome.ACCEPTED


def test_steps_from_the_ground_to_offboard(telemetry):
    start_up, commands = StartUp(COPTER.start_up(COPTER.rates_hz(10.0))), CommandQueue()

    def go() -> list[tuple[int, float, float]]:
        done: list[tuple[int, float, float]] = []
        for _ in range(20):
            start_up.advance(telemetry, commands, NOW)
            command = commands.due(NOW)
            if command is not None:
                done.append((command.command, command.param1, command.param2))
                commands.acknowledge(CommandAck(command.command, m.MAV_RESULT_ACCEPTED), NOW)
        return done

    asked = {which for _, which, _ in go()}
    assert asked == {30.0, 33.0, 74.0, 1.0, 245.0, 436.0}
    assert not start_up.acted
    tell(telemetry, HOLD)
    assert [command for command, _, _ in go()] == [m.MAV_CMD_NAV_TAKEOFF]
    assert start_up.acted
    tell(telemetry, TAKEOFF)
    assert [each[:2] for each in go()] == [(m.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)]
    tell(telemetry, TAKEOFF, armed=True, up_m=5.0)
    assert go() == []
    tell(telemetry, HOLD, armed=True, up_m=20.0)
    assert go() == [(m.MAV_CMD_DO_SET_MODE, 1.0, 6.0)]
    assert not start_up.finished
    tell(telemetry, OFFBOARD, armed=True, up_m=20.0)
    go()
    assert start_up.finished


def test_it_measures_no_airspeed_and_says_so(telemetry):
    """VFR_HUD's airspeed is NaN."""
    silent = VfrHud(math.nan, 3.0, 0.5, 50, 20.0, 0.0)
    telemetry.store(silent)
    assert (telemetry.implausible, math.isnan(telemetry.airspeed_mps)) == (1, True)
    copters = Telemetry(ORIGIN, COPTER.hovers)
    copters.store(silent)
    assert (copters.implausible, copters.airspeed_mps) == (0, 3.0)


def test_it_takes_setpoints_in_offboard_alone_and_in_the_air(telemetry):
    assert COPTER.takes_setpoints(tell(telemetry, OFFBOARD, armed=True, up_m=20.0))
    assert not COPTER.takes_setpoints(tell(telemetry, HOLD, armed=True, up_m=20.0))
    assert not COPTER.takes_setpoints(tell(telemetry, OFFBOARD, armed=True))


def test_it_ends_in_hold_or_goes_home_at_its_height(telemetry):
    assert [COPTER.mode_asked(each) for each in COPTER.loiter(80.0, telemetry)] == [HOLD]
    assert [COPTER.mode_asked(each) for each in COPTER.leave("rtl", 80.0, telemetry)] == [RTL]
    assert [COPTER.mode_asked(each) for each in COPTER.land()] == [LAND]


IN_ORDER = {
    "NAV_DLL_ACT": 2,
    "COM_OF_LOSS_T": 1.0,
    "COM_OBL_RC_ACT": 0,
    "MPC_XY_VEL_MAX": 12,
    "RTL_RETURN_ALT": 30,
    "MPC_Z_VEL_MAX_UP": 3.0,
    "MPC_Z_VEL_MAX_DN": 3.0,
    **dict.fromkeys(GEOFENCE_NAMES, 0),
}


@pytest.mark.parametrize(
    ("name", "value", "refuses"),
    [
        ("NAV_DLL_ACT", 0, False),
        ("COM_OF_LOSS_T", 0.2, False),
        ("COM_OBL_RC_ACT", 1, False),
        ("COM_OBL_RC_ACT", 7, True),
        ("MPC_XY_VEL_MAX", 8, False),
        ("MPC_XY_VEL_MAX", 4, True),
        ("RTL_RETURN_ALT", 31, False),
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

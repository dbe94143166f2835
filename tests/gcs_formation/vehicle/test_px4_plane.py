"""Commands to a fixed-wing PX4, and the meaning of its messages, as in its simulator (1.17, development)."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.frame import FrameWriter
from airlink.messages.command import CommandAck, CommandInt, CommandLong, ParamValue
from airlink.messages.system import Heartbeat, Statustext
from airlink.messages.telemetry import Attitude, ExtendedSysState, HomePosition, SysStatus, VfrHud
from airlink.stream_parser import StreamParser
from flight_model.flight_state import FlightState, Setpoint
from gcs_formation.vehicle.checks import ParameterReader, only_read
from gcs_formation.vehicle.command_delivery import CommandQueue, EffectWatch, Outcome
from gcs_formation.vehicle.families.px4.plane import Px4Plane
from gcs_formation.vehicle.own_fence import GEOFENCE_NAMES
from gcs_formation.vehicle.startup import StartUp
from gcs_formation.vehicle.startup_step import Command
from gcs_formation.vehicle.stored_mission import LandingSequence
from gcs_formation.vehicle.telemetry import Telemetry
from tests.gcs_formation.vehicle.conftest import ORIGIN, planned, position

HOLD, TAKEOFF, RTL = 0x03040000, 0x02040000, 0x05040000
PLANE, HERE = Px4Plane(7, ORIGIN, 0.25), FlightState(300.0, -200.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NOW = Instant(0)


def on_the_wire(command: Command) -> CommandInt | CommandLong:
    (frame,) = StreamParser().feed(FrameWriter(255, 190).encode(command))
    assert isinstance(frame.message, CommandInt | CommandLong)
    return frame.message


def beat(mode: int, *, armed: bool = False, kind: int = m.MAV_TYPE_FIXED_WING) -> Heartbeat:
    """Return PX4's heartbeat: ACTIVE as soon as it is armed."""
    base = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (m.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    return Heartbeat(kind, m.MAV_AUTOPILOT_PX4, base, mode, m.MAV_STATE_ACTIVE if armed else m.MAV_STATE_STANDBY)


@pytest.fixture
def px4(telemetry: Telemetry) -> Callable[..., Telemetry]:
    """Return a function that feeds mode and height, and everything else that telemetry and readiness need."""

    def told(
        mode: int, *, armed: bool = False, up_m: float = 0.0, in_air: bool = False, at_s: float = 60.0
    ) -> Telemetry:
        landed = m.MAV_LANDED_STATE_IN_AIR if in_air else m.MAV_LANDED_STATE_ON_GROUND
        for message in (
            beat(mode, armed=armed),
            position(up_m, at_s),
            Attitude(at_s, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0),
            VfrHud(14.0, 14.0, 0.5, 50, up_m, 0.0),
            SysStatus(0, 0, m.MAV_SYS_STATUS_PREARM_CHECK),
            ExtendedSysState(0, landed),
        ):
            telemetry.store(message)
        return telemetry

    return told


def test_it_is_a_family_of_its_own_and_nothing_else_of_px4():
    assert PLANE.speaks(beat(HOLD))
    for kind in (m.MAV_TYPE_QUADROTOR, m.MAV_TYPE_VTOL_TILTROTOR, m.MAV_TYPE_GENERIC):
        assert not PLANE.speaks(beat(HOLD, kind=kind))
    assert not PLANE.speaks(Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA))


def test_a_setpoint_is_one_command_with_airspeed_altitude_above_sea_level_and_a_place_ahead():
    (told,) = map(on_the_wire, PLANE.setpoint(Setpoint(14.5, math.pi / 2, 100.0), HERE))
    assert isinstance(told, CommandInt)
    assert (told.command, told.frame, told.target_system, told.target_component) == (192, 5, 7, 1)
    assert (told.param1, told.param2, told.z) == (14.5, 1.0, 120.0)
    assert math.isnan(told.param4)
    north_m, east_m, _ = ORIGIN.to_ned(math.radians(told.x / 1e7), math.radians(told.y / 1e7), told.z)
    assert (north_m, east_m) == (pytest.approx(300.0, abs=0.01), pytest.approx(200.0, abs=0.01))


@given(st.floats(-math.pi, math.pi), st.floats(10.0, 25.0), st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))
def test_the_place_lies_where_air_and_wind_carry_it_and_never_near(heading_rad, speed_mps, north_mps, east_mps):
    """By the wind triangle: across the course over ground the airspeed cancels the wind."""
    (told,) = PLANE.setpoint(
        Setpoint(speed_mps, heading_rad, 100.0), FlightState(300.0, -200.0, 0.0, 0.0, 0.0, 0.0, north_mps, east_mps)
    )
    assert isinstance(told, CommandInt)
    north_m, east_m, _ = ORIGIN.to_ned(math.radians(told.x / 1e7), math.radians(told.y / 1e7), told.z)
    ahead_m = north_m - HERE.north_m, east_m - HERE.east_m
    assert math.hypot(*ahead_m) > 200.0
    across = -ahead_m[1], ahead_m[0]
    air_mps = speed_mps * math.cos(heading_rad), speed_mps * math.sin(heading_rad)
    drift_mps = (across[0] * (air_mps[0] + north_mps) + across[1] * (air_mps[1] + east_mps)) / math.hypot(*ahead_m)
    assert drift_mps == pytest.approx(0.0, abs=1e-3)


def test_a_mode_is_reported_as_main_and_sub_mode_and_confirmed_by_the_heartbeat_alone(telemetry):
    """DO_SET_MODE is acknowledged twice, the first time always with 0."""
    told = on_the_wire(PLANE.set_mode(RTL))
    assert isinstance(told, CommandLong)
    assert (told.command, told.param1, told.param2, told.param3) == (176, 1.0, 4.0, 5.0)
    assert PLANE.mode_asked(told) == RTL
    queue, effects, effect = CommandQueue(), EffectWatch(), PLANE.effect(told)
    queue.send((PLANE.set_mode(RTL), *PLANE.stand_down()), NOW)
    assert queue.due(NOW) is not None
    assert queue.acknowledge(CommandAck(176, m.MAV_RESULT_ACCEPTED), NOW) is not None
    assert queue.acknowledge(CommandAck(176, m.MAV_RESULT_DENIED), NOW) is None
    assert queue.outcome is Outcome.WAITING
    assert effect is not None
    telemetry.store(beat(HOLD, armed=True))
    effects.acknowledged(effect, telemetry, NOW)
    for _ in range(3):
        telemetry.store(beat(HOLD, armed=True))
    effects.update(telemetry, after(NOW, 3.5))
    assert effects.missing == "mode RTL"


def test_armed_on_the_ground_it_is_active_and_not_airborne(px4):
    assert not PLANE.is_airborne(px4(TAKEOFF, armed=True))
    assert PLANE.is_airborne(px4(TAKEOFF, armed=True, up_m=2.0, in_air=True))
    assert PLANE.is_airborne(px4(HOLD, armed=True, up_m=-20.0, in_air=True))
    assert not PLANE.is_airborne(px4(HOLD, armed=False, up_m=50.0))


def test_it_stands_on_the_ground_only_where_it_says_so_and_where_that_is(px4, telemetry):
    assert PLANE.is_grounded(px4(TAKEOFF, armed=True))
    telemetry.store(ExtendedSysState(m.MAV_VTOL_STATE_UNDEFINED, m.MAV_LANDED_STATE_UNDEFINED))
    assert not PLANE.is_grounded(telemetry)
    unknown = Telemetry(ORIGIN)
    unknown.store(beat(HOLD, armed=True))
    unknown.store(ExtendedSysState(m.MAV_VTOL_STATE_UNDEFINED, m.MAV_LANDED_STATE_ON_GROUND))
    assert not PLANE.is_grounded(unknown)
    assert PLANE.loiter(100.0, unknown) == (PLANE.set_mode(HOLD),)


def test_setpoints_are_taken_in_hold_and_in_the_air_only(px4):
    assert PLANE.takes_setpoints(px4(HOLD, armed=True, up_m=50.0, in_air=True))
    assert not PLANE.takes_setpoints(px4(HOLD, armed=True))
    assert not PLANE.takes_setpoints(px4(RTL, armed=True, up_m=50.0, in_air=True))


class Walk:
    """A start-up whose commands are all accepted at once, and twice."""

    def __init__(self, telemetry: Telemetry) -> None:
        self.start_up = StartUp(PLANE.start_up(PLANE.rates_hz(10.0)))
        self.commands, self.telemetry = CommandQueue(), telemetry

    def go(self) -> list[Command]:
        sent: list[Command] = []
        for _ in range(20):
            self.start_up.advance(self.telemetry, self.commands, NOW)
            command = self.commands.due(NOW)
            if command is not None:
                sent.append(command)
                for _ in range(2):
                    self.commands.acknowledge(CommandAck(command.command, m.MAV_RESULT_ACCEPTED), NOW)
        return sent


def test_from_the_ground_streams_take_off_and_arming_and_hold_comes_by_itself(px4, telemetry):
    walk = Walk(telemetry)
    asked = {command.param1: command.param2 for command in walk.go()}
    assert asked == {30.0: 1e5, 33.0: 1e5, 74.0: 1e5, 1.0: 5e5, 245.0: 5e5, 436.0: 2e4}
    px4(HOLD)
    (take_off,) = walk.go()
    assert isinstance(take_off, CommandLong)
    assert take_off.command == m.MAV_CMD_NAV_TAKEOFF
    assert math.isnan(take_off.param5)
    assert math.isnan(take_off.param6)
    assert take_off.param7 == pytest.approx(20.0 + 50.0)
    px4(TAKEOFF)
    assert [(command.command, command.param1) for command in walk.go()] == [(m.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)]
    px4(TAKEOFF, armed=True, up_m=30.0, in_air=True)
    assert walk.go() == []
    assert walk.start_up.doing == "waited for it to climb"
    px4(HOLD, armed=True, up_m=51.0, in_air=True)
    assert walk.go() == []
    assert walk.start_up.finished


def test_one_that_flies_in_another_mode_is_reported_hold_and_nothing_else(px4, telemetry):
    walk = Walk(telemetry)
    px4(RTL, armed=True, up_m=80.0, in_air=True)
    told = [command.command for command in walk.go()]
    assert told == [m.MAV_CMD_SET_MESSAGE_INTERVAL] * 6 + [m.MAV_CMD_DO_SET_MODE]


def test_take_off_waits_until_the_height_controllers_reference_has_come_up_to_the_field(px4, telemetry):
    """The reference begins at sea level and rises at 3 m/s; the field is at 20 m."""
    walk = Walk(telemetry)
    px4(HOLD, at_s=6.0)
    walk.go()
    assert walk.start_up.doing == "waited for its height controller to come up to the field"
    px4(HOLD, at_s=7.0)
    assert [command.command for command in walk.go()] == [m.MAV_CMD_NAV_TAKEOFF]


def test_it_loiters_at_a_place_reported_after_a_mode_whose_acknowledgement_comes_after_those_of_setpoints(px4):
    seen = px4(HOLD, armed=True, up_m=80.0, in_air=True)
    mode, place = PLANE.loiter(130.0, seen)
    assert PLANE.mode_asked(mode) == HOLD
    assert isinstance(place, CommandInt)
    assert (place.command, place.param1, place.param2, place.z) == (192, -1.0, 1.0, 150.0)
    queue = CommandQueue()
    queue.send((mode, place), NOW)
    queue.due(NOW)
    assert queue.acknowledge(CommandAck(192, m.MAV_RESULT_ACCEPTED), NOW) is None  # the acknowledgement of a setpoint


def test_home_is_where_it_says_and_rtl_if_it_never_did(px4):
    seen = px4(HOLD, armed=True, up_m=80.0, in_air=True)
    assert [PLANE.mode_asked(command) for command in PLANE.go_home(130.0, seen)] == [RTL]
    lat_rad, lon_rad, alt_m = ORIGIN.from_ned(40.0, -60.0, 0.0)
    seen.store(HomePosition(lat_rad, lon_rad, alt_m, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0)))
    _, place = PLANE.go_home(130.0, seen)
    assert isinstance(place, CommandInt)
    north_m, east_m, _ = ORIGIN.to_ned(math.radians(place.x / 1e7), math.radians(place.y / 1e7), place.z)
    assert (north_m, east_m, place.z) == (pytest.approx(40.0, abs=0.01), pytest.approx(-60.0, abs=0.01), 150.0)


def test_it_lands_by_its_mission_alone():
    plane = Px4Plane(PLANE.system, ORIGIN, 0.25)
    assert plane.land() == ()
    plane.landing = LandingSequence(0.0, 0.0, 0.0, 50.0)
    assert [each.command for each in plane.land()] == [m.MAV_CMD_DO_LAND_START]


def test_an_integer_parameter_is_the_bytes_of_one():
    two = struct.unpack("<f", struct.pack("<i", 2))[0]
    (frame,) = StreamParser().feed(
        FrameWriter(7, 1).encode(ParamValue("NAV_DLL_ACT", two, m.MAV_PARAM_TYPE_INT32, 900, 1))
    )
    assert isinstance(frame.message, ParamValue)
    assert PLANE.parameter(frame.message) == 2.0
    assert PLANE.parameter(ParamValue("FW_R_LIM", 50.0, m.MAV_PARAM_TYPE_REAL32, 900, 1)) == 50.0


@pytest.mark.parametrize(
    ("name", "value", "refuses"),
    [
        ("FW_AIRSPD_MIN", 12.0, False),
        ("FW_AIRSPD_MIN", 15.0, True),
        ("FW_AIRSPD_MAX", 18.0, False),
        ("FW_AIRSPD_MAX", 13.0, True),
        ("FW_AIRSPD_TRIM", 16.0, False),
        ("FW_R_LIM", 15.0, False),  # atan(14 * 0.25 / 9.81) = 19.6 degrees
        ("NAV_LOITER_RAD", -150.0, False),
    ],
)
def test_a_parameter_that_bounds_what_is_asked_is_named(name, value, refuses):
    in_order = {
        "FW_AIRSPD_MIN": 10.0,
        "FW_AIRSPD_MAX": 20.0,
        "FW_AIRSPD_TRIM": 14.0,
        "FW_R_LIM": 50.0,
        "NAV_LOITER_RAD": 80.0,
        "FW_T_CLMB_R_SP": 3.0,
        "FW_T_SINK_R_SP": 3.0,
        **dict.fromkeys(GEOFENCE_NAMES, 0.0),
    }
    flown = planned(14.0, 80.0, speed_min_mps=11.0, speed_max_mps=20.0, turn_rate_max_rps=0.25, accel_max_mps2=1.0)
    reader = ParameterReader(7, PLANE.checks(*flown), PLANE.parameter)
    two = struct.unpack("<f", struct.pack("<i", 2))[0]
    reader.receive_parameter(ParamValue("NAV_DLL_ACT", two, m.MAV_PARAM_TYPE_INT32, 900, 1), NOW)
    for each, its in (in_order | {name: value}).items():
        reader.receive_parameter(ParamValue(each, its, m.MAV_PARAM_TYPE_REAL32, 900, 1), NOW)
    (finding,) = reader.findings()
    assert finding.text.startswith(f"{name}: found {value:g}; allowed: ")
    assert finding.refuses is refuses


def test_an_integer_whose_bytes_are_no_number_as_a_float_is_read():
    reader = ParameterReader(7, [only_read("GF_ACTION")], PLANE.parameter)
    reader.receive_parameter(ParamValue("GF_ACTION", math.nan, m.MAV_PARAM_TYPE_REAL32, 900, 1), NOW)
    assert not reader.complete
    minus_one = struct.unpack("<f", struct.pack("<i", -1))[0]
    assert math.isnan(minus_one)
    reader.receive_parameter(ParamValue("GF_ACTION", minus_one, m.MAV_PARAM_TYPE_INT32, 900, 1), NOW)
    assert reader.values == {"GF_ACTION": -1.0}


def test_a_long_text_comes_in_chunks_and_is_one(telemetry):
    telemetry.store(Statustext(4, "a" * 50, 3, 0))
    assert telemetry.texts_reported == 0
    telemetry.store(Statustext(4, "b" * 50, 3, 1))
    telemetry.store(Statustext(4, " done\t", 3, 2))
    telemetry.store(Statustext(4, "Ready\t"))
    assert list(telemetry.texts) == ["a" * 50 + "b" * 50 + " done", "Ready"]
    assert telemetry.texts_reported == 2

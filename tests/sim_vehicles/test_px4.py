"""Emulated PX4s and pymavlink: acceptance, refusals and failsafes as in the simulator of PX4 1.17."""

from __future__ import annotations

import math
import struct

import pytest
from pymavlink import mavutil

from airlink import mavlink as m
from airlink.endpoint import Address
from formation_scenario import load_scenario
from formation_scenario.surroundings import Fault
from sim_vehicles.autopilot.modes_and_failsafe import Condition
from tests.sim_vehicles.conftest import mavlink

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED, WRONG_FRAME = 0, 1, 2, 3, 4, 9
HOLD, TAKEOFF, RTL, LAND = 0x03040000, 0x02040000, 0x05040000, 0x06040000
OFFBOARD, POSITION, ORBIT = 0x00060000, 0x00030000, 0x01030000
MANUAL, ALTITUDE, ACRO, STABILIZED = 0x00010000, 0x00020000, 0x00050000, 0x00070000
VELOCITY_AND_YAW, VELOCITY_ALONE, POSITION_ALONE = 0x9C7, 0x5C7, 0xDF8
LOCAL, BODY_OFFSET, BODY = 1, 9, 8
PATH = {"speed_mps": 14, "waypoints_m": [[0, 0, 100], [900, 0, 100]]}


def model_of(name, speed_mps):
    keys = {"vehicles": {"count": 1, "autopilot": "px4", "model": name}, "path": PATH | {"speed_mps": speed_mps}}
    return load_scenario(keys).vehicles[0].model


COPTER, PLANE = model_of("px4_copter", 5), model_of("px4", 14)
DRAGLESS = PLANE.model_copy(update={"prompt_share": 1.0})
"""Leaves no part of an airspeed change to its throttle's integrator."""


class Px4:
    """A ground station of one emulated PX4."""

    def __init__(self, air):
        self.air, self.vehicle = air, air.fleet.vehicles[0]
        self.beats = 0

    def greet(self):
        self.air.ground.send(mavlink.MAVLink_heartbeat_message(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3))

    def wait(self, seconds, *, greeting=True, every=None):
        """Let time pass, with heartbeats, and with a setpoint (`every`) ten times a second."""
        for number in range(round(seconds * 10)):
            if greeting and number % 10 == 0:
                self.greet()
            if every is not None:
                every()
            self.air.run(0.1)

    def command(self, *velocity, mask=VELOCITY_AND_YAW, frame=LOCAL, position=(0.0, 0.0, 0.0), yaw=0.0, rate=0.0):
        fields = (0, 1, 1, frame, mask, *position, *velocity, 0, 0, 0, yaw, rate)
        self.air.ground.send(mavlink.MAVLink_set_position_target_local_ned_message(*fields))

    def hover(self):
        self.command(0.0, 0.0, 0.0, mask=VELOCITY_ALONE)

    def results(self, command, *params):
        """Return all acknowledgements of a command."""
        before = len(self.air.ground.of("COMMAND_ACK"))
        values = (*params, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[:7]
        self.air.ground.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *values))
        self.air.run(0.02)
        return [each.result for each in self.air.ground.of("COMMAND_ACK")[before:] if each.command == command]

    def set_mode(self, mode):
        """Return the second acknowledgement."""
        first, second = self.results(m.MAV_CMD_DO_SET_MODE, 1, mode >> 16 & 0xFF, mode >> 24)
        assert first == ACCEPTED
        return second

    def reposition(self, north_m, east_m, alt_m, speed_mps=-1.0, change=1.0, frame=5):
        lat, lon, _ = self.air.fleet.origin.from_ned(north_m, east_m, 0.0)
        position = round(math.degrees(lat) * 1e7), round(math.degrees(lon) * 1e7)
        params = speed_mps, change, 0.0, math.nan
        return self.air.command_int(
            m.MAV_CMD_DO_REPOSITION, *params, frame=frame, x=position[0], y=position[1], z=alt_m
        )

    def offboard(self):
        self.wait(0.5, every=self.hover)
        assert self.set_mode(OFFBOARD) == ACCEPTED

    @property
    def mode(self):
        return self.vehicle.mode

    @property
    def shown(self):
        return self.air.ground.of("HEARTBEAT")[-1].custom_mode

    @property
    def motion(self):
        return self.air.fleet.bodies[0].motion

    @property
    def texts(self):
        return [each.text for each in self.air.ground.of("STATUSTEXT")]


@pytest.fixture
def px4(make_air):
    """Return a factory of PX4s that have booted and received their ground station."""

    def make(model=COPTER, *, wait_s=3.5, **keys):
        vehicle = Px4(make_air(model=model, **keys))
        vehicle.wait(wait_s)
        return vehicle

    return make


def test_it_says_what_it_is_and_boots_into_hold_disarmed(px4):
    for model, kind in ((COPTER, m.MAV_TYPE_QUADROTOR), (PLANE, m.MAV_TYPE_FIXED_WING)):
        beats = px4(model, in_air=False).air.ground.of("HEARTBEAT")
        assert {(each.autopilot, each.type, each.custom_mode) for each in beats} == {(12, kind, HOLD)}
        assert [each.system_status for each in (beats[0], beats[-1])] == [m.MAV_STATE_UNINIT, m.MAV_STATE_STANDBY]


def test_a_change_of_mode_is_acknowledged_twice_and_heartbeats_show_it_up_to_a_second_later(px4):
    copter = px4()
    assert copter.results(m.MAV_CMD_DO_SET_MODE, 1, 6, 0) == [ACCEPTED, REJECTED]
    assert copter.mode == HOLD
    copter.air.command_long(m.MAV_CMD_SET_MESSAGE_INTERVAL, m.MAVLINK_MSG_ID_CURRENT_MODE, 20_000)
    before = len(copter.air.ground.of("HEARTBEAT"))
    assert copter.results(m.MAV_CMD_DO_SET_MODE, 1, 4, 5) == [ACCEPTED, ACCEPTED]
    assert copter.mode == RTL
    assert len(copter.air.ground.of("HEARTBEAT")) == before
    copter.wait(1.0)
    assert copter.shown == RTL


def test_the_old_message_for_modes_is_acknowledged_once(px4):
    copter = px4()
    for flags, mode, result in ((1, RTL, ACCEPTED), (157, HOLD, ACCEPTED), (1, 99 << 16, REJECTED), (0, RTL, REJECTED)):
        before = len(copter.air.ground.of("COMMAND_ACK"))
        copter.air.ground.send(mavlink.MAVLink_set_mode_message(1, flags, mode))
        copter.air.run(0.02)
        answers = [(each.command, each.result) for each in copter.air.ground.of("COMMAND_ACK")[before:]]
        assert answers == [(m.MAV_CMD_DO_SET_MODE, result)]
    assert copter.mode == HOLD


def test_version_and_home_are_sent_on_request_and_what_it_has_not_is_denied(px4):
    copter = px4()
    for command, param in ((m.MAV_CMD_REQUEST_MESSAGE, 148), (m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1)):
        before = len(copter.air.ground.of("AUTOPILOT_VERSION"))
        assert copter.results(command, param) == [ACCEPTED]
        (version,) = copter.air.ground.of("AUTOPILOT_VERSION")[before:]
        assert (version.flight_sw_version >> 16, version.capabilities) == (0x0111, 59647)
    before = len(copter.air.ground.of("HOME_POSITION"))
    assert copter.results(m.MAV_CMD_GET_HOME_POSITION) == [ACCEPTED]
    assert len(copter.air.ground.of("HOME_POSITION")) > before
    assert copter.results(m.MAV_CMD_REQUEST_MESSAGE, 193) == [DENIED]


def test_commands_to_other_components_get_no_answer(px4):
    copter = px4()
    for component, result in ((0, ACCEPTED), (1, ACCEPTED), (77, None), (190, None)):
        assert copter.air.command_long(m.MAV_CMD_GET_MESSAGE_INTERVAL, 33, component=component) == result


def test_neither_arm_nor_disarm_is_only_remarked_on(px4):
    copter = px4(in_air=False)
    assert copter.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]
    assert copter.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 2) == []
    assert copter.texts[-1] == "Unsupported ARM_DISARM param: 2.000"
    assert copter.vehicle.pilot.condition.armed


def test_nav_loiter_unlim_is_unsupported(px4):
    copter = px4()
    copter.set_mode(RTL)
    assert copter.results(m.MAV_CMD_NAV_LOITER_UNLIM) == [UNSUPPORTED]
    assert copter.mode == RTL


@pytest.mark.parametrize(
    ("mode", "flags", "name"),
    [(HOLD, 29, "LOITER"), (TAKEOFF, 29, "TAKEOFF"), (RTL, 29, "RTL"), (LAND, 29, "LAND"), (POSITION, 81, "POSCTL")],
)
def test_flags_tell_pymavlink_its_mode(px4, mode, flags, name):
    copter = px4(in_air=False)
    copter.set_mode(mode)
    copter.wait(1.0)
    beat = copter.air.ground.of("HEARTBEAT")[-1]
    assert beat.base_mode == flags
    assert mavutil.mode_string_v10(beat) == name


@pytest.mark.parametrize("model", [COPTER, PLANE])
@pytest.mark.parametrize(
    ("mode", "flags", "name"),
    [
        (MANUAL, 81, "Manual"),
        (ALTITUDE, 81, "Altitude"),
        (POSITION, 81, "Position"),
        (ACRO, 65, "Acro"),
        (STABILIZED, 81, "Stabilized"),
    ],
)
def test_modes_of_a_pilot_need_a_transmitter_once_it_is_armed(px4, model, mode, flags, name):
    standing, flying = px4(model, in_air=False), px4(model)
    assert standing.set_mode(mode) == ACCEPTED
    assert standing.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [REJECTED]
    standing.wait(1.0)
    beat = standing.air.ground.of("HEARTBEAT")[-1]
    assert (beat.base_mode, beat.custom_mode, beat.system_status) == (flags, mode, m.MAV_STATE_UNINIT)
    assert flying.set_mode(mode) == REJECTED
    assert "".join(flying.texts).endswith(f"Switching to {name} is currently not available")
    assert flying.mode == HOLD


@pytest.mark.parametrize("model", [COPTER, PLANE])
def test_a_pilot_with_a_transmitter_takes_over(px4, model):
    vehicle = px4(model)
    vehicle.vehicle.inject(Fault(at_s=0, kind="pilot", mode="MANUAL"), vehicle.vehicle.now, ends=False)
    assert vehicle.mode == MANUAL
    assert vehicle.set_mode(POSITION) == ACCEPTED


def test_flags_in_offboard(px4):
    copter = px4()
    copter.offboard()
    copter.wait(1.2, every=copter.hover)
    assert copter.air.ground.of("HEARTBEAT")[-1].base_mode == 145


def test_a_change_is_reported_at_once_to_who_asked_for_current_mode(px4):
    copter = px4()
    reported = []
    copter.air.command_long(m.MAV_CMD_SET_MESSAGE_INTERVAL, m.MAVLINK_MSG_ID_CURRENT_MODE, 20_000)
    copter.vehicle.broadcast = lambda message: reported.append(type(message).__name__)
    copter.vehicle.switch(RTL)
    assert reported == ["CurrentMode"]


def test_part_of_a_change_of_velocity_comes_slowly_as_measured(px4):
    """PX4's simulated quadrotor 0.5, 1, 2, 4 and 8 s after a step, from rest and back: 5 m/s for 9 s."""
    copter = px4()
    copter.offboard()
    copter.wait(60.0, every=copter.hover)
    for commanded_mps, flown_mps in ((5.0, (1.61, 3.12, 3.67, 3.9, 4.25)), (0.0, (2.64, 1.2, 0.76, 0.54, 0.22))):
        seen_mps = []
        for wait_s in (0.5, 0.5, 1.0, 2.0, 4.0):
            copter.wait(wait_s, every=lambda commanded_mps=commanded_mps: copter.command(commanded_mps, 0.0, 0.0))
            seen_mps.append(copter.motion.velocity_north_mps)
        assert seen_mps == pytest.approx(flown_mps, abs=0.35)
        copter.wait(1.0, every=lambda commanded_mps=commanded_mps: copter.command(commanded_mps, 0.0, 0.0))


def test_offboard_needs_setpoints_before_it(px4):
    copter = px4()
    assert copter.set_mode(OFFBOARD) == REJECTED
    copter.wait(0.3, every=copter.hover)
    assert copter.set_mode(OFFBOARD) == ACCEPTED
    copter.wait(40.0, every=lambda: copter.command(3.0, -2.0, 0.0))
    velocity = copter.motion.velocity_north_mps, copter.motion.velocity_east_mps
    assert velocity == pytest.approx((3.0, -2.0), abs=0.2)


def test_when_setpoints_stop_it_returns_after_a_second_and_comes_back_by_itself_when_they_do(px4):
    copter = px4()
    copter.offboard()
    copter.wait(0.8)
    assert copter.mode == OFFBOARD
    copter.wait(0.2)
    assert copter.mode == RTL
    copter.wait(1.0)
    assert copter.air.ground.of("HEARTBEAT")[-1].system_status == m.MAV_STATE_CRITICAL
    copter.wait(0.2, every=copter.hover)
    assert copter.mode == OFFBOARD
    copter.wait(1.0, every=copter.hover)
    assert copter.air.ground.of("HEARTBEAT")[-1].system_status == m.MAV_STATE_ACTIVE


@pytest.mark.parametrize("model", [COPTER, PLANE])
def test_out_of_offboard_it_waits_for_what_comes_next(px4, model):
    """Otherwise the timeout of setpoints that it no longer expects would wake it in each cycle."""
    vehicle = px4(model)
    position = {"mask": POSITION_ALONE, "position": (900.0, 0.0, -80.0)}
    vehicle.wait(0.5, every=lambda: vehicle.command(0.0, 0.0, 0.0, **position))
    assert vehicle.set_mode(OFFBOARD) == ACCEPTED
    vehicle.wait(0.5, every=lambda: vehicle.command(0.0, 0.0, 0.0, **position))
    assert vehicle.set_mode(HOLD) == ACCEPTED
    vehicle.wait(2.0)
    assert vehicle.vehicle.pilot.silent_at > vehicle.vehicle.now


def test_setpoints_that_ignore_every_field_are_invalid(px4):
    copter = px4()
    copter.offboard()
    copter.wait(1.2, every=lambda: copter.command(0.0, 0.0, 0.0, mask=0xFFF))
    assert copter.mode == RTL
    assert "SET_POSITION_TARGET_LOCAL_NED invalid" in copter.texts


def test_who_was_commanded_another_mode_meanwhile_doesnt_come_back(px4):
    copter = px4()
    copter.offboard()
    copter.wait(2.0)
    assert copter.set_mode(HOLD) == ACCEPTED
    copter.wait(1.0, every=copter.hover)
    assert copter.mode == HOLD


@pytest.mark.parametrize(("action", "mode"), [(0, RTL), (3, RTL), (4, LAND), (5, HOLD)])
def test_what_it_does_without_setpoints_is_a_parameter(px4, action, mode):
    copter = px4()
    copter.vehicle.parameters._values["COM_OBL_RC_ACT"] = action
    copter.offboard()
    copter.wait(1.3)
    assert copter.mode == mode


def test_velocities_of_the_nose_are_taken_and_those_of_a_moving_frame_are_not(px4):
    copter = px4()
    copter.offboard()
    copter.wait(40.0, every=lambda: copter.command(0.0, 2.0, 0.0, yaw=math.pi / 2))
    copter.wait(10.0, every=lambda: copter.command(2.0, 0.0, 0.0, frame=BODY, mask=VELOCITY_ALONE))
    assert (copter.motion.velocity_north_mps, copter.motion.velocity_east_mps) == pytest.approx((0.0, 2.0), abs=0.1)
    copter.wait(1.3, every=lambda: copter.command(1.0, 0.0, 0.0, frame=BODY_OFFSET))
    assert copter.mode == RTL
    assert "coordinate frame 9 unsupported" in "".join(copter.texts)


def test_when_heartbeats_stop_it_holds_and_returns_even_while_setpoints_come(px4):
    copter = px4()
    copter.vehicle.parameters._values["NAV_DLL_ACT"] = 2
    copter.offboard()
    copter.wait(9.0, greeting=False, every=copter.hover)
    assert copter.mode == OFFBOARD
    copter.wait(1.5, greeting=False, every=copter.hover)
    assert copter.mode == HOLD
    copter.wait(5.0, greeting=False, every=copter.hover)
    assert copter.mode == RTL
    copter.wait(2.0, every=copter.hover)
    assert copter.mode == RTL


def test_without_an_action_the_end_of_heartbeats_changes_nothing(px4):
    copter = px4()
    copter.offboard()
    copter.wait(20.0, greeting=False, every=copter.hover)
    assert copter.mode == OFFBOARD


def test_disarmed_it_takes_any_mode_and_then_isnt_armed(px4):
    copter = px4(in_air=False)
    for mode in (OFFBOARD, RTL, LAND):
        assert copter.set_mode(mode) == ACCEPTED
        assert copter.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [REJECTED]
    assert copter.set_mode(HOLD) == ACCEPTED
    assert copter.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]
    copter.wait(10.5)
    assert not copter.vehicle.pilot.condition.armed


@pytest.mark.parametrize(("model", "limit_s"), [(COPTER, 40), (PLANE, 60)])
def test_take_off_is_to_an_altitude_above_sea_level_and_ends_in_hold(px4, model, limit_s):
    vehicle = px4(model, in_air=False, origin_alt_m=5.0)
    up = math.nan, math.nan, 5.0 + 20.0
    assert vehicle.results(m.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, *up) == [ACCEPTED]
    assert vehicle.mode == TAKEOFF
    assert vehicle.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]
    vehicle.wait(limit_s)
    assert vehicle.mode == HOLD
    assert vehicle.motion.height_m == pytest.approx(20.0, abs=2.5)


def test_commanded_to_take_off_in_flight_a_multirotor_climbs_and_holds(px4):
    copter = px4(origin_alt_m=5.0)
    assert copter.results(m.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, 5.0 + 110.0) == [ACCEPTED]
    assert copter.mode == TAKEOFF
    copter.wait(12.0)
    assert copter.motion.height_m == pytest.approx(110.0, abs=0.3)
    assert copter.mode == HOLD


@pytest.mark.parametrize("home", [LAND, pytest.param(RTL, marks=pytest.mark.slow)])
def test_a_multirotor_that_has_landed_waits_in_hold_and_can_be_armed_again(px4, home):
    copter = px4(in_air=False)
    assert copter.results(m.MAV_CMD_NAV_TAKEOFF, -1, 0, 0, math.nan, math.nan, math.nan, 10.0) == [ACCEPTED]
    copter.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    copter.wait(10.0)
    assert copter.set_mode(home) == ACCEPTED
    copter.wait(60.0)
    assert not copter.vehicle.pilot.condition.armed
    assert copter.shown == HOLD
    assert copter.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]


def test_one_that_is_armed_already_takes_off_when_it_is_commanded(px4):
    copter = px4(in_air=False)
    assert copter.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]
    assert copter.results(m.MAV_CMD_NAV_TAKEOFF, -1, 0, 0, math.nan, math.nan, math.nan, 10.0) == [ACCEPTED]
    copter.wait(16.0)
    assert copter.motion.height_m == pytest.approx(10.0, abs=0.3)
    assert copter.mode == HOLD


@pytest.mark.parametrize("armed_first", [False, True])
def test_by_its_mode_alone_it_takes_off_to_its_parameters_height(px4, armed_first):
    copter = px4(in_air=False)
    orders = [lambda: copter.set_mode(TAKEOFF), lambda: copter.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1)[0]]
    for order in reversed(orders) if armed_first else orders:
        assert order() == ACCEPTED
    copter.wait(12.0)
    assert copter.motion.height_m == pytest.approx(copter.vehicle.parameters["MIS_TAKEOFF_ALT"], abs=0.3)


def test_a_fixed_wing_that_leaves_a_high_field_soon_after_boot_dives_into_the_ground(px4):
    plane = px4(PLANE, in_air=False, origin_alt_m=489.0)
    plane.results(m.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, 489.0 + 50.0)
    plane.results(m.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    plane.wait(30.0)
    assert plane.vehicle.pilot.condition is Condition.CRASHED


def test_a_fixed_wing_flies_straight_to_a_position_far_ahead_at_the_speed_commanded_within_its_limits(px4):
    plane, results = px4(DRAGLESS), []
    for _ in range(200):
        here = plane.motion
        results.append(plane.reposition(here.north_m + 300.0, here.east_m + 300.0, 90.0, 15.0))
        plane.air.run(0.08)
    course = math.atan2(plane.motion.velocity_east_mps, plane.motion.velocity_north_mps)
    assert course == pytest.approx(math.pi / 4, abs=0.02)
    assert plane.motion.airspeed_mps == pytest.approx(15.0, abs=0.3)
    assert plane.motion.height_m == pytest.approx(90.0, abs=1.0)
    assert set(results) == {ACCEPTED}
    plane.reposition(9000.0, 9000.0, 90.0, 30.0)
    plane.air.run(0.1)
    assert plane.motion.airspeed_setpoint_mps == 20.0


def test_of_a_change_of_airspeed_a_share_comes_soon_and_the_rest_with_its_integrator(px4):
    """docs/real-autopilots.md. Of 2 m/s at the setpoint's rate, most of the prompt share, 0.55, is flown after 6 s."""
    plane = px4(PLANE.model_copy(update={"rest_s": 30.0}))
    for commanded_mps, after_s, flown_mps in ((16.0, 80.0, 16.0), (14.0, 6.0, 16.0 - 0.55 * 2.0), (14.0, 60.0, 14.0)):
        assert plane.results(m.MAV_CMD_DO_CHANGE_SPEED, 0, commanded_mps, -1) == [ACCEPTED]
        plane.wait(after_s)
        assert plane.motion.airspeed_mps == pytest.approx(flown_mps, abs=0.2)


def test_a_position_is_taken_in_one_frame_and_with_its_change_of_mode_alone(px4):
    plane = px4(PLANE)
    assert plane.reposition(500.0, 0.0, 80.0, frame=3) == WRONG_FRAME
    assert plane.reposition(500.0, 0.0, 80.0, change=0.0) == UNSUPPORTED
    for command in (43000, 43001, 43002):
        assert plane.results(command) == [UNSUPPORTED]


def test_a_position_undoes_a_pilots_choice(px4):
    plane = px4(PLANE)
    plane.set_mode(RTL)
    assert plane.reposition(500.0, 0.0, 80.0) == ACCEPTED
    assert plane.mode == HOLD


def test_in_offboard_a_fixed_wing_ignores_velocities_and_speeds_unsaid_and_flies_to_positions(px4):
    plane = px4(PLANE)
    plane.wait(0.5, every=lambda: plane.command(0.0, 18.0, 0.0, mask=0xDC7))
    assert plane.set_mode(OFFBOARD) == ACCEPTED
    reported = len(plane.texts)
    trim_mps = plane.vehicle.parameters["FW_AIRSPD_TRIM"]
    assert plane.results(m.MAV_CMD_DO_CHANGE_SPEED, 0, 12.0, -1) == [ACCEPTED]
    position = plane.motion.north_m, plane.motion.east_m + 900.0, -60.0
    plane.wait(20.0, every=lambda: plane.command(0.0, 12.0, 0.0, mask=POSITION_ALONE, position=position))
    assert plane.motion.velocity_east_mps == pytest.approx(min(trim_mps, 20.0), abs=0.6)
    assert plane.motion.height_m < 75.0
    assert len(plane.texts) == reported


def test_in_hold_speed_and_altitude_above_sea_level_are_taken(px4):
    plane = px4(DRAGLESS, origin_alt_m=30.0)
    assert plane.results(m.MAV_CMD_DO_CHANGE_SPEED, 0, 12.0, -1) == [ACCEPTED]
    assert plane.results(m.MAV_CMD_DO_CHANGE_ALTITUDE, 140.0, 0) == [ACCEPTED]
    plane.wait(30.0)
    assert plane.motion.airspeed_mps == pytest.approx(12.0, abs=0.2)
    assert plane.motion.height_m == pytest.approx(110.0, abs=1.0)


def test_in_hold_a_multirotor_takes_an_altitude_and_a_speed_too(px4):
    copter = px4(origin_alt_m=30.0)
    assert copter.results(m.MAV_CMD_DO_CHANGE_ALTITUDE, 120.0, 0) == [ACCEPTED]
    copter.wait(15.0)
    assert copter.motion.height_m == pytest.approx(90.0, abs=0.3)
    assert copter.reposition(copter.motion.north_m + 200.0, 0.0, 120.0) == ACCEPTED
    copter.wait(4.0)
    for no_speed in (-1.0, math.nan):
        assert copter.results(m.MAV_CMD_DO_CHANGE_SPEED, 1, no_speed, -1) == [ACCEPTED]
    assert copter.results(m.MAV_CMD_DO_CHANGE_SPEED, 1, 2.0, -1) == [ACCEPTED]
    copter.wait(30.0)
    assert copter.motion.velocity_north_mps == pytest.approx(2.0, abs=0.2)


def test_an_altitude_ends_offboard(px4):
    copter = px4()
    copter.offboard()
    assert copter.results(m.MAV_CMD_DO_CHANGE_ALTITUDE, math.nan, 0) == [ACCEPTED]
    assert copter.mode == HOLD


@pytest.mark.parametrize(("radius_m", "speed_mps", "clockwise"), [(20, 3, True), (20, -2, False), (-20, 2, False)])
def test_it_orbits_a_position_with_its_nose_to_it(px4, radius_m, speed_mps, clockwise):
    copter = px4()
    copter.wait(10.0)
    here = copter.motion.north_m, copter.motion.east_m
    assert copter.results(m.MAV_CMD_DO_ORBIT, radius_m, speed_mps, 0, *(math.nan,) * 4) == [ACCEPTED]
    copter.wait(60.0)
    assert (copter.shown, copter.air.ground.of("HEARTBEAT")[-1].base_mode) == (ORBIT, 145)
    north_m, east_m = copter.motion.north_m - here[0], copter.motion.east_m - here[1]
    assert math.hypot(north_m, east_m) == pytest.approx(20.0, abs=3.0)
    nose_rad = copter.vehicle.sensed.heading_rad
    assert abs(math.remainder(nose_rad - math.atan2(-east_m, -north_m), math.tau)) < 0.2
    turns = north_m * copter.motion.velocity_east_mps - east_m * copter.motion.velocity_north_mps
    assert (turns > 0.0) == clockwise


def test_a_yaw_rate_turns_the_nose(px4):
    """A real one at 0.3 rad/s turned by 57 degrees in 4 s; commanded a velocity only, it kept its nose."""
    copter = px4()
    copter.offboard()
    before = copter.vehicle.sensed.heading_rad
    copter.wait(4.0, every=lambda: copter.command(0.0, 0.0, 0.0, mask=VELOCITY_ALONE, rate=0.3))
    turned_rad = copter.vehicle.sensed.heading_rad - before
    assert math.degrees(turned_rad) == pytest.approx(60.0, abs=6.0)
    copter.wait(3.0, every=lambda: copter.command(2.0, 0.0, 0.0, mask=0xDC7))
    assert copter.vehicle.sensed.heading_rad - before == pytest.approx(turned_rad, abs=0.15)


@pytest.mark.parametrize("model", [COPTER, PLANE])
def test_what_it_accepts_without_an_effect_here(px4, model):
    vehicle = px4(model)
    for command in (195, 197, 201, 191, 401, 519):
        assert vehicle.results(command) == [ACCEPTED]
    assert vehicle.mode == HOLD


def test_a_mission_that_it_has_not_is_denied(px4):
    copter = px4()
    assert copter.results(m.MAV_CMD_MISSION_START) == [DENIED]
    assert copter.texts[-1] == "Mission start denied! No valid mission"


def test_its_streams_are_fast_unasked_and_zero_restores_that(px4):
    copter = px4()

    def rates():
        before = {name: len(copter.air.ground.of(name)) for name in ("ATTITUDE", "VFR_HUD", "SYS_STATUS", "HEARTBEAT")}
        copter.wait(2.0)
        return {name: (len(copter.air.ground.of(name)) - count) / 2 for name, count in before.items()}

    usual = {"ATTITUDE": 50, "VFR_HUD": 4, "SYS_STATUS": 1, "HEARTBEAT": 1}
    assert rates() == usual
    assert copter.air.command_long(m.MAV_CMD_SET_MESSAGE_INTERVAL, m.MAVLINK_MSG_ID_ATTITUDE, 100_000) == ACCEPTED
    assert rates() == usual | {"ATTITUDE": 10}
    assert copter.air.command_long(m.MAV_CMD_SET_MESSAGE_INTERVAL, m.MAVLINK_MSG_ID_ATTITUDE, 0) == ACCEPTED
    assert rates() == usual
    assert copter.air.command_long(m.MAV_CMD_SET_MESSAGE_INTERVAL, m.MAVLINK_MSG_ID_ATTITUDE, 10_000) == ACCEPTED
    assert rates() == usual  # the main loop's
    for message_id in (m.MAVLINK_MSG_ID_HEARTBEAT, 65000):
        assert copter.air.command_long(m.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, 100_000) == FAILED


def test_the_interval_of_what_it_does_not_know_is_reported_as_none(px4):
    copter = px4()
    assert copter.results(m.MAV_CMD_GET_MESSAGE_INTERVAL, 9999) == [ACCEPTED]
    assert copter.air.ground.of("MESSAGE_INTERVAL")[-1].interval_us == -1


def test_a_multirotor_measures_no_airspeed_and_the_receiver_has_no_time(px4):
    copter, plane = px4(), px4(PLANE)
    assert all(math.isnan(each.airspeed) for each in copter.air.ground.of("VFR_HUD"))
    assert not any(math.isnan(each.airspeed) for each in plane.air.ground.of("VFR_HUD"))
    assert {each.time_usec for each in copter.air.ground.of("GPS_RAW_INT")} == {0}


def test_texts_wait_for_a_ground_station_and_long_ones_come_in_chunks(make_air):
    copter = Px4(make_air(model=COPTER))
    copter.wait(1.0, greeting=False)
    copter.vehicle.say(4, "short")
    copter.vehicle.say(4, "x" * 70)
    copter.wait(1.0, greeting=False)
    assert copter.texts == []
    copter.greet()
    copter.air.run(0.1)
    assert copter.texts == ["short", "x" * 50, "x" * 20]
    long = copter.air.ground.of("STATUSTEXT")[1:]
    assert long[0].id == long[1].id > 0
    assert [each.chunk_seq for each in long] == [0, 1]


def test_its_link_receives_the_first_port_alone(make_air):
    copter = Px4(make_air(model=COPTER, endpoint="udpin:127.0.0.1:14550"))
    other = copter.air.peer(Address("127.0.0.1", 40000))
    copter.wait(1.0)
    assert copter.air.command_long(m.MAV_CMD_REQUEST_MESSAGE, 0, peer=other) is None
    copter.wait(1.0)
    assert other.received == []
    assert copter.air.command_long(m.MAV_CMD_REQUEST_MESSAGE, 0) == ACCEPTED


def test_an_integer_parameter_is_the_bytes_of_one(px4):
    copter = px4()
    two = struct.unpack("<f", struct.pack("<i", 2))[0]
    copter.air.ground.send(mavlink.MAVLink_param_set_message(1, 1, b"NAV_DLL_ACT", two, m.MAV_PARAM_TYPE_INT32))
    copter.air.run(0.1)
    (reported,) = copter.air.ground.of("PARAM_VALUE")
    assert (reported.param_id, reported.param_type, reported.param_value) == (
        "NAV_DLL_ACT",
        m.MAV_PARAM_TYPE_INT32,
        two,
    )
    assert copter.vehicle.parameters["NAV_DLL_ACT"] == 2


def test_a_parameter_that_it_has_not_is_reported_as_an_error(px4):
    copter = px4()
    for asked in (
        mavlink.MAVLink_param_request_read_message(1, 1, b"NOPE", -1),
        mavlink.MAVLink_param_set_message(1, 1, b"NOPE", 1.0, m.MAV_PARAM_TYPE_REAL32),
        mavlink.MAVLink_param_request_read_message(1, 1, b"", 20000),
    ):
        copter.air.ground.send(asked)
        copter.air.run(0.1)
    errors = [(each.param_id, each.param_index, each.error) for each in copter.air.ground.of("PARAM_ERROR")]
    assert errors == [("NOPE", -1, 1), ("NOPE", -1, 1), ("", 20000, 1)]
    assert copter.air.ground.of("PARAM_VALUE") == []

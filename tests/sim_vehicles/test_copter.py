"""An emulated ArduCopter, asked by pymavlink: acceptance, refusals and motion as measured on ArduCopter 4.7."""

from __future__ import annotations

import math

import pytest

from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from formation_scenario.surroundings import StepDisturbance
from tests.sim_vehicles.conftest import mavlink

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
SET_MODE, ARM, TAKEOFF, INTERVAL, REQUEST = 176, 400, 22, 511, 512
STABILIZE, AUTO, GUIDED, LOITER, RTL, LAND, BRAKE = 0, 3, 4, 5, 6, 9, 17
PATH = {"speed_mps": 5, "waypoints_m": [[0, 0, 30], [500, 0, 30]]}
VELOCITY_AND_YAW, VELOCITY_ALONE, VELOCITY_ONLY, HEIGHT_TOO = 0x9C7, 0x5C7, 0xDC7, 0x9C3
MODEL = load_scenario({"vehicles": {"count": 1, "autopilot": "arducopter"}, "path": PATH}).vehicles[0].model


class Pilot:
    """Sends one emulated copter velocities at 10 Hz."""

    def __init__(self, air):
        self.air = air

    def tell(self, north, east=0.0, down=0.0, yaw=0.0, mask=VELOCITY_AND_YAW, target=1):
        fields = (0, target, 1, 1, mask, 0, 0, -40.0, north, east, down, 0, 0, 0, yaw, 0)
        self.air.ground.send(mavlink.MAVLink_set_position_target_local_ned_message(*fields))

    def fly(self, seconds, *velocity, **keys):
        """Return the ground velocities (north, east) of each 0.02 s."""
        seen = []
        for _ in range(round(seconds * 10)):
            self.tell(*velocity, **keys)
            for _ in range(5):
                self.air.run(0.02)
                seen.append((self.motion.velocity_north_mps, self.motion.velocity_east_mps))
        return seen

    @property
    def motion(self):
        return self.air.fleet.bodies[0].motion

    @property
    def shown(self):
        return self.air.fleet.vehicles[0].sensed

    @property
    def mode(self):
        return self.air.fleet.vehicles[0].pilot.mode


@pytest.fixture
def standing(make_air):
    """One that stands in the air, in GUIDED."""
    copter = Pilot(make_air(model=MODEL))
    copter.air.run(8.0)
    return copter


@pytest.fixture
def grounded(make_air):
    air = make_air(model=MODEL, in_air=False)
    air.run(4.0)
    return air


def reached(speeds, share):
    """Return when a step has come to a share of its way, s."""
    begin, end = speeds[0], speeds[-1]
    return 0.02 * next(i for i, speed in enumerate(speeds, 1) if (speed - begin) / (end - begin) >= share)


@pytest.mark.parametrize(
    ("before", "after", "t63_s", "t90_s"),
    [(0.0, 5.0, 1.60, 2.36), (5.0, 0.0, 1.64, 2.32), (5.0, 6.0, 0.78, 1.8), (5.0, 5.3, 0.64, 1.22)],
)
def test_steps_of_velocity_take_as_long_as_measured(standing, before, after, t63_s, t90_s):
    standing.fly(6.0, before)
    north = [each[0] for each in standing.fly(8.0, after)]
    assert reached(north, 0.63) == pytest.approx(t63_s, rel=0.1)
    assert reached(north, 0.9) == pytest.approx(t90_s, rel=0.25)


@pytest.mark.parametrize(
    ("climb_mps", "t63_s", "t90_s"), [(1.0, 0.79, 1.04), (-1.0, 0.8, 1.04), (0.3, 0.41, 0.6), (-0.3, 0.42, 0.61)]
)
def test_steps_of_climb_take_as_long_as_measured(standing, climb_mps, t63_s, t90_s):
    """To a climb, and back to none."""
    for reported in (climb_mps, 0.0):
        climbs = []
        for _ in range(25):
            standing.tell(0.0, 0.0, -reported)
            for _ in range(5):
                standing.air.run(0.02)
                climbs.append(standing.motion.climb_mps)
        assert reached(climbs, 0.63) == pytest.approx(t63_s, rel=0.15)
        assert reached(climbs, 0.9) == pytest.approx(t90_s, rel=0.15)


@pytest.mark.parametrize(("turn_rad", "t63_s", "t90_s"), [(math.pi / 2, 1.26, 1.65), (0.35, 0.6, 0.78)])
def test_steps_of_the_nose_take_as_long_as_measured(standing, turn_rad, t63_s, t90_s):
    standing.fly(5.0, 0.0)
    for reported in (turn_rad, 0.0):
        noses = []
        for _ in range(30):
            standing.tell(0.0, yaw=reported)
            for _ in range(5):
                standing.air.run(0.02)
                noses.append(math.remainder(standing.shown.heading_rad, math.tau))
        assert reached(noses, 0.63) == pytest.approx(t63_s, rel=0.15)
        assert reached(noses, 0.9) == pytest.approx(t90_s, rel=0.15)


def test_it_flies_in_any_direction(standing):
    north, east = standing.fly(6.0, -1.0, 2.0)[-1]
    assert (north, east) == pytest.approx((-1.0, 2.0), abs=0.02)


def test_it_stands_some_seconds_after_the_last_velocity_still_in_guided(standing):
    standing.fly(6.0, 3.0)
    standing.air.run(2.8)
    assert standing.motion.velocity_north_mps == pytest.approx(3.0, abs=0.05)
    standing.air.run(2.4)
    assert abs(standing.motion.velocity_north_mps) < 0.1
    assert standing.mode == GUIDED


@pytest.mark.parametrize("velocity", [(math.nan, 0.0), (math.inf, 0.0)])
def test_what_isnt_finite_stops_it(standing, velocity):
    standing.fly(4.0, 3.0)
    standing.fly(4.0, *velocity)
    assert abs(standing.motion.velocity_north_mps) < 0.05


def test_a_height_beside_a_velocity_isnt_followed(standing):
    height_m = standing.motion.height_m
    standing.fly(5.0, 1.0, mask=HEIGHT_TOO)
    assert standing.motion.height_m == pytest.approx(height_m, abs=0.1)


def test_the_nose_turns_as_told_and_stays_where_it_is_not(standing):
    standing.fly(5.0, 1.0, yaw=math.pi / 2)
    assert standing.shown.heading_rad == pytest.approx(math.pi / 2, abs=0.05)
    standing.fly(4.0, -2.0, mask=VELOCITY_ALONE)
    assert standing.shown.heading_rad == pytest.approx(math.pi / 2, abs=0.05)
    standing.fly(8.0, -2.0, mask=VELOCITY_ONLY)
    assert abs(math.remainder(standing.shown.heading_rad - math.pi, math.tau)) < 0.05


def test_it_flies_no_faster_than_its_parameter(standing):
    assert standing.fly(12.0, 15.0)[-1][0] == pytest.approx(10.0, abs=0.05)


def test_the_airspeed_it_tells_is_its_speed(standing):
    standing.fly(6.0, 3.0, 0.0, -1.0)
    assert standing.shown.airspeed_mps == pytest.approx(math.hypot(3.0, 1.0), abs=0.1)


def test_wind_pushes_it_once_and_doesnt_carry_it_away(make_air):
    gust = StepDisturbance(at_s=0.0, velocity_mps=(2.0, 0.0, 0.0)), frozenset({VehicleId(1, 1)})
    copter = Pilot(make_air(model=MODEL, disturbances=(gust,)))
    copter.air.run(8.0)
    copter.air.tell_mission_time(0.0)
    copter.air.run(0.1)
    assert copter.motion.velocity_north_mps > 1.5
    copter.air.run(5.0)
    assert abs(copter.motion.velocity_north_mps) < 0.02


def test_it_lifts_off_straight_up_in_any_wind_it_stood_in(make_air):
    gust = StepDisturbance(at_s=0.0, velocity_mps=(0.0, 8.0, 0.0)), frozenset({VehicleId(1, 1)})
    air = make_air(model=MODEL, in_air=False, disturbances=(gust,))
    air.tell_mission_time(0.0)
    air.run(4.0)
    air.set_mode(GUIDED)
    air.command_long(ARM, 1)
    air.command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 20.0)
    air.run(14.0)
    assert air.state("height_m") == pytest.approx(20.0, abs=0.3)
    assert abs(air.state("east_m")) < 0.01


@pytest.mark.parametrize("command", [43000, 43001, 43002, 192, 12345])
def test_what_planes_are_told_is_unsupported(standing, command):
    assert standing.air.command_long(command, 0, 5.0) == UNSUPPORTED


def test_others_setpoints_and_those_in_other_modes_are_not_heeded(standing):
    standing.fly(3.0, 3.0, target=2)
    assert abs(standing.motion.velocity_north_mps) < 0.05
    standing.air.set_mode(BRAKE)
    standing.fly(3.0, 3.0)
    assert abs(standing.motion.velocity_north_mps) < 0.05


def test_it_takes_off_in_guided_once_armed(grounded):
    assert grounded.command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 20.0) == FAILED
    assert grounded.set_mode(GUIDED) == ACCEPTED
    assert grounded.command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 20.0) == FAILED
    assert grounded.command_long(ARM, 1) == ACCEPTED
    for frame in (0, 5, 6):
        assert grounded.command_int(TAKEOFF, frame=frame, z=20.0) == DENIED
    assert grounded.command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 20.0) == ACCEPTED
    grounded.run(14.0)
    assert grounded.state("height_m") == pytest.approx(20.0, abs=0.3)
    assert grounded.command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 30.0) == FAILED
    assert grounded.command_long(ARM, 0) == FAILED
    assert grounded.ground.of("HEARTBEAT")[-1].type == mavlink.MAV_TYPE_QUADROTOR


def test_it_tells_take_offs_and_landings(grounded):
    def landed_state():
        assert grounded.command_long(REQUEST, 245) == ACCEPTED
        return grounded.ground.of("EXTENDED_SYS_STATE")[-1].landed_state

    grounded.set_mode(GUIDED)
    grounded.command_long(ARM, 1)
    assert landed_state() == mavlink.MAV_LANDED_STATE_ON_GROUND
    grounded.command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 20.0)
    grounded.run(4.0)
    assert landed_state() == mavlink.MAV_LANDED_STATE_TAKEOFF
    grounded.run(10.0)
    assert landed_state() == mavlink.MAV_LANDED_STATE_IN_AIR
    grounded.set_mode(LAND)
    grounded.run(2.0)
    assert landed_state() == mavlink.MAV_LANDED_STATE_LANDING


@pytest.mark.parametrize(("mode", "name"), [(RTL, "RTL"), (LAND, "LAND"), (BRAKE, "BRAKE")])
def test_in_modes_that_end_a_flight_it_isnt_armed_and_says_so(grounded, mode, name):
    assert grounded.set_mode(mode) == ACCEPTED
    assert grounded.command_long(ARM, 1) == FAILED
    assert grounded.ground.of("STATUSTEXT")[-1].text == f"Arm: {name} mode not armable"


def test_on_the_ground_it_disarms_by_itself(grounded):
    grounded.set_mode(GUIDED)
    grounded.command_long(ARM, 1)
    grounded.run(9.0)
    assert grounded.fleet.vehicles[0].pilot.condition.armed
    grounded.run(1.5)
    assert not grounded.fleet.vehicles[0].pilot.condition.armed


def test_unasked_it_sends_heartbeats_alone(grounded):
    telemetry = {each.get_type() for _, each in grounded.ground.heard} - {"HEARTBEAT", "STATUSTEXT", "TIMESYNC"}
    assert telemetry == set()
    assert grounded.command_long(INTERVAL, 33, 100_000) == ACCEPTED
    grounded.run(1.0)
    assert len(grounded.ground.of("GLOBAL_POSITION_INT")) == pytest.approx(10, abs=1)


@pytest.mark.parametrize("mode", [AUTO, 99, 15])
def test_modes_that_it_hasnt_are_refused(standing, mode):
    assert standing.air.set_mode(mode) == FAILED
    assert standing.mode == GUIDED


def test_a_mission_isnt_begun(standing):
    assert standing.air.command_long(300) == FAILED


def test_in_loiter_it_sinks_for_want_of_a_transmitter_in_brake_it_stands(standing):
    standing.fly(4.0, 5.0)
    standing.air.set_mode(BRAKE)
    standing.air.run(5.0)
    height_m = standing.motion.height_m
    assert abs(standing.motion.velocity_north_mps) < 0.05
    standing.air.set_mode(LOITER)
    standing.air.run(5.0)
    assert standing.motion.height_m < height_m - 4.0


def test_rtl_goes_home_at_its_height_and_lands_there(standing):
    standing.fly(6.0, 5.0)
    assert standing.air.set_mode(RTL) == ACCEPTED
    standing.air.run(30.0)
    assert standing.motion.north_m == pytest.approx(0.0, abs=0.6)
    standing.air.run(90.0)
    assert standing.motion.height_m == pytest.approx(0.0, abs=0.1)
    assert not standing.air.fleet.vehicles[0].pilot.condition.armed


def test_its_failsafe_sends_it_home_where_that_is_switched_on(standing):
    vehicle = standing.air.fleet.vehicles[0]
    beat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    standing.air.ground.send(beat)
    standing.air.run(7.0)
    assert standing.mode == GUIDED  # FS_GCS_ENABLE is 0
    standing.air.ground.send(mavlink.MAVLink_param_set_message(1, 1, b"FS_GCS_ENABLE", 1, 2))
    standing.air.ground.send(beat)
    standing.air.run(4.8)
    assert standing.mode == GUIDED
    standing.air.run(0.5)
    assert vehicle.pilot.mode == RTL
    standing.air.ground.send(beat)
    standing.air.run(0.1)
    assert vehicle.pilot.mode == RTL
    assert standing.air.set_mode(GUIDED) == ACCEPTED

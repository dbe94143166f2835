"""An emulated ArduCopter and pymavlink: acceptance, refusals and motion as measured on ArduCopter 4.7."""

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
ACRO, CIRCLE, DRIFT, GUIDED_NOGPS, SMART_RTL, ZIGZAG = 1, 7, 11, 20, 21, 24
CONDITION_YAW, CHANGE_SPEED, PAUSE, CHOOSE_ITEM, ROI, ROI_NONE = 115, 178, 193, 224, 195, 197
PATH = {"speed_mps": 5, "waypoints_m": [[0, 0, 30], [500, 0, 30]]}
VELOCITY_AND_YAW, VELOCITY_ALONE, VELOCITY_ONLY, HEIGHT_TOO = 0x9C7, 0x5C7, 0xDC7, 0x9C3
POSITION_ALONE = 0xDF8
MODEL = load_scenario({"vehicles": {"count": 1, "autopilot": "arducopter"}, "path": PATH}).vehicles[0].model


class Pilot:
    """Sends velocities to one emulated copter at 10 Hz."""

    def __init__(self, air):
        self.air = air

    def command(self, north, east=0.0, down=0.0, yaw=0.0, mask=VELOCITY_AND_YAW, target=1, rate=0.0):
        fields = (0, target, 1, 1, mask, 0, 0, -40.0, north, east, down, 0, 0, 0, yaw, rate)
        self.air.ground.send(mavlink.MAVLink_set_position_target_local_ned_message(*fields))

    def send_to(self, north_m, east_m, height_m):
        fields = (0, 1, 1, 1, POSITION_ALONE, north_m, east_m, -height_m, 0, 0, 0, 0, 0, 0, 0, 0)
        self.air.ground.send(mavlink.MAVLink_set_position_target_local_ned_message(*fields))

    def turned(self, seconds):
        """Return by how much the nose turns in a time, clockwise, degrees."""
        before = self.shown.heading_rad
        self.air.run(seconds)
        return math.degrees(math.remainder(self.shown.heading_rad - before, math.tau))

    def fly(self, seconds, *velocity, **keys):
        """Return the ground velocities (north, east) after each 0.02 s."""
        seen = []
        for _ in range(round(seconds * 10)):
            self.command(*velocity, **keys)
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
    """Return a copter that hovers in GUIDED."""
    copter = Pilot(make_air(model=MODEL))
    copter.air.run(8.0)
    return copter


@pytest.fixture
def grounded(make_air):
    air = make_air(model=MODEL, in_air=False)
    air.run(4.0)
    return air


def reached(speeds, share):
    """Return when a step has reached a share of its size, s."""
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
    """A step to a climb, and a step back to level flight."""
    for commanded in (climb_mps, 0.0):
        climbs = []
        for _ in range(25):
            standing.command(0.0, 0.0, -commanded)
            for _ in range(5):
                standing.air.run(0.02)
                climbs.append(standing.motion.climb_mps)
        assert reached(climbs, 0.63) == pytest.approx(t63_s, rel=0.15)
        assert reached(climbs, 0.9) == pytest.approx(t90_s, rel=0.15)


@pytest.mark.parametrize(("turn_rad", "t63_s", "t90_s"), [(math.pi / 2, 1.26, 1.65), (0.35, 0.6, 0.78)])
def test_steps_of_the_nose_take_as_long_as_measured(standing, turn_rad, t63_s, t90_s):
    standing.fly(5.0, 0.0)
    for commanded in (turn_rad, 0.0):
        noses = []
        for _ in range(30):
            standing.command(0.0, yaw=commanded)
            for _ in range(5):
                standing.air.run(0.02)
                noses.append(math.remainder(standing.shown.heading_rad, math.tau))
        assert reached(noses, 0.63) == pytest.approx(t63_s, rel=0.15)
        assert reached(noses, 0.9) == pytest.approx(t90_s, rel=0.15)


def test_it_flies_in_any_direction(standing):
    north, east = standing.fly(6.0, -1.0, 2.0)[-1]
    assert (north, east) == pytest.approx((-1.0, 2.0), abs=0.02)


def test_it_hovers_some_seconds_after_the_last_velocity_still_in_guided(standing):
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


def test_the_nose_turns_as_commanded_and_stays_where_it_is_not(standing):
    standing.fly(5.0, 1.0, yaw=math.pi / 2)
    assert standing.shown.heading_rad == pytest.approx(math.pi / 2, abs=0.05)
    standing.fly(4.0, -2.0, mask=VELOCITY_ALONE)
    assert standing.shown.heading_rad == pytest.approx(math.pi / 2, abs=0.05)
    standing.fly(8.0, -2.0, mask=VELOCITY_ONLY)
    assert abs(math.remainder(standing.shown.heading_rad - math.pi, math.tau)) < 0.05


def test_the_yaw_rate_it_tells_is_its_noses_whatever_its_course_does(standing):
    standing.fly(3, 1.0, 0.0)
    reported_rps, turned_rad, yaw_rad = [], 0.0, standing.shown.heading_rad
    for tick in range(40):
        if tick % 5 == 0:
            standing.command(-1.0, 0.02, yaw=0.3 if tick < 20 else 0.0)
        standing.air.run(0.02)
        reported_rps.append(standing.shown.copy().yaw_rate_radps)
        turned_rad += 0.02 * reported_rps[-1]
    assert turned_rad == pytest.approx(standing.shown.heading_rad - yaw_rad, abs=1e-9)
    assert 0.1 < max(map(abs, reported_rps)) < 1.2


def test_it_flies_no_faster_than_its_parameter(standing):
    assert standing.fly(12.0, 15.0)[-1][0] == pytest.approx(10.0, abs=0.05)


def test_the_airspeed_it_tells_is_its_speed(standing):
    standing.fly(6.0, 3.0, 0.0, -1.0)
    assert standing.shown.airspeed_mps == pytest.approx(math.hypot(3.0, 1.0), abs=0.1)


def test_a_change_of_wind_accelerates_it_by_its_drag_and_doesnt_carry_it_away(make_air):
    """In 1.5 s its drag would take it along, and its velocity loop of 0.5 s holds against that."""
    gust = StepDisturbance(at_s=0.0, velocity_mps=(2.0, 0.0, 0.0)), frozenset({VehicleId(1, 1)})
    copter = Pilot(make_air(model=MODEL, disturbances=(gust,)))
    copter.air.run(14.0)
    copter.air.send_mission_time(0.0)
    copter.air.run(0.1)
    assert copter.motion.velocity_north_mps == pytest.approx(2.0 * 0.1 / 1.5, abs=0.05)
    pushed = [copter.motion.velocity_north_mps for _ in range(10) if copter.air.run(0.2) is None]
    assert 0.3 < max(pushed) < 0.8
    copter.air.run(25.0)
    assert abs(copter.motion.velocity_north_mps) < 0.02


@pytest.mark.parametrize(("firmware", "reached_mps"), [("ardupilot", 10.7), ("px4", 9.7)])
def test_against_the_wind_it_is_no_faster_than_its_tilt_allows(make_air, firmware, reached_mps):
    """As ArduCopter's simulator was against 6 m/s, commanded 8: 5.7."""
    model = MODEL.model_copy(update={"firmware": firmware, "prompt_share": 1.0})
    body = make_air(model=model, wind_mps=(-6.0, 0.0, 0.0)).fleet.bodies[0]
    body.steering.airborne, body.steering.velocity_mps = True, (9.0, 0.0, 0.0)
    for _ in range(500):
        body.fly()
    assert body.velocity_mps[0] == pytest.approx(reached_mps - 6.0, abs=0.05)


def test_it_lifts_off_straight_up_in_any_wind_it_stood_in(make_air):
    gust = StepDisturbance(at_s=0.0, velocity_mps=(0.0, 8.0, 0.0)), frozenset({VehicleId(1, 1)})
    air = make_air(model=MODEL, in_air=False, disturbances=(gust,))
    air.send_mission_time(0.0)
    air.run(4.0)
    air.set_mode(GUIDED)
    air.command_long(ARM, 1)
    air.command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 20.0)
    air.run(14.0)
    assert air.state("height_m") == pytest.approx(20.0, abs=0.3)
    assert abs(air.state("east_m")) < 0.01


@pytest.mark.parametrize(
    ("params", "to_deg", "seconds"),
    [
        ((90, 30, 1, 0), 90, 6),
        ((45, 30, -1, 1), -45, 5),
        ((90, 0, 0, 0), 90, 4),
        ((90, 200, 0, 1), 90, 4),
        ((360, 20, 0, 0), 0, 4),
    ],
)
def test_condition_yaw_turns_the_nose_to_a_direction_or_by_an_angle(standing, params, to_deg, seconds):
    assert standing.air.command_long(CONDITION_YAW, *params) == ACCEPTED
    assert standing.turned(seconds) == pytest.approx(to_deg, abs=2.0)


def test_condition_yaw_turns_at_the_rate_and_the_way_round_that_it_says(standing):
    """From 0 to 90 degrees anticlockwise at 60 degrees/s a real one had turned by 166 degrees after 3 s."""
    assert standing.air.command_long(CONDITION_YAW, 90, 60, -1, 0) == ACCEPTED
    assert standing.turned(2.0) == pytest.approx(-105, abs=15)
    assert standing.turned(4.0) == pytest.approx(-165, abs=15)
    assert standing.air.command_long(CONDITION_YAW, 90, 10, 1, 1) == ACCEPTED
    for wrong in ((-10, 30, 1, 0), (400, 30, 1, 0), (10, 30, 1, 2), (math.nan, 30, 1, 0)):
        assert standing.air.command_long(CONDITION_YAW, *wrong) == FAILED
    assert standing.turned(3.5) == pytest.approx(34, abs=5)  # these didn't stop the turn


def test_in_other_modes_condition_yaw_is_accepted_and_has_no_effect(standing):
    standing.air.set_mode(BRAKE)
    assert standing.air.command_long(CONDITION_YAW, 45, 30, 0, 0) == ACCEPTED
    assert standing.turned(4.0) == pytest.approx(0.0, abs=0.1)


def test_a_position_has_the_nose_turn_to_it_again(standing):
    standing.air.command_long(CONDITION_YAW, 90, 0, 0, 0)
    standing.air.run(4.0)
    standing.send_to(standing.motion.north_m + 30.0, 0.0, 100.0)
    assert standing.turned(5.0) == pytest.approx(-90.0, abs=2.0)


def test_a_yaw_rate_turns_the_nose_until_it_is_too_old(standing):
    """A real one at 0.3 rad/s turned by 64 degrees in 4 s, by 54 more in 3 s without setpoints, and stopped."""
    before = standing.shown.heading_rad
    standing.fly(4.0, 0.0, mask=VELOCITY_ALONE, rate=0.3)
    assert math.degrees(standing.shown.heading_rad - before) == pytest.approx(64.0, abs=5.0)
    assert standing.turned(3.5) == pytest.approx(54.0, abs=6.0)
    assert standing.turned(3.0) == pytest.approx(0.0, abs=2.0)


def test_a_velocity_of_0_leaves_the_nose_where_it_points(standing):
    standing.air.command_long(CONDITION_YAW, 90, 0, 0, 0)
    standing.air.run(4.0)
    before = standing.shown.heading_rad
    standing.fly(3.0, 0.0, 0.0, -0.3, mask=VELOCITY_ONLY)
    assert standing.shown.heading_rad == pytest.approx(before, abs=0.02)


@pytest.mark.parametrize("kind", [0, 1])
def test_speeds_hold_for_positions_under_way_and_the_next(standing, kind):
    standing.send_to(200.0, 0.0, 100.0)
    standing.air.run(5.0)
    assert standing.air.command_long(CHANGE_SPEED, kind, 3, -1) == ACCEPTED
    standing.air.run(5.0)
    assert standing.motion.velocity_north_mps == pytest.approx(3.0, abs=0.1)
    standing.send_to(300.0, 0.0, 100.0)
    standing.air.run(4.0)
    assert standing.motion.velocity_north_mps == pytest.approx(3.0, abs=0.1)
    assert standing.fly(8.0, 5.0)[-1][0] == pytest.approx(5.0, abs=0.1)
    standing.send_to(400.0, 0.0, 100.0)
    standing.air.run(6.0)
    assert standing.motion.velocity_north_mps > 8.0


def test_speeds_that_are_none_are_denied_and_other_modes_fail(standing):
    for params, result in (
        ((1, 0), DENIED),
        ((1, -2), DENIED),
        ((2, 1), ACCEPTED),
        ((3, 1), ACCEPTED),
        ((5, 3), FAILED),
    ):
        assert standing.air.command_long(CHANGE_SPEED, *params) == result
    standing.air.set_mode(BRAKE)
    assert standing.air.command_long(CHANGE_SPEED, 1, 3) == FAILED


def test_paused_it_hovers_and_then_goes_on_to_the_newest_position(standing):
    begin_m = standing.motion.north_m
    standing.send_to(begin_m + 60.0, 0.0, 100.0)
    standing.air.run(4.0)
    assert standing.air.command_long(PAUSE, 0) == ACCEPTED
    standing.send_to(begin_m + 90.0, 0.0, 100.0)
    standing.air.run(5.0)
    assert abs(standing.motion.velocity_north_mps) < 0.1
    assert standing.air.command_long(PAUSE, 2) == DENIED
    assert standing.air.command_long(PAUSE, 1) == ACCEPTED
    standing.air.run(20.0)
    assert standing.motion.north_m == pytest.approx(begin_m + 90.0, abs=0.5)


def test_other_modes_arent_paused(standing):
    standing.air.set_mode(BRAKE)
    for goes_on, text in ((0, "Failed to pause"), (1, "Failed to resume")):
        assert standing.air.command_long(PAUSE, goes_on) == FAILED
        assert standing.air.ground.of("STATUSTEXT")[-1].text == text


def test_its_nose_follows_a_position_of_interest(standing):
    home = {"x": 350000000, "y": 1250000000}
    standing.send_to(0.0, 60.0, 100.0)
    standing.air.run(15.0)
    assert standing.air.command_int(ROI, frame=6, **home) == ACCEPTED
    standing.air.run(5.0)
    assert abs(math.remainder(standing.shown.heading_rad + math.pi / 2, math.tau)) < 0.05
    assert standing.air.command_long(ROI_NONE) == ACCEPTED


def test_without_a_mission_no_item_can_be_chosen(standing):
    assert [standing.air.command_long(CHOOSE_ITEM, number) for number in (0, 5, -1)] == [FAILED, DENIED, DENIED]


@pytest.mark.parametrize("command", [43000, 43001, 43002, 192, 12345])
def test_what_planes_are_commanded_is_unsupported(standing, command):
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


def test_with_a_delay_of_0_it_never_disarms_by_itself(grounded):
    grounded.ground.send(grounded.ground.dialect.param_set_encode(1, 1, b"DISARM_DELAY", 0, 2))
    grounded.set_mode(GUIDED)
    grounded.command_long(ARM, 1)
    grounded.run(30.0)
    assert grounded.fleet.vehicles[0].pilot.condition.armed


def test_unasked_it_sends_heartbeats_alone(grounded):
    telemetry = {each.get_type() for _, each in grounded.ground.received} - {"HEARTBEAT", "STATUSTEXT", "TIMESYNC"}
    assert telemetry == set()
    assert grounded.command_long(INTERVAL, 33, 100_000) == ACCEPTED
    grounded.run(1.0)
    assert len(grounded.ground.of("GLOBAL_POSITION_INT")) == pytest.approx(10, abs=1)


@pytest.mark.parametrize("mode", [AUTO, 99, 15])
def test_modes_that_it_hasnt_are_refused(standing, mode):
    assert standing.air.set_mode(mode) == FAILED
    assert standing.mode == GUIDED


@pytest.mark.parametrize(
    ("mode", "flags"), [(ACRO, 209), (CIRCLE, 217), (DRIFT, 209), (GUIDED_NOGPS, 209), (ZIGZAG, 217)]
)
def test_modes_that_a_client_may_choose_are_taken(standing, mode, flags):
    assert standing.air.set_mode(mode) == ACCEPTED
    beat = standing.air.ground.of("HEARTBEAT")[-1]
    assert (beat.custom_mode, beat.base_mode) == (mode, flags)


def test_in_circle_it_flies_round_a_position_ahead_of_it_clockwise_and_sinks(standing):
    here = standing.motion.north_m, standing.motion.east_m, standing.motion.height_m
    standing.air.set_mode(CIRCLE)
    standing.air.run(13.5)  # three quarters of a turn at 20 degrees/s
    centre_m = here[0] + 10.0
    assert math.hypot(standing.motion.north_m - centre_m, standing.motion.east_m - here[1]) == pytest.approx(
        10, abs=1.5
    )
    assert standing.motion.height_m < here[2] - 25.0
    to_centre_rad = math.atan2(here[1] - standing.motion.east_m, centre_m - standing.motion.north_m)
    assert abs(math.remainder(standing.shown.heading_rad - to_centre_rad, math.tau)) < 0.3
    assert standing.motion.turn_rate_radps > 0.0


def test_a_distance_of_30_m_is_flown_as_fast_as_measured(standing):
    """A real one flew it at up to 6.6 m/s, and stopped after 9 s, 0.7 m beyond its end at most."""
    begin_m, speeds = standing.motion.north_m, []
    standing.send_to(begin_m + 30.0, 0.0, 100.0)
    for _ in range(500):
        standing.air.run(0.02)
        speeds.append(standing.motion.velocity_north_mps)
    assert max(speeds) == pytest.approx(6.6, rel=0.05)
    assert abs(speeds[-50]) < 0.3
    assert standing.motion.north_m == pytest.approx(begin_m + 30.0, abs=0.2)


def test_a_mission_isnt_begun(standing):
    assert standing.air.command_long(300) == FAILED


def test_in_loiter_it_sinks_for_want_of_a_transmitter_in_brake_it_hovers(standing):
    standing.fly(4.0, 5.0)
    standing.air.set_mode(BRAKE)
    standing.air.run(5.0)
    height_m = standing.motion.height_m
    assert abs(standing.motion.velocity_north_mps) < 0.05
    standing.air.set_mode(LOITER)
    standing.air.run(5.0)
    assert standing.motion.climb_mps == pytest.approx(-2.5, abs=0.05)
    assert standing.motion.height_m < height_m - 8.0


@pytest.mark.parametrize(("mode", "waits_s"), [(RTL, 5.0), (SMART_RTL, 0.0)])
def test_it_goes_home_at_its_height_waits_and_lands_there(standing, mode, waits_s):
    standing.fly(6.0, 5.0)
    assert standing.air.set_mode(mode) == ACCEPTED
    vehicle = standing.air.fleet.vehicles[0]
    standing.air.run_until(lambda: abs(standing.motion.north_m) < 0.5, 60.0)
    over_s, height_m = standing.air.seconds, standing.motion.height_m
    standing.air.run_until(lambda: vehicle.pilot.landed_state == mavlink.MAV_LANDED_STATE_LANDING, 60.0)
    assert standing.air.seconds - over_s == pytest.approx(waits_s, abs=0.1)
    assert standing.motion.height_m == pytest.approx(height_m, abs=0.1)
    standing.air.run_until(lambda: not vehicle.pilot.airborne, 150.0)
    landed_s = standing.air.seconds
    standing.air.run_until(lambda: not vehicle.pilot.condition.armed, 150.0)
    assert standing.air.seconds - landed_s == pytest.approx(2.0, abs=0.05)
    assert standing.motion.height_m == pytest.approx(0.0, abs=0.1)


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

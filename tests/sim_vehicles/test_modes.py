"""The table of vehicle states, and flights through the modes."""

import math

import pytest

from sim_vehicles.autopilot.modes_and_failsafe import (
    SELECTABLE,
    TRANSITIONS,
    Condition,
    Mode,
    Request,
    select,
    system_status,
)

ARM, SET_MODE = 400, 176
TAKEOFF, GUIDED, LOITER, RTL, MANUAL = 13, 15, 12, 11, 0
HEADING, SPEED, ALTITUDE = 43002, 43000, 43001


def test_nothing_leads_out_of_a_crash():
    assert not [key for key in TRANSITIONS if key[0] is Condition.CRASHED]


def test_only_force_or_a_fault_disarms_in_flight():
    left = {request for (condition, request), after in TRANSITIONS.items() if condition.armed and not after.armed}
    assert left == {Request.DISARM, Request.FORCE_DISARM, Request.RESTART, Request.CRASH}
    assert (Condition.FLYING, Request.DISARM) not in TRANSITIONS


def test_the_air_is_reached_by_take_off_alone():
    into = {(c, r) for (c, r), after in TRANSITIONS.items() if after is Condition.FLYING and c is not Condition.FLYING}
    assert into == {(Condition.ARMED, Request.LIFT_OFF), (Condition.BOOTING_IN_AIR, Request.BOOTED)}


@pytest.mark.parametrize("condition", Condition)
def test_every_condition_can_be_reached_and_is_reported_as_a_state(condition):
    starts = {Condition.BOOTING, Condition.BOOTING_IN_AIR}
    assert condition in starts | set(TRANSITIONS.values())
    assert system_status(condition) in {2, 3, 4}


@pytest.mark.parametrize("condition", [Condition.BOOTING, Condition.BOOTING_IN_AIR])
def test_no_mode_is_taken_while_booting(condition):
    assert all(select(condition, mode) is None for mode in Mode)


def test_initialising_can_not_be_asked_for():
    assert Mode.INITIALISING not in SELECTABLE


def test_boot_shows_initialising_then_manual(make_air):
    air = make_air(in_air=False)
    air.run(5.0)
    beats = air.ground.of("HEARTBEAT")
    modes = [beat.custom_mode for beat in beats]
    assert modes[0] == 16
    assert modes[-1] == MANUAL
    assert [beat.system_status for beat in beats][-1] == 3
    assert {(beat.type, beat.autopilot) for beat in beats} == {(1, 3)}


def test_pre_arm_bit_and_estimator_flags_come_together(make_air):
    air = make_air(in_air=False)
    air.run(6.0)
    healthy = [bool(status.onboard_control_sensors_health & 0x10000000) for status in air.ground.of("SYS_STATUS")]
    ready = [report.flags & 831 == 831 for report in air.ground.of("EKF_STATUS_REPORT")]
    assert healthy == ready == sorted(ready)
    assert (ready[0], ready[-1]) == (False, True)


def test_take_off_passes_45_m_and_levels_at_50_m(parked):
    assert parked.set_mode(TAKEOFF) == 0
    assert parked.command_long(ARM, 1) == 0
    assert parked.ground.of("HEARTBEAT")[-1].system_status == 3
    parked.run_until(lambda: parked.state("height_m") > 45.0, limit_s=60.0)
    assert parked.ground.of("HEARTBEAT")[-1].system_status == 4
    parked.run(60.0)
    assert parked.state("height_m") == pytest.approx(50.0, abs=0.1)
    assert parked.state("airspeed_mps") == pytest.approx(22.0, abs=0.01)
    assert math.hypot(parked.state("north_m"), parked.state("east_m")) < 1000.0


def test_an_armed_vehicle_in_guided_stays_on_the_ground(parked):
    assert parked.set_mode(GUIDED) == 0
    assert parked.command_long(ARM, 1) == 0
    parked.command_int(SPEED, 0, 25.0)
    parked.command_int(ALTITUDE, z=100.0)
    parked.command_int(HEADING, 1, 90.0, 5.0)
    parked.run(20.0)
    assert [parked.state(name) for name in ("north_m", "east_m", "height_m", "airspeed_mps")] == [0.0] * 4


def test_wind_does_not_move_a_parked_vehicle(make_air):
    air = make_air(in_air=False, wind_mps=(5.0, 8.0, 0.0))
    air.run(10.0)
    assert (air.state("north_m"), air.state("east_m")) == (0.0, 0.0)
    assert air.ground.of("GLOBAL_POSITION_INT")[-1].vy == 0


@pytest.mark.parametrize(("mode", "height_m"), [(LOITER, 100.0), (GUIDED, 100.0), (RTL, 100.0)])
def test_it_circles_until_it_is_commanded_otherwise(flying, mode, height_m):
    flying.set_mode(MANUAL)
    flying.run(20.0)
    flying.set_mode(mode)
    entry = (0.0, 0.0) if mode == RTL else (flying.state("north_m"), flying.state("east_m"))
    flying.run(120.0)
    for _ in range(20):
        flying.run(2.0)
        distance = math.hypot(flying.state("north_m") - entry[0], flying.state("east_m") - entry[1])
        assert distance == pytest.approx(1.3 * 22 / 0.25, rel=0.05)
        assert flying.state("height_m") == pytest.approx(height_m, abs=0.1)


def test_re_entering_guided_clears_the_setpoints(flying):
    flying.command_int(HEADING, 1, 90.0, 5.0)
    flying.command_int(SPEED, 0, 27.0)
    flying.set_mode(LOITER)
    flying.set_mode(GUIDED)
    flying.run(60.0)
    assert flying.state("airspeed_mps") == pytest.approx(22.0, abs=0.01)
    assert abs(flying.fleet.bodies[0].turn_rate_radps) > 0.1


def test_when_setpoints_stop_it_flies_on(flying):
    flying.command_int(HEADING, 1, 45.0, 10.0)
    flying.command_int(SPEED, 0, 24.0)
    flying.command_int(ALTITUDE, z=110.0)
    flying.run(60.0)
    for _ in range(5):
        flying.run(30.0)
        assert math.degrees(flying.state("heading_rad")) == pytest.approx(45.0, abs=1e-6)
        assert flying.state("airspeed_mps") == pytest.approx(24.0, abs=1e-6)
        assert flying.state("height_m") == pytest.approx(110.0, abs=1e-6)


def test_a_heading_without_lateral_acceleration_hardly_turns(flying):
    flying.command_int(HEADING, 1, 90.0, 0.0)
    before = flying.state("heading_rad")
    flying.run(20.0)
    assert flying.state("heading_rad") - before == pytest.approx(20 * 0.05 / 22, rel=1e-3)


def test_lateral_acceleration_bounds_the_turn(flying):
    flying.command_int(HEADING, 1, 170.0, 2.2)
    flying.run(5.0)
    before = flying.state("heading_rad")
    flying.run(5.0)
    assert flying.state("heading_rad") - before == pytest.approx(5 * 2.2 / 22, rel=1e-6)


def test_course_mode_holds_the_course_in_a_crosswind_and_heading_mode_drifts(make_air):
    courses = {}
    for kind in (0, 1):
        air = make_air(wind_mps=(-8.0, 0.0, 0.0))
        air.run(5.0)
        air.set_mode(GUIDED)
        air.command_int(HEADING, kind, 90.0, 10.0)
        air.run(60.0)
        position = air.ground.of("GLOBAL_POSITION_INT")[-1]
        courses[kind] = math.degrees(math.atan2(position.vy, position.vx))
    assert courses[0] == pytest.approx(90.0, abs=0.05)
    assert courses[1] == pytest.approx(90 + math.degrees(math.atan2(8, 22)), abs=0.05)


def test_heights_above_sea_level_and_above_home_differ_by_the_field(make_air):
    for frame, z in ((0, 350.0), (3, 150.0)):
        air = make_air(origin_alt_m=200.0)
        air.run(5.0)
        air.set_mode(GUIDED)
        assert air.command_int(ALTITUDE, frame=frame, z=z) == 0
        air.run(90.0)
        position = air.ground.of("GLOBAL_POSITION_INT")[-1]
        assert position.alt == pytest.approx(350_000, abs=2)
        assert position.relative_alt == pytest.approx(150_000, abs=2)

"""Wind, disturbances and faults by mission time, which the ground station sends."""

import math
from typing import Any

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from formation_scenario.surroundings import DrydenTurbulence, Fault, RampDisturbance, SineDisturbance, StepDisturbance

FIRST, SECOND = VehicleId(1, 1), VehicleId(1, 2)
HEADING, GUIDED = 43002, 15
NORTH = (0.6, 0.0, 0.0)
FROM_1_S: dict[str, Any] = {"at_s": 1.0, "velocity_mps": NORTH}


def velocity(air, vehicle=0):
    state = air.fleet.bodies[vehicle].state
    return state.wind_north_mps, state.wind_east_mps


def received_from(air, system, seconds):
    before = len(air.ground.received)
    air.run(seconds)
    return [message for _, message in air.ground.received[before:] if message.get_srcSystem() == system]


def disturbed(make_air, *disturbances, count=2):
    return make_air(count, disturbances=disturbances)


def test_a_disturbance_strikes_at_its_mission_time_and_whom_it_names(make_air):
    air = disturbed(make_air, (StepDisturbance(at_s=10.0, velocity_mps=(0.6, -0.4, 0.0)), frozenset({SECOND})))
    air.run(5.0)
    air.send_mission_time(0.0)
    air.run(9.9)
    assert velocity(air, 1) == (0.0, 0.0)
    air.run(0.2)
    assert velocity(air, 1) == (0.6, -0.4)
    assert velocity(air, 0) == (0.0, 0.0)


def test_disturbances_add_up_with_the_wind(make_air):
    both = frozenset({FIRST, SECOND})
    air = make_air(
        2,
        wind_mps=(1.0, 2.0, 0.0),
        disturbances=(
            (StepDisturbance(at_s=1.0, velocity_mps=(0.5, 0.0, 0.0)), both),
            (StepDisturbance(at_s=2.0, velocity_mps=(0.0, 0.25, 0.0)), both),
        ),
    )
    air.send_mission_time(0.0)
    air.run(3.0)
    assert velocity(air) == (1.5, 2.25)


def over_time(air, seconds):
    """Return the first vehicle's northward velocity by wind and disturbances at mission times 1 s, 2 s and so on."""
    air.send_mission_time(0.0)
    air.run(0.02)
    velocities = []
    for _ in range(seconds):
        air.run(1.0)
        velocities.append(velocity(air)[0])
    return velocities


@pytest.mark.parametrize(
    ("disturbance", "expected"),
    [
        (StepDisturbance(at_s=2.0, until_s=4.0, velocity_mps=NORTH), [0, 0.6, 0.6, 0, 0, 0]),
        (
            RampDisturbance(kind="ramp", at_s=1.0, until_s=5.0, velocity_mps=NORTH, duration_s=2.0),
            [0, 0.3, 0.6, 0.6, 0, 0],
        ),
        (SineDisturbance(kind="sine", period_s=4.0, **FROM_1_S), [0, 0.6, 0, -0.6, 0, 0.6]),
        (
            SineDisturbance(kind="sine", at_s=1.0, until_s=4.5, velocity_mps=NORTH, period_s=4.0, phase_deg=90.0),
            [0.6, 0, -0.6, 0, 0, 0],
        ),
    ],
)
def test_disturbances_go_on_in_time_as_their_kind_says_and_end(make_air, disturbance, expected):
    assert over_time(disturbed(make_air, (disturbance, frozenset({FIRST}))), 6) == pytest.approx(expected, abs=1e-6)


def test_a_vehicle_s_turbulence_does_not_depend_on_who_else_meets_it(make_air):
    gusts = DrydenTurbulence(kind="dryden", at_s=0.0, sigma_mps=(1.0, 1.0, 1.0), length_m=(50.0, 50.0, 50.0))
    alone, together = (over_time(disturbed(make_air, (gusts, frozenset(who))), 5) for who in ({FIRST}, {SECOND, FIRST}))
    assert alone == together
    assert np.std(alone) > 0


def test_nothing_happens_before_the_mission_time_is_reported(make_air):
    air = disturbed(make_air, (StepDisturbance(at_s=0.0, velocity_mps=(5.0, 0.0, 0.0)), frozenset({FIRST})))
    air.run(30.0)
    air.send_mission_time(-3.0)
    air.run(30.0)
    assert velocity(air) == (0.0, 0.0)


def test_the_first_mission_time_that_is_not_negative_counts_any_that_receives_it(make_air):
    air = disturbed(make_air, (StepDisturbance(at_s=10.0, velocity_mps=(1.0, 0.0, 0.0)), frozenset({FIRST})))
    air.send_mission_time(-1.0)
    air.run(1.0)
    air.send_mission_time(4.0, vehicle=1)
    air.run(1.0)
    air.send_mission_time(0.0)
    air.run(4.9)
    assert velocity(air) == (0.0, 0.0)
    air.run(0.2)
    assert velocity(air) == (1.0, 0.0)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_mission_time_that_is_no_number_is_ignored(make_air, value):
    air = disturbed(make_air, (StepDisturbance(at_s=0.0, velocity_mps=(1.0, 0.0, 0.0)), frozenset({FIRST})))
    air.send_mission_time(value)
    air.run(5.0)
    assert air.fleet.environment.mission_zero is None


def test_a_disturbance_shows_in_the_reported_velocity_and_carries_the_vehicle(make_air):
    air = disturbed(make_air, (StepDisturbance(at_s=0.0, velocity_mps=(0.6, 0.6, 0.0)), frozenset({FIRST})))
    air.run(2.0)
    assert air.set_mode(GUIDED) == 0
    air.command_int(HEADING, 1, 0.0, 10.0)
    before = air.state("east_m")
    air.send_mission_time(0.0)
    air.run(10.0)
    assert air.state("east_m") - before == pytest.approx(6.0, abs=0.02)
    reported = air.ground.of("GLOBAL_POSITION_INT", system=1)[-1]
    assert (reported.vx, reported.vy) == (2260, 60)


def test_a_crashed_vehicle_falls_silent_to_the_ground_and_the_others_fly_on(make_air):
    air = make_air(2, faults=((Fault(at_s=5.0, kind="crash"), frozenset({FIRST})),))
    air.send_mission_time(0.0)
    air.run(6.0)
    assert received_from(air, 1, 5.0) == []
    assert [air.state(name) for name in ("height_m", "airspeed_mps", "climb_mps")] == [0.0, 0.0, 0.0]
    assert received_from(air, 2, 5.0)
    assert air.state("height_m", 1) == pytest.approx(100.0)


def test_a_frozen_vehicle_is_deaf_and_dumb_and_flies_on_as_it_was_reported(make_air):
    air = make_air(2, faults=((Fault(at_s=60.0, kind="freeze"), frozenset({FIRST})),))
    air.run(3.0)
    air.set_mode(GUIDED)
    air.command_int(HEADING, 1, 90.0, 10.0)
    air.send_mission_time(59.0)
    air.run(30.0)
    assert air.command_int(HEADING, 1, 180.0, 10.0) is None
    assert received_from(air, 1, 10.0) == []
    assert math.degrees(air.state("heading_rad")) == pytest.approx(90.0, abs=1e-3)
    assert air.state("airspeed_mps") == pytest.approx(22.0)


def test_a_restarted_vehicle_boots_in_the_air_and_has_forgotten_its_setpoints(make_air):
    air = make_air(1, faults=((Fault(at_s=60.0, kind="restart"), frozenset({FIRST})),))
    air.run(3.0)
    air.set_mode(GUIDED)
    air.command_int(HEADING, 1, 90.0, 10.0)
    air.command_long(511, 30, 20_000)
    air.run(30.0)
    air.send_mission_time(60.0)
    air.run(0.1)
    restarted = air.seconds
    assert air.ground.of("HEARTBEAT")[-1].custom_mode == 16
    before = len(air.ground.of("ATTITUDE"))
    air.run(9.4)
    assert air.ground.of("HEARTBEAT")[-1].custom_mode == 0
    assert len(air.ground.of("ATTITUDE")) - before <= 10
    assert air.ground.of("ATTITUDE")[-1].time_boot_ms / 1e3 <= air.seconds - restarted + 0.1
    assert air.command_int(HEADING, 1, 45.0, 10.0) == 4
    assert air.set_mode(GUIDED) == 0
    assert air.command_int(HEADING, 1, 45.0, 10.0) == 0

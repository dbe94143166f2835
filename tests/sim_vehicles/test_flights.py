"""Transitions in which an earlier state might linger: headings and circles, crashes and restarts, wind."""

import math

import pytest

from airlink.endpoint import VehicleId
from formation_scenario.surroundings import Fault

FIRST = frozenset({VehicleId(1, 1)})
HEADING, REPOSITION, ARM = 43002, 192, 400
AUTO, RTL, TAKEOFF = 10, 11, 13


@pytest.mark.parametrize("following", ["cancel", "reposition"])
def test_a_gentle_heading_does_not_widen_the_circle_after_it(flying, following):
    assert flying.command_int(HEADING, 1, 0.0, 0.0) == 0
    if following == "cancel":
        assert flying.command_int(HEADING, 2) == 0
    else:
        assert flying.command_int(REPOSITION, -1, 1, x=round(35e7), y=round(125e7), z=100.0) == 0
    flying.run(200.0)
    assert math.hypot(flying.state("north_m"), flying.state("east_m")) < 150.0


def test_auto_without_a_mission_is_reported_as_return_to_launch(flying):
    assert flying.set_mode(AUTO) == 0
    assert flying.ground.of("HEARTBEAT")[-1].custom_mode == RTL


def test_a_take_off_run_is_not_blown_aside(make_air):
    air = make_air(in_air=False, wind_mps=(0.0, 8.0, 0.0))
    air.run(4.0)
    air.set_mode(TAKEOFF)
    assert air.command_long(ARM, 1) == 0
    air.run(4.0)
    assert (air.state("height_m"), air.state("east_m")) == (0.0, 0.0)
    assert air.state("north_m") > 5.0


def test_a_crash_of_the_only_vehicle_grounds_it(make_air):
    air = make_air(faults=((Fault(at_s=1.0, kind="crash"), FIRST),))
    air.send_mission_time(0.0)
    air.run(3.0)
    assert (air.state("height_m"), air.state("airspeed_mps")) == (0.0, 0.0)


def test_disarming_by_force_in_flight_is_a_crash(flying):
    assert flying.command_long(ARM, 0, 21196) == 0
    flying.run(1.0)
    assert (flying.state("height_m"), flying.state("airspeed_mps")) == (0.0, 0.0)


def test_a_frozen_vehicle_speaks_again_after_a_restart(make_air):
    air = make_air(faults=((Fault(at_s=1.0, kind="freeze"), FIRST), (Fault(at_s=2.0, kind="restart"), FIRST)))
    air.send_mission_time(0.0)
    air.run(3.0)
    before = len(air.ground.received)
    air.run(3.0)
    assert len(air.ground.received) > before

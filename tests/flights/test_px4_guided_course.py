"""PX4 fixed wings in Guided Course: they follow by three commands, and a pilot's Hold takes over as any mode does."""

from typing import Any

import pytest

from airlink import mavlink as m
from airlink.messages.command import CommandInt, CommandLong
from flight_model.autopilot_model import FlightState, Setpoint
from flight_model.earth import GeodeticOrigin
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.vehicle.families.px4.guided_course import GUIDED_COURSE, Px4Course
from gcs_formation.vehicle.vehicle import Member
from sim_vehicles.autopilot.commands import ACCEPTED, DENIED, received
from sim_vehicles.autopilot.modes_and_failsafe import Px4Mode
from tests.flights.in_memory import World

KEYS: dict[str, Any] = {
    "vehicles": {"count": 2, "model": {"firmware": "px4"}, "px4_guided": "course"},
    "formation": {"shape": "line", "spacing_m": 40},
}
SPEED, COURSE, ALTITUDE = m.MAV_CMD_DO_CHANGE_SPEED, m.MAV_CMD_GUIDED_CHANGE_HEADING, m.MAV_CMD_DO_CHANGE_ALTITUDE


def members(world: World) -> list[Member]:
    return [each.member for each in world.station.vehicles.values()]


def test_they_follow_in_guided_course_and_hold_is_a_pilots_choice_that_is_given_back() -> None:
    world = World(**KEYS)
    world.run(9.0)
    assert [each.mode for each in world.fleet.vehicles] == [Px4Mode.GUIDED_COURSE] * 2
    assert world.worst_m(2.0) < 0.3
    world.vehicle(2).take_over("HOLD")
    world.run(2.0)
    assert members(world) == [Member.FLYING, Member.PARTED]
    assert world.vehicle(2).mode is Px4Mode.HOLD
    world.vehicle(2).take_over(None)
    world.run(2.5)
    assert members(world) == [Member.FLYING, Member.FLYING]


def test_a_setpoint_is_a_command_each_of_airspeed_altitude_above_the_sea_and_course_in_the_wind() -> None:
    """An airspeed of 20 m/s east and a wind of 20 m/s from the south: the course is north-east."""
    autopilot = Px4Course(3, GeodeticOrigin(0.6, 2.1, 300.0), 0.25)
    where = FlightState(0.0, 0.0, 100.0, 0.0, 20.0, 1.5708, 20.0, 0.0)
    speed, altitude, course = autopilot.setpoint(Setpoint(20.0, 1.5707963, 120.0), where)
    assert [each.command for each in (speed, altitude, course)] == [SPEED, ALTITUDE, COURSE]
    assert (speed.param1, speed.param2, speed.param3) == (m.SPEED_TYPE_AIRSPEED, 20.0, -1.0)
    assert (altitude.param1, altitude.param2) == (420.0, m.MAV_FRAME_GLOBAL)
    assert (course.param1, course.param2) == (m.HEADING_TYPE_COURSE_OVER_GROUND, pytest.approx(45.0, abs=1e-3))
    held = CommandInt(3, 1, 5, SPEED)
    assert autopilot.changed(Setpoint(20.0, 1.5707963, 120.0), where, [held, held, None]) == [altitude]
    assert autopilot.mode_names[GUIDED_COURSE] == "GUIDED_COURSE"


def test_its_failsafe_is_asked_for_since_it_would_fly_on_for_ever() -> None:
    autopilot, path = Px4Course(3, GeodeticOrigin(0.6, 2.1, 0.0), 0.25), ((0.0, 0.0, 90.0), (900.0, 0.0, 90.0))
    check = autopilot.checks(VehicleModel(), PathPlan(waypoints_m=path))[0]
    assert check.names == ("NAV_DLL_ACT",)
    assert "flies its last course for ever" in check.allowed


def given(world: World, command: int, *params: float) -> int:
    vehicle = world.vehicle(2)
    result = vehicle.handlers[command](vehicle, received(CommandLong(2, 1, command, 0, *params)))
    return int(result)


def test_an_emulated_one_denies_courses_outside_the_mode_and_of_other_types() -> None:
    world = World(**KEYS)
    world.run(2.0)
    assert given(world, COURSE, 0.0, 90.0) == ACCEPTED
    assert given(world, COURSE, 1.0, 90.0) == DENIED
    assert given(world, COURSE, 0.0, float("nan")) == DENIED
    assert given(world, SPEED, 0.0, 0.0) == ACCEPTED
    assert world.vehicle(2).body.steering.speed_mps == world.vehicle(2).parameters["FW_AIRSPD_TRIM"]
    world.vehicle(2).switch(Px4Mode.HOLD)
    assert given(world, COURSE, 0.0, 90.0) == DENIED


def test_an_earlier_version_does_not_have_the_mode() -> None:
    world = World(vehicles={"count": 2, "model": {"firmware": "px4"}}, formation=KEYS["formation"])
    world.run(1.0)
    assert not world.vehicle(2).switch(Px4Mode.GUIDED_COURSE)
    assert world.vehicle(2).mode is Px4Mode.HOLD

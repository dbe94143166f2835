"""PX4 fixed wings in Guided Course: they follow by three commands, and a pilot's Hold takes over as any mode does."""

from dataclasses import replace
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.messages.command import CommandInt, CommandLong
from flight_model.earth import GeodeticOrigin
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.vehicle.families.px4.guided_course import GUIDED_COURSE, Px4Course
from gcs_formation.vehicle.member import Member
from sim_vehicles.autopilot.commands import ACCEPTED, DENIED, received
from sim_vehicles.autopilot.modes_and_failsafe import Px4Mode
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between, World

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


class Earlier(Between):
    """The vehicles' version is 1.17, which doesn't have the mode."""

    def __init__(self, fleet: Fleet) -> None:
        config = fleet.vehicles[0].fleet
        vehicles = tuple(replace(each, family="px4_plane") for each in config.vehicles)
        super().__init__(Fleet(replace(config, vehicles=vehicles)))


PATH = {"speed_mps": 22, "waypoints_m": [[0, 0, 60], [900, 0, 60]]}
GROUND: dict[str, Any] = {"start": {"in_air": False}, "path": PATH}


def test_on_the_ground_it_is_seen_whether_a_vehicle_has_the_mode() -> None:
    world = World(**KEYS | GROUND)
    world.run(9.0)
    assert [each.mode for each in world.fleet.vehicles] == [Px4Mode.TAKEOFF] * 2
    earlier = World(Earlier, **KEYS | GROUND)
    earlier.run(30.0)
    assert "set mode GUIDED_COURSE on the ground, which versions from 1.18 have" in str(
        earlier.station.phase_machine.failure
    )
    assert not any(each.pilot.condition.armed for each in earlier.between.fleet.vehicles)

"""The landing in an emulated fixed wing's mission: how it is read, and flown on MAV_CMD_DO_LAND_START."""

import importlib
import math
from dataclasses import replace

import pytest

from airlink import mavlink as m
from formation_scenario.landing import StoredLanding
from tests.sim_vehicles.conftest import Air, fleet_config
from tests.sim_vehicles.test_px4 import PLANE

dialect = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
ACCEPTED, FAILED = 0, 4
AUTO, MISSION, HOLD = 10, 0x04040000, 0x03040000
POSITION = StoredLanding(course_deg=90.0, touchdown_m=(800.0, 300.0), approach_m=200.0, height_m=40.0)


def air(landing, **keys):
    """Return a fixed wing in the air, 100 m up, flying north."""
    config = fleet_config(**keys)
    found = Air(replace(config, vehicles=tuple(replace(each, landing=landing) for each in config.vehicles)))
    found.run(0.2)
    return found


def commands(found):
    """Return the commands of the items, as the mission protocol tells them."""
    found.ground.send(dialect.MAVLink_mission_request_list_message(1, 1))
    found.run(0.1)
    count = found.ground.of("MISSION_COUNT")[-1].count
    for seq in range(count):
        found.ground.send(dialect.MAVLink_mission_request_int_message(1, 1, seq))
        found.run(0.1)
    return [each.command for each in found.ground.of("MISSION_ITEM_INT")]


@pytest.mark.parametrize(("keys", "home"), [({}, [16]), ({"model": PLANE}, [])])
def test_an_ardu_plane_tells_its_home_before_it_and_a_px4_none(keys, home):
    assert commands(air(POSITION, **keys)) == [*home, 189, 16, 16, 21]
    assert commands(air(None, **keys)) == home


def test_without_a_landing_an_ardu_plane_refuses_and_a_px4_says_so():
    plane, px4 = air(None), air(None, model=PLANE)
    assert plane.command_long(m.MAV_CMD_DO_LAND_START) == FAILED
    assert px4.command_long(m.MAV_CMD_DO_LAND_START) == ACCEPTED
    assert px4.fleet.vehicles[0].mode == HOLD


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keys", "mode", "after", "past_m"), [({}, AUTO, AUTO, 60.0), ({"model": PLANE}, MISSION, HOLD, 120.0)]
)
def test_it_lands_along_its_course_and_disarms(keys, mode, after, past_m):
    """A PX4 brakes with half a metre a second squared, from more than its least airspeed."""
    found = air(POSITION.model_copy(update={"approach_m": 500.0}), **keys)
    assert found.command_long(m.MAV_CMD_DO_LAND_START) == ACCEPTED
    assert found.fleet.vehicles[0].mode == mode
    found.run_until(lambda: found.state("height_m") == 0.0, limit_s=240.0)
    assert math.cos(found.state("heading_rad") - math.radians(90.0)) > math.cos(math.radians(5.0))
    found.run(60.0)
    assert math.hypot(found.state("north_m") - 800.0, found.state("east_m") - 300.0) < past_m
    beat = found.ground.of("HEARTBEAT")[-1]
    assert (found.fleet.vehicles[0].mode, beat.base_mode & 128) == (after, 0)

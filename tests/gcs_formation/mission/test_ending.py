"""The plain ending, in which vehicles circle where they are: that of a station without another."""

from __future__ import annotations

import pytest

from airlink.clock import Instant
from gcs_formation.mission.ending import Endings
from gcs_formation.phases import Phase
from sim_vehicles.autopilot.modes_and_failsafe import Mode
from tests.flights.in_memory import World


@pytest.fixture
def world() -> World:
    world = World(vehicles={"count": 2}, start={"in_air": True, "run_in_s": 1}, finish={"loiter_s": 0})
    world.station.phase_machine.endings = Endings(world.station.vehicles)
    world.run(2.0)
    return world


def test_vehicles_circle_at_once_at_the_heights_that_they_have(world: World) -> None:
    heights_m = [body.state.height_m for body in world.fleet.bodies]
    world.station.phase_machine.stop(world.clock.now())
    world.run()
    assert world.station.flight.phase is Phase.DONE
    assert [each.pilot.mode for each in world.fleet.vehicles] == [Mode.LOITER] * 2
    assert [body.state.height_m for body in world.fleet.bodies] == pytest.approx(heights_m, abs=2.0)


def test_another_end_is_refused_and_haste_changes_nothing(world: World) -> None:
    assert world.station.phase_machine.end_by_order("land", world.clock.now()) == "found land; allowed: loiter"
    world.station.phase_machine.stop(world.clock.now())
    assert not world.station.phase_machine.go_home_at_once(Instant(world.clock.now() + 1))

"""Orders to end the flight, in other phases than the flight along the path."""

from __future__ import annotations

from typing import Any

import pytest

from formation_scenario.orders import Answer, End
from gcs_formation.phases import Phase
from sim_vehicles.autopilot.modes_and_failsafe import Condition, FlightMode, Mode
from tests.flights.in_memory import World

ABREAST: dict[str, Any] = {
    "start": {"in_air": False},
    "formation": {"shape": "line", "spacing_m": 40},
    "duration_s": 20,
}
"""At 40 m beside each other, vehicles on the ground are out of each other's landing paths."""


def order(world: World, text: str) -> Answer:
    return world.station.orders.execute(text, world.clock.now())


def modes(world: World) -> list[FlightMode]:
    return [vehicle.pilot.mode for vehicle in world.fleet.vehicles]


@pytest.mark.parametrize(("at_s", "manner"), [(0.5, "land"), (8.0, "rtl")])
def test_before_any_has_taken_off_all_stay_down_disarmed(at_s: float, manner: End) -> None:
    world = World(**ABREAST)
    world.run(at_s)
    assert order(world, manner).accepted
    world.run()
    assert world.station.flight.phase is Phase.DONE
    assert {vehicle.pilot.condition for vehicle in world.fleet.vehicles} == {Condition.DISARMED}
    assert max(body.state.height_m for body in world.fleet.bodies) == 0.0


def test_who_climbs_out_does_so_first_and_the_last_order_counts() -> None:
    world = World(**ABREAST)
    world.run(20.0)
    assert world.station.flight.phase is Phase.CONNECTING
    assert order(world, "loiter").accepted
    world.run(1.0)
    assert set(modes(world)) == {Mode.TAKEOFF}
    assert order(world, "rtl").accepted
    world.run()
    assert set(modes(world)) == {Mode.RTL}
    assert world.station.flight.phase is Phase.DONE
    assert world.station.phase_machine.cut_short


@pytest.mark.slow
def test_who_climbs_out_lands_afterwards() -> None:
    world = World(**ABREAST)
    world.run(12.0)
    assert order(world, "land").accepted
    world.run()
    assert world.station.flight.phase is Phase.DONE
    assert {vehicle.pilot.condition for vehicle in world.fleet.vehicles} == {Condition.DISARMED}


@pytest.mark.slow
def test_one_that_is_landing_when_another_order_comes_lands_and_the_others_do_as_ordered() -> None:
    world = World(**ABREAST)
    world.run(40.0)
    assert order(world, "land").accepted
    while Mode.AUTOLAND not in modes(world):
        world.run(1.0)
    landing = modes(world).index(Mode.AUTOLAND)
    assert order(world, "loiter").accepted
    world.run()
    assert world.station.flight.phase is Phase.DONE
    assert world.fleet.vehicles[landing].pilot.condition is Condition.DISARMED
    assert modes(world).count(Mode.LOITER) == 2


def test_an_order_after_the_path_is_flown_does_not_make_the_flight_one_that_was_cut_short() -> None:
    world = World(duration_s=3, finish={"loiter_s": 20})
    world.run(12.0)
    assert world.station.flight.phase is Phase.ENDING
    assert order(world, "loiter").accepted
    world.run(12.0)
    assert world.station.flight.phase is Phase.LOITERING
    assert order(world, "rtl").accepted
    assert not order(world, "speed 20").accepted
    world.run()
    assert set(modes(world)) == {Mode.RTL}
    assert not world.station.phase_machine.cut_short

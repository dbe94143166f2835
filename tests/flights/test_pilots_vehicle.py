"""A vehicle that its pilot has taken stays the pilot's: while all circle at the end, and when it restarts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle
from sim_vehicles.autopilot.modes_and_failsafe import Condition, CopterMode, Mode, Px4Mode
from tests.flights.in_memory import World

COPTERS_PATH = {"speed_mps": 5, "waypoints_m": [[0, 0, 50], [300, 0, 50]]}
COPTERS: dict[str, Any] = {
    "formation": {"shape": "arrow", "spacing_m": 12},
    "path": COPTERS_PATH,
    "safety": {"separation_m": 3, "clearance_m": 5},
}


def vehicle_of(world: World, number: int) -> Vehicle:
    return next(each for identity, each in world.station.vehicles.items() if identity.system == number)


def run_until(world: World, holds: Callable[[], bool], limit_s: float = 200.0) -> None:
    while not holds():
        assert world.now_s < limit_s
        world.run(0.5)


def circling() -> World:
    world = World(duration_s=2, finish={"loiter_s": 60})
    run_until(world, lambda: bool(world.times_s("phase", text="loitering")))
    world.run(6.0)
    return world


@pytest.mark.parametrize(
    "command",
    [
        lambda world: world.station.orders.execute("rtl", world.clock.now()),
        lambda world: world.station.phase_machine.go_home_at_once(world.clock.now()),
    ],
    ids=["an order", "a second interruption"],
)
def test_one_that_its_pilot_takes_while_all_circle_is_commanded_nothing_more(
    command: Callable[[World], object],
) -> None:
    world = circling()
    world.inject(2, "pilot", mode="FBWA")
    world.run(3.0)
    assert world.times_s("member", 2, "parted by its pilot")
    command(world)
    world.run(4.0)
    assert [world.vehicle(number).pilot.mode for number in (1, 2, 3)] == [Mode.RTL, Mode.FBWA, Mode.RTL]


def test_modes_that_our_own_commands_lead_to_are_no_pilots() -> None:
    world = circling()
    world.station.orders.execute("rtl", world.clock.now())
    world.run(8.0)
    assert not world.times_s("member", text="parted")
    assert world.station.phase_machine.failure is None


def landing(number: int) -> World:
    """Return two aircraft of which the other one lands, or waits over its home to land."""
    world = World(start={"in_air": False}, vehicles={"count": 2}, duration_s=5, finish={"then": "land", "loiter_s": 0})
    run_until(world, lambda: world.vehicle(number).pilot.mode is Mode.AUTOLAND)
    return world


@pytest.mark.slow
@pytest.mark.parametrize("taken", ["the one that waits", "the one that lands"])
def test_none_is_commanded_to_land_that_its_pilot_has_taken_nor_while_a_pilot_may_land(taken: str) -> None:
    world = landing(2)
    world.run(3.0)
    who, other = (1, 2) if taken == "the one that waits" else (2, 1)
    world.inject(who, "pilot", mode="LOITER")
    world.run(150.0)
    assert world.vehicle(who).pilot.mode is Mode.LOITER
    lands = world.vehicle(other).pilot.condition is Condition.DISARMED
    assert lands is (who == 1)
    failure = world.station.phase_machine.failure
    assert (failure is None) is (who == 1)
    assert failure is None or "vehicle 2 was taken over by its pilot as it landed" in failure


@pytest.mark.parametrize("mode", ["FBWA", "LOITER"])
def test_one_that_restarts_in_its_pilots_hands_is_commanded_no_mode_until_it_is_given_back(mode: str) -> None:
    world = World(duration_s=40)
    world.fly_to(2.0)
    world.inject(2, "pilot", mode=mode)
    world.run(2.0)
    world.inject(2, "restart")
    world.run(6.0)
    assert world.times_s("restarted", 2, "it stays its pilot's")
    assert world.vehicle(2).pilot.mode is Mode.MANUAL
    world.vehicle(2).enter(Mode.GUIDED)
    world.run(3.0)
    assert vehicle_of(world, 2).member is Member.FLYING


def test_one_that_its_pilot_landed_is_not_armed_when_it_is_switched_on_again() -> None:
    """The others still assemble; before, it was started as ours, and took off 4 s later."""
    world = World(start={"in_air": False}, path={"speed_mps": 22, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]})
    run_until(world, lambda: bool(world.times_s("ready", 2)))
    vehicle = world.vehicle(2)
    vehicle.take_over("MANUAL")
    world.run(1.0)
    assert vehicle_of(world, 2).member is Member.PARTED
    vehicle.pilot.condition = Condition.DISARMED
    vehicle.body.ground()
    world.run(2.0)
    world.inject(2, "restart")
    world.run(12.0)
    assert vehicle.pilot.condition is Condition.DISARMED
    assert vehicle.pilot.mode is Mode.MANUAL


def test_a_multirotor_on_the_ground_after_the_path_has_begun_is_commanded_no_mode() -> None:
    copters = [{"id": number, "model": "arducopter", "role": "follower"} for number in (2, 3)]
    world = World(vehicles=[{"id": 1, "model": "arducopter", "role": "leader"}, *copters], **COPTERS)
    world.fly_to(2.0)
    vehicle = world.vehicle(2)
    vehicle.pilot.condition = Condition.DISARMED
    vehicle.body.ground()
    vehicle.enter(CopterMode.STABILIZE)
    world.inject(2, "restart")
    world.run(20.0)
    assert len(world.times_s("abandoned", 2, "left to its pilot")) == 1
    assert vehicle.pilot.mode is CopterMode.STABILIZE


def test_a_px4_that_its_pilot_took_in_its_climb_can_be_given_back() -> None:
    """PX4 changes to OFFBOARD only with a stream of setpoints."""
    world = World(vehicles={"count": 2, "model": "px4_copter"}, start={"in_air": False}, **COPTERS)
    taken = vehicle_of(world, 2)
    run_until(world, lambda: taken.telemetry.motion is not None and taken.telemetry.motion.above_home_m > 8.0)
    world.vehicle(2).take_over("RTL")
    world.run(3.0)
    assert taken.is_left
    assert world.vehicle(2).switch(Px4Mode.OFFBOARD)
    world.run(3.0)
    assert taken.member is Member.FLYING

"""A killed station's flight is resumed, as often as need be, from vehicles whose failsafes have acted meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest

from airlink import mavlink as m
from airlink.clock import after
from gcs_formation.phases import Phase
from sim_vehicles.autopilot.modes_and_failsafe import FlightMode, Mode
from tests.flights.in_memory import World
from tests.flights.test_resume import Killed, killed

__all__ = ["killed"]
SELDOM = {"rate_hz": 5}
FAR = {"speed_mps": 22, "waypoints_m": [[0, 0, 60], [3000, 0, 60], [9000, 0, 60]]}


GOES_HOME: dict[str, float] = {"FS_GCS_ENABL": 1, "FS_LONG_ACTN": 1, "FS_LONG_TIMEOUT": 5}


def keys_with(parameters: dict[str, float]) -> dict[str, Any]:
    """Return the keys of a long flight of two vehicles whose autopilots have these parameters."""
    vehicles = {"count": 2, "autopilot_parameters": parameters}
    rest = {"telemetry": SELDOM, "law": SELDOM, "path": FAR, "duration_s": 300, "finish": {"loiter_s": 20}}
    return {"vehicles": vehicles} | rest


def on_the_ground(world: World) -> None:
    world.run(2.0)


def climbing(world: World) -> None:
    world.network.run(lambda: all(each.pilot.airborne for each in world.fleet.vehicles))


def assembling(world: World) -> None:
    world.network.run(lambda: world.station.flight.phase is Phase.ASSEMBLING)
    world.run(2.0)


def flying(world: World) -> None:
    world.fly_to(5.0)


def ending(world: World) -> None:
    world.fly_to(5.0)
    assert world.station.orders.execute("loiter", world.clock.now()).accepted
    world.run(1.5)
    assert world.station.flight.phase is Phase.ENDING


def loitering(world: World) -> None:
    ending(world)
    world.network.run(lambda: world.station.flight.phase is Phase.LOITERING)
    world.run(1.5)


IN_THE_AIR = (climbing, assembling, flying, ending, loitering)
TO_END = (ending, loitering)
FAST = ((climbing, 3.0, 30.0), (flying, 3.0, 8.0), (flying, 20.0, 1.0), (ending, 5.0, 8.0), (loitering, 5.0, 30.0))
"""Cases of the fast tests, in which the formation isn't waited for."""
WHOLE = list(product(IN_THE_AIR, (3.0, 5.0, 20.0), (1.0, 8.0, 30.0, 60.0)))


def begun(killed: Callable[..., Killed], phase: Callable[[World], None], parameters: dict[str, float]) -> Killed:
    """Return a flight that has come to a phase."""
    start = {"in_air": phase not in (on_the_ground, climbing), "run_in_s": 6}
    flight = killed(**keys_with(parameters), start=start)
    phase(flight.world)
    return flight


def kill(flight: Killed, seconds: float) -> None:
    """Kill the station, also one whose flight has ended; for some time there is none."""
    world = flight.world
    flight.close()
    world.process.stop(world.clock.now(), 1e6)
    until = after(world.clock.now(), seconds)
    world.network.run(lambda: world.clock.now() >= until)


def modes(world: World) -> set[FlightMode]:
    return {each.pilot.mode for each in world.fleet.vehicles}


def resumed(
    killed: Callable[..., Killed], phase: Callable[[World], None], failsafe_s: float, silent_s: float, until: Phase
) -> None:
    """Kill a flight's station in a phase, resume the flight, and fly until another phase, or to the end."""
    flight = begun(killed, phase, GOES_HOME | {"FS_LONG_TIMEOUT": failsafe_s})
    world, until = flight.world, Phase.DONE if phase in TO_END else until
    kill(flight, silent_s)
    flight.resume()
    world.network.run(lambda: world.station.flight.phase in (until, Phase.FLYING) or world.station.flight.ended)
    world.run(1.0)
    assert world.station.phase_machine.failure is None
    assert world.station.flight.phase in (until, Phase.FLYING)
    assert modes(world) == {Mode.LOITER if phase in TO_END else Mode.GUIDED}
    assert flight.commanded(m.MAV_CMD_COMPONENT_ARM_DISARM) == []
    heights_m = sorted(body.state.height_m for body in world.fleet.bodies)
    assert phase not in TO_END or np.diff(heights_m).min() > 10.0


@pytest.mark.parametrize(("phase", "failsafe_s", "silent_s"), FAST)
def test_killed_in_any_phase_the_vehicles_are_taken_over_whatever_their_failsafes_did(
    killed: Callable[..., Killed], phase: Callable[[World], None], failsafe_s: float, silent_s: float
) -> None:
    resumed(killed, phase, failsafe_s, silent_s, Phase.ASSEMBLING)


@pytest.mark.slow
@pytest.mark.parametrize(("phase", "failsafe_s", "silent_s"), WHOLE)
def test_and_the_flight_goes_on_along_its_path_or_comes_to_its_end(
    killed: Callable[..., Killed], phase: Callable[[World], None], failsafe_s: float, silent_s: float
) -> None:
    resumed(killed, phase, failsafe_s, silent_s, Phase.FLYING)


@pytest.mark.slow
@pytest.mark.parametrize("family", ["arducopter", "px4", "px4_copter"])
@pytest.mark.parametrize("silent_s", [1.0, 8.0, 25.0])
def test_other_families_are_resumed_likewise(killed: Callable[..., Killed], family: str, silent_s: float) -> None:
    """Multirotors fly home, and have landed after a longer time."""
    far = {"speed_mps": 14 if family == "px4" else 5, "waypoints_m": [[0, 0, 60], [1000, 0, 60], [3000, 0, 60]]}
    options = {"FS_GCS_ENABLE": 1} if family == "arducopter" else {"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 5}
    vehicles = {"count": 2, "model": family, "autopilot_parameters": options}
    flight = killed(vehicles=vehicles, path=far, duration_s=200)
    world = flight.world
    flying(world)
    kill(flight, silent_s)
    flight.resume()
    world.run(30.0)
    assert world.station.phase_machine.failure is None
    assert len(world.times_s("takeover", text="taken over")) == 2


def test_attempts_that_fail_change_nothing_and_the_next_takes_those_that_it_is_ordered_to(
    killed: Callable[..., Killed],
) -> None:
    """Their failsafes are off, so whoever sent them home isn't known. The first attempt used to end the flight."""
    flight = begun(killed, flying, {})
    world = flight.world
    kill(flight, 3.0)
    for vehicle in world.fleet.vehicles:
        vehicle.enter(Mode.RTL)
    said = "no vehicle to take over: vehicle 1, 2: in RTL, and the flight had left it in GUIDED; --take takes those"
    for _ in range(2):
        flight.resume()
        world.run(20.0)
        assert world.station.flight.phase is Phase.FAILED
        assert (world.station.phase_machine.failure or "").startswith(said)
        kill(flight, 2.0)
    flight.resume(take=True)
    world.run(20.0)
    assert world.station.phase_machine.failure is None
    assert (world.station.flight.phase, modes(world)) == (Phase.ASSEMBLING, {Mode.GUIDED})
    kill(flight, 2.0)
    flight.resume()
    world.run(5.0)
    assert (world.station.flight.phase, modes(world)) == (Phase.ASSEMBLING, {Mode.GUIDED})


def test_attempts_that_are_killed_themselves_are_followed_by_others(killed: Callable[..., Killed]) -> None:
    flight = begun(killed, flying, GOES_HOME)
    world = flight.world
    for lived_s, silent_s in ((0.1, 8.0), (0.4, 1.0), (1.5, 8.0), (4.0, 2.0)):
        kill(flight, silent_s)
        flight.resume(take=lived_s == 0.4)
        world.run(lived_s)
    kill(flight, 8.0)
    flight.resume()
    world.run(20.0)
    assert world.station.phase_machine.failure is None
    assert modes(world) == {Mode.GUIDED}


def test_a_pilots_vehicle_stays_the_pilots_through_every_attempt(killed: Callable[..., Killed]) -> None:
    """The first attempt takes the other one. The second used to find the pilot's in the mode of the record's end."""
    flight = begun(killed, flying, {})
    world = flight.world
    kill(flight, 3.0)
    world.vehicle(2).enter(Mode.LOITER)
    for _ in range(2):
        flight.resume()
        world.run(4.0)
        assert [each.pilot.mode for each in world.fleet.vehicles] == [Mode.GUIDED, Mode.LOITER]
        kill(flight, 2.0)
    flight.resume(take=True)
    world.run(4.0)
    assert modes(world) == {Mode.GUIDED}


def test_killed_on_the_ground_there_is_nothing_to_resume_and_what_to_do_is_said(killed: Callable[..., Killed]) -> None:
    flight = begun(killed, on_the_ground, GOES_HOME)
    kill(flight, 8.0)
    flight.resume()
    flight.world.run(10.0)
    said = "no vehicle to take over: vehicle 1, 2: on the ground; fly it from its start, by its scenario"
    assert flight.world.station.phase_machine.failure == said

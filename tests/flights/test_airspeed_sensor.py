"""Airspeed sensors whose readings fail in flight; the aircraft themselves keep flying as commanded."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.messages.telemetry import VfrHud
from airlink.stream_parser import StreamParser
from gcs_formation.vehicle.member import Member
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between, World

QUICKSTART: dict[str, Any] = {
    "duration_s": 100,
    "vehicles": {"count": 4},
    "formation": {"shape": "diamond", "spacing_m": 30},
    "path": {
        "speed_mps": 22,
        "waypoints_m": [[0, 0, 100], [800, 0, 100], [1550, 250, 110], [2150, 750, 125], [2750, 1250, 130]],
    },
}


class FailedSensor(Between):
    """One vehicle's airspeed reading sticks, or decreases more and more, from some time on."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.number, self.loses_mps, self._lost_mps = 1, 0.0, 0.0
        self.reads_mps: float | None = None
        systems = [each.config.identity.system for each in fleet.vehicles]
        self._writers = {system: FrameWriter(system, 1) for system in systems}

    def fail(self, number: int, reads_mps: float | None = None, loses_mps: float = 0.0) -> None:
        """Let it read `reads_mps`, or lose `loses_mps` with each message; with neither it works again."""
        self.number, self.reads_mps, self.loses_mps, self._lost_mps = number, reads_mps, loses_mps, 0.0

    def datagrams_to_send(self) -> list[Datagram]:
        return [self._commanded(each) for each in super().datagrams_to_send()]

    def _commanded(self, datagram: Datagram) -> Datagram:
        (frame,) = StreamParser().feed(datagram.data)
        message = frame.message
        if frame.system != self.number or message is None:
            return datagram
        if isinstance(message, VfrHud):
            self._lost_mps += self.loses_mps
            read_mps = max(0.0, message.airspeed_mps - self._lost_mps) if self.reads_mps is None else self.reads_mps
            message = message.but(airspeed_mps=read_mps)
        return Datagram(datagram.socket, datagram.peer, self._writers[frame.system].encode(message))


def flown(**keys: Any) -> tuple[World, FailedSensor]:
    """Return a flight, and the engine that makes a sensor fail in it."""
    world = World(FailedSensor, **keys)
    assert isinstance(world.between, FailedSensor)
    return world, world.between


def min_separation_m(world: World, seconds: float) -> float:
    """Run for a while; return the least true separation."""
    min_m = np.inf
    for _ in range(round(10 * seconds)):
        world.run(0.1)
        states = [each.body.state for each in world.fleet.vehicles]
        places = [np.array([each.north_m, each.east_m, each.height_m]) for each in states]
        min_m = min(min_m, *(float(np.linalg.norm(one - other)) for one, other in combinations(places, 2)))
    return min_m


@pytest.mark.parametrize("number", [1, 2])
def test_a_sensor_that_reads_0_for_a_while_is_reported_and_changes_nothing(number: int) -> None:
    world, sensor = flown(duration_s=12, vehicles={"count": 2})
    world.fly_to(2.0)
    sensor.fail(number, 0.0)
    assert min_separation_m(world, 5.0) > 29.0
    sensor.fail(number)
    assert min_separation_m(world, 4.0) > 29.0
    assert world.worst_m() < 0.1
    first, last = world.words("airspeed")
    assert first == "the 0.0 m/s that it measures is rejected: velocity over ground and wind show 22.0 m/s"
    assert last == "what it measures is accepted again"
    assert len(world.times_s("airspeed", number)) == 2
    assert world.words("disobeys") == []


def test_a_rejected_sensor_that_works_after_a_restart_in_the_air_is_accepted_as_soon_as_the_vehicle_is_back() -> None:
    """What it had read before the restart isn't held against it for as long as its autopilot had been up."""
    world, sensor = flown(duration_s=20, vehicles={"count": 2})
    world.fly_to(2.0)
    sensor.fail(2, 0.0)
    world.run(2.0)
    world.inject(2, "restart")
    sensor.fail(2)
    world.run(4.0)
    (vehicle,) = (each for each in world.station.vehicles.values() if each.identity.system == 2)
    assert vehicle.member is Member.FLYING
    assert vehicle.sampler.airspeed_check is not None
    assert vehicle.sampler.airspeed_check.accepted
    assert world.words("airspeed")[-1] == "what it measures is accepted again"


@pytest.mark.slow
@pytest.mark.parametrize("at_s", [10.0, 50.0])
@pytest.mark.parametrize("reads_mps", [0.0, 34.0, 60.0])
@pytest.mark.parametrize("number", [1, 3])
def test_a_sensor_that_sticks_costs_a_diamond_in_bends_nothing(number: int, reads_mps: float, at_s: float) -> None:
    """Followers came within 2.8 m of the leader, or of each other, when 60 m/s were believed."""
    world, sensor = flown(**QUICKSTART)
    world.fly_to(at_s)
    sensor.fail(number, reads_mps)
    assert min_separation_m(world, 95.0 - at_s) > 40.0
    assert world.worst_m(at_s) < 1.0
    assert len(world.times_s("airspeed")) == len(world.times_s("airspeed", number)) == 1
    assert world.words("disobeys") == []


@pytest.mark.slow
@pytest.mark.parametrize("reads_mps", [0.0, 60.0])
def test_it_may_have_failed_before_and_in_wind(reads_mps: float) -> None:
    """The wind along its nose is then that of calm air until it turns."""
    world, sensor = flown(**QUICKSTART, wind={"velocity_mps": [4, 3, 0]})
    sensor.fail(1, reads_mps)
    world.fly_to(0.0)
    assert min_separation_m(world, 95.0) > 40.0
    assert world.worst_m(60.0) < 1.0
    assert world.station.phase_machine.failure is None


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 3])
def test_a_sensor_that_ices_up_leaves_the_formation_apart(number: int) -> None:
    """It loses 1 m/s per second, which looks like wind as long as the reading is a flyable airspeed."""
    world, sensor = flown(**QUICKSTART)
    world.fly_to(20.0)
    sensor.fail(number, loses_mps=0.1)
    assert min_separation_m(world, 75.0) > 30.0
    assert world.worst_m(60.0) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 3])
def test_arduplanes_limits_and_scale_are_kept_while_a_sensor_fails(number: int) -> None:
    vehicles = {"count": 4, "autopilot": "arduplane"}
    start = {"in_air": True, "run_in_s": 20}
    world, sensor = flown(**QUICKSTART | {"vehicles": vehicles, "start": start, "origin": {"alt_m": 1500}})
    world.fly_to(10.0)
    scale = world.station.vehicles[world.vehicle(number).config.identity].autopilot.airspeed_scale
    assert scale is not None
    ratio = scale.ratio
    sensor.fail(number, 0.0)
    assert min_separation_m(world, 85.0) > 30.0
    assert scale.ratio == pytest.approx(ratio, abs=1e-4)
    assert len(world.times_s("airspeed")) == 1

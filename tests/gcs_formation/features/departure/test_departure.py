"""Fixed wings keep their distances from the ground until the formation is commanded, also where commands are lost."""

from __future__ import annotations

import math
import random
from itertools import combinations
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.engine import Datagram
from gcs_formation.features.departure.awaiting import STRAIGHT_S
from gcs_formation.features.departure.take_off_order import AHEAD_M, LATERAL_M, TakeOffOrder
from gcs_formation.phases import Phase
from gcs_formation.vehicle.member import Member
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between, World

DIAMOND = {"shape": "diamond", "spacing_m": 30}


class Losing(Between):
    """Loses a share of the datagrams both ways."""

    seed, share = 1, 0.3

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._random = random.Random(self.seed)

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        super().receive([each for each in datagrams if self._random.random() >= self.share], now)

    def datagrams_to_send(self) -> list[Datagram]:
        return [each for each in super().datagrams_to_send() if self._random.random() >= self.share]


def least_m(world: World) -> float:
    """Return the least distance of two vehicles in the air at any instant, by truth."""
    states = [each.body.state for each in world.fleet.vehicles if each.pilot.airborne]
    places = [(each.north_m, each.east_m, each.height_m) for each in states]
    return min((float(np.hypot.reduce(np.subtract(one, other))) for one, other in combinations(places, 2)), default=1e3)


def nearest_m(world: World, until: Any, limit_s: float = 120.0) -> float:
    nearest = 1e3
    while not until() and world.now_s < limit_s:
        world.run(0.2)
        nearest = min(nearest, least_m(world))
    return nearest


@pytest.mark.parametrize("seed", [15, *(pytest.param(each, marks=pytest.mark.slow) for each in (23, 45))])
def test_where_a_third_of_all_commands_is_lost_those_that_take_off_keep_their_distances(seed: int) -> None:
    """Of 40 seeds, 9 to 48, the nearest are 25.7 m; without the feature 2.3 m, and these three below 8 m."""
    vehicles = {"count": 4}
    world = World(type("L", (Losing,), {"seed": seed}), start={"in_air": False}, vehicles=vehicles, formation=DIAMOND)
    flight = world.station.flight
    nearest = nearest_m(world, lambda: flight.phase is not Phase.CONNECTING)
    assert flight.phase is Phase.ASSEMBLING
    begun_s = world.now_s
    assert min(nearest, nearest_m(world, lambda: world.now_s > begun_s + 12.0)) > 25.0


def test_those_that_wait_for_their_leader_fly_straight_on_and_then_circle_at_heights_of_their_own() -> None:
    """It climbs by 0.7 m/s, and the others by 3."""
    leader = {"id": 1, "role": "leader", "true_model": {"climb_max_mps": 0.7}}
    vehicles = [leader, *({"id": number, "role": "follower"} for number in (2, 3, 4))]
    world = World(start={"in_air": False}, vehicles=vehicles, formation=DIAMOND)
    followers = list(world.station.vehicles.values())[1:]
    nearest = nearest_m(world, lambda: all(each.member is Member.FLYING for each in followers))
    begun_s = world.now_s
    headings = [world.vehicle(number).body.state.heading_rad for number in (2, 3, 4)]
    nearest = min(nearest, nearest_m(world, lambda: world.now_s > begun_s + 0.8 * STRAIGHT_S))
    assert [world.vehicle(number).body.state.heading_rad for number in (2, 3, 4)] == pytest.approx(headings, abs=0.05)
    nearest = min(nearest, nearest_m(world, lambda: world.now_s > begun_s + STRAIGHT_S + 15.0))
    assert {each.member for each in followers} == {Member.HOLDING}
    heights_m = sorted(world.vehicle(number).body.state.height_m for number in (2, 3, 4))
    assert np.diff(heights_m) == pytest.approx([15.0, 15.0], abs=5.0)
    nearest = min(nearest, nearest_m(world, lambda: world.station.flight.phase is not Phase.CONNECTING))
    assert nearest > 20.0
    world.run(10.0)
    assert {each.member for each in followers} == {Member.FLYING}


@pytest.mark.parametrize("lost", [False, True])
def test_those_that_wait_under_a_virtual_leader_go_on_without_one_that_is_its_pilots_or_lost(*, lost: bool) -> None:
    """The first climbs slowly; its pilot takes it, or the second, which has climbed out, crashes."""
    slow = {"id": 1, "role": "follower", "true_model": {"climb_max_mps": 0.7}}
    vehicles = [slow, *({"id": number, "role": "follower"} for number in (2, 3))]
    world = World(start={"in_air": False}, vehicles=vehicles, telemetry={"rate_hz": 5}, law={"rate_hz": 5})
    waits = list(world.station.vehicles.values())[2]
    if lost:
        world.network.run(lambda: waits.member is Member.FLYING)
        world.inject(2, "crash")
    world.network.run(lambda: waits.member is Member.HOLDING)
    if not lost:
        world.vehicle(1).take_over("FBWA")
    world.network.run(lambda: waits.member is Member.FLYING or world.now_s > 140.0)
    world.run(2.0)
    assert world.station.flight.phase is Phase.ASSEMBLING
    assert [each.member for each in world.station.vehicles.values()] == (
        [Member.FLYING, Member.HOLDING, Member.FLYING] if lost else [Member.STARTING, Member.FLYING, Member.FLYING]
    )


def standing(number: int, north_m: float, east_m: float, *, yaw_deg: float = 0.0, armed: bool = False) -> Any:
    telemetry = SimpleNamespace(
        armed=armed,
        motion=SimpleNamespace(north_m=north_m, east_m=east_m),
        attitude=SimpleNamespace(yaw_rad=math.radians(yaw_deg)),
    )
    start_up = SimpleNamespace(may_arm=True, ready_to_arm=True, abandoned=False, held=True)
    plane = SimpleNamespace(hovers=False)
    return SimpleNamespace(
        identity=VehicleId(1, number), index=number - 1, telemetry=telemetry, start_up=start_up, autopilot=plane
    )


def judged(*vehicles: Any, phase: Phase = Phase.CONNECTING) -> list[bool]:
    """Return which of these may be armed."""
    cycle: Any = SimpleNamespace(each=list(vehicles), flight=SimpleNamespace(phase=phase), now=Instant(0))
    TakeOffOrder(cycle).run(cycle)
    return [each.start_up.may_arm for each in vehicles]


@pytest.mark.parametrize(
    ("north_m", "east_m", "yaw_deg", "may"),
    [
        (60.0, 0.0, 0.0, False),
        (AHEAD_M - 1.0, LATERAL_M - 1.0, 0.0, False),
        (AHEAD_M + 1.0, 0.0, 0.0, True),
        (60.0, LATERAL_M + 1.0, 0.0, True),
        (60.0, -LATERAL_M - 1.0, 0.0, True),
        (-60.0, 0.0, 0.0, True),
        (-60.0, 0.0, 180.0, False),
        (0.0, 60.0, 90.0, False),
        (0.0, 60.0, -90.0, True),
    ],
)
def test_one_is_armed_after_those_ahead_on_its_line_of_take_off(
    north_m: float, east_m: float, yaw_deg: float, may: bool
) -> None:
    vehicle, other = standing(2, 0.0, 0.0, yaw_deg=yaw_deg), standing(1, north_m, east_m, yaw_deg=yaw_deg)
    assert judged(other, vehicle)[1] is may
    assert judged(other, vehicle, phase=Phase.FLYING)[1]
    other.telemetry.armed = True
    assert judged(other, vehicle)[1]


def test_of_two_nose_to_nose_the_first_goes_first() -> None:
    assert judged(standing(1, 0.0, 0.0), standing(2, 100.0, 0.0, yaw_deg=180.0)) == [True, False]


def test_none_is_armed_before_all_are_ready_but_for_those_that_are_given_up_or_fly() -> None:
    one, other, third = standing(1, 0.0, 0.0), standing(2, 0.0, 30.0), standing(3, 0.0, 60.0)
    other.start_up.ready_to_arm = False
    assert judged(one, other, third) == [False] * 3
    other.start_up.abandoned = True
    assert judged(one, other, third)[::2] == [True] * 2
    other.start_up.abandoned, other.telemetry.armed = False, True
    assert judged(one, other, third)[::2] == [True] * 2


def test_what_one_waits_for_is_said_once_and_only_if_it_takes_longer_than_an_answer() -> None:
    one, other = standing(1, 60.0, 0.0), standing(2, 0.0, 0.0)
    cycle: Any = SimpleNamespace(each=[one, other], flight=SimpleNamespace(phase=Phase.CONNECTING), log_event=Mock())
    stage, said = TakeOffOrder(cycle), list[tuple[float, str]]()
    for tenth in range(120):
        cycle.now, other.start_up.ready_to_arm = after(Instant(0), 0.1 * tenth), tenth > 60
        stage.run(cycle)
        said += [(0.1 * tenth, each.args[2]) for each in cycle.log_event.call_args_list]
        cycle.log_event.reset_mock()
    assert [text for _, text in said] == [
        "stays on the ground until vehicle 2 is ready",
        "stays on the ground until vehicle 1 is armed, ahead on its line",
    ]
    assert [at_s for at_s, _ in said] == pytest.approx([3.1, 6.1 + 3.1], abs=0.11)

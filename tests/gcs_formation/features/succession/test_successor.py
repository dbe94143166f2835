"""Which follower of a flight is to take over from its leader."""

from __future__ import annotations

import pytest

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.engine import Datagram
from flight_model.flight_state import FlightState
from gcs_formation.features.succession import stages
from gcs_formation.features.succession.stages import successor
from gcs_formation.vehicle.member import Member
from tests.flights.in_memory import Between, World

LONG = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [3000, 0, 100]]}
APART = {"shape": "custom", "slots_m": {2: [-20, 90, 0], 3: [-20, -20, 0], 4: [-20, 40, 0]}}


def test_the_nearest_follower_that_does_not_sink_takes_over_unless_none_is_to() -> None:
    """They fly 30, 45 and 92 m away from it, far from the origin; nearer ones aren't much nearer than a spacing."""
    path = {"speed_mps": 22, "waypoints_m": [[500, -700, 100], [4000, -700, 100]]}
    world = World(duration_s=10, vehicles={"count": 4}, formation=APART, path=path)
    world.run(1.5)
    cycle = world.station.cycle
    assert cycle.controller.plan.leader == 0
    sinking = cycle.findings.sinking
    found = list[int | None]()
    for number in (3, 4, 2, None):
        found.append(successor(cycle))
        if number is not None:
            sinking.add(VehicleId(1, number))
    assert found[0] in {2, 3}
    assert found[1:] == [3, 1, None]


class DeafFollowers(Between):
    """Passes nothing on to the followers while they are to receive nothing."""

    deaf = False

    def take(self, datagram: Datagram, now: Instant) -> None:
        if not (self.deaf and datagram.socket > 0):
            super().take(datagram, now)


@pytest.mark.parametrize("back", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_those_that_loiter_only_for_lack_of_a_leader_get_one_of_them_unless_their_own_is_back(*, back: bool) -> None:
    """None can take over while none receives; then they wait for their leader, which hangs for good or for 10 s."""
    world = World(DeafFollowers, duration_s=80, path=LONG)
    world.fly_to(5.0)
    world.inject(1, "freeze")
    world.between.deaf = True  # type: ignore[attr-defined]
    world.fly_to(15.0)
    followers = [world.station.vehicles[VehicleId(1, number)] for number in (2, 3)]
    assert {each.member for each in followers} == {Member.HOLDING}
    assert world.words("leader") == []
    if back:
        world.inject(1, "freeze", ends=True)
        world.fly_to(17.0)
    world.between.deaf = False  # type: ignore[attr-defined]
    world.fly_to(70.0)
    assert {each.member for each in followers} == {Member.FLYING}
    assert world.words("leader") == ([] if back else ["leads the formation"])
    assert world.worst_m(from_s=60.0) < 1.0


def test_vehicles_with_reasons_of_their_own_to_loiter_do_not_lead() -> None:
    world = World(duration_s=80, path=LONG)
    world.fly_to(5.0)
    cycle = world.station.cycle
    for number in (2, 3):
        vehicle = world.station.vehicles[VehicleId(1, number)]
        vehicle.member = Member.HOLDING
        assert successor(cycle, among=stages._comes_back) is not None
        vehicle.unfit = "its position doesn't move by its velocity"
    assert successor(cycle, among=stages._comes_back) is None


@pytest.mark.parametrize("scale", [1.0, -1.0])
def test_a_distance_is_that_of_two_places_in_space(scale: float) -> None:
    one, other = (FlightState(n, e, up, 0.0, 22.0, 0.0, 0.0, 0.0) for n, e, up in ((1, 2, 3), (4, 6, 15)))
    one.north_m, one.east_m, one.height_m = 4.0 - 3.0 * scale, 6.0 - 4.0 * scale, 15.0 - 12.0 * scale
    assert stages._distance_m(one, other) == 13.0

"""In flight: who only just gets home leaves the formation, a leader too."""

from typing import Any

import pytest

from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.in_memory import World

BATTERY = {"capacity_mah": 140, "charged_percent": 90}
"""It lasts for 45 s, less than the landing alone is planned for: that is known once 5 % have been used."""


def flown(who: int, seconds: float = 10.0, **keys: Any) -> World:
    vehicles: list[dict[str, Any]] = [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 3}]
    vehicles[who - 1]["battery"] = BATTERY
    world = World(vehicles=vehicles, **keys)
    world.run(seconds)
    return world


def vehicle(world: World, number: int) -> Vehicle:
    """Return a vehicle as the station knows it."""
    return next(each for each in world.station.vehicles.values() if each.identity.system == number)


@pytest.mark.parametrize("who", [1, 2])
def test_it_flies_home_and_the_others_fly_on(who: int) -> None:
    world = flown(who)
    members = {each.identity.system: each.member for each in world.station.vehicles.values()}
    assert members.pop(who) is Member.HOMEWARD
    assert set(members.values()) == {Member.FLYING}
    assert world.vehicle(who).pilot.mode.name == "RTL"
    assert all(world.vehicle(each).pilot.mode.name == "GUIDED" for each in members)
    leader = world.station.cycle.reconfiguration.leader
    assert leader is not None
    assert leader.identity.system == (2 if who == 1 else 1)
    assert len(world.times_s("battery", who)) == 1


def test_it_is_only_said_where_that_is_asked_for() -> None:
    world = flown(2, safety={"battery": {"in_flight": "warn"}})
    assert len(world.times_s("battery", 2)) == 1
    assert all(each.member is Member.FLYING for each in world.station.vehicles.values())


def test_its_pilot_may_take_it_on_its_way_home() -> None:
    world = flown(2)
    world.vehicle(2).take_over("FBWA")
    world.run(1.5)
    assert world.vehicle(2).pilot.mode.name == "FBWA"
    assert world.words("member")[-1].startswith("parted by its pilot")


def test_one_that_restarts_on_its_way_home_is_sent_home_again_and_does_not_come_back_to_its_slot() -> None:
    """A battery isn't filled in the air, whatever an autopilot that has begun to count again says of it."""
    world = flown(2)
    world.inject(2, "restart")
    world.run(4.0)
    assert len(world.times_s("restarted", 2)) == 1
    assert vehicle(world, 2).member is Member.HOMEWARD
    assert world.vehicle(2).pilot.mode.name == "RTL"

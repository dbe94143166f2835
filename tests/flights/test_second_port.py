"""A vehicle that appears on a second port by itself, while its first works: a further link, once shown to be its."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from airlink.clock import Instant
from airlink.endpoint import VehicleId, parse_endpoint
from airlink.engine import Datagram
from sim_vehicles.config import FleetConfig, fleet_config
from sim_vehicles.fleet import Fleet
from tests.flights import in_memory
from tests.flights.in_memory import Between, World

ENDS = ("udpin:127.0.0.1:14550", "udpin:127.0.0.1:14551")
VEHICLES = [
    {"id": each, "role": "follower" if each > 1 else "leader", "endpoint": ENDS[each == 3]} for each in (1, 2, 3)
]
SHOWN_S = 4.0
"""Time in which it is noticed that both send, and the second is shown to be the vehicle's."""


class Appearing(Between):
    """Vehicles of which some fall silent, or begin to send, at one of their ends."""

    silent: set[int]

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.silent = {len(fleet.vehicles)}

    def take(self, datagram: Datagram, now: Instant) -> None:
        if datagram.socket not in self.silent:
            super().take(datagram, now)

    def datagrams_to_send(self) -> list[Datagram]:
        return [each for each in super().datagrams_to_send() if each.socket not in self.silent]


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    """Return a flight whose vehicle 2 has a second end, at vehicle 3's: it's silent, and no scenario names it."""

    def with_second_end(planned: Any) -> FleetConfig:
        config = fleet_config(planned)
        first, second, third = config.vehicles
        further = (parse_endpoint(ENDS[1]).opposite(),)
        return replace(config, vehicles=(first, replace(second, further_endpoints=further), third))

    monkeypatch.setattr(in_memory, "fleet_config", with_second_end)
    return World(Appearing, vehicles=VEHICLES, links={"default": {"delay_ms": 50}}, duration_s=20.0)


def appear(world: World) -> None:
    assert isinstance(world.between, Appearing)
    world.between.silent = set()


def test_it_becomes_a_link_which_is_used_once_the_first_dies(world: World) -> None:
    world.fly_to(2.0)
    appear(world)
    began_s = world.now_s
    world.run(SHOWN_S)
    (shown_s,) = world.times_s("address", 2, "taken as link 2")
    assert shown_s - began_s < SHOWN_S
    assert not world.times_s("duplicate")
    assert isinstance(world.between, Appearing)
    world.between.silent = {1}
    died_s = world.now_s
    world.run(4.0)
    (left_s,) = world.times_s("link_choice", 2, "link 2 is in use")
    assert left_s - died_s < 1.0
    world.run()
    assert world.worst_m() < 0.1
    assert len(world.times_s("member")) == 3, "none left the formation"


def test_two_that_boot_at_once_and_are_elsewhere_are_two(world: World) -> None:
    """The other's clock agrees to within a tenth of a second; its positions don't."""
    world.fly_to(2.0)
    twin = next(each for each in world.config.vehicles if each.identity.system == 2)
    booted = world.vehicle(2).clock.booted
    other = Fleet(
        replace(world.config, vehicles=(replace(twin, further_endpoints=(), start=replace(twin.start, east_m=40.0)),)),
        booted,
    )
    world.attach(other)
    world.run(6.0)
    vehicle = world.station.vehicles[VehicleId(1, 2)]
    assert len(world.times_s("duplicate", 2)) == 1
    assert not world.times_s("address")
    assert len(vehicle.each_link) == 1
    assert vehicle.links is None
    world.run()
    assert world.worst_m() < 0.1

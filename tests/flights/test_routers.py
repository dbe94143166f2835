"""Four vehicles behind one router, at one address."""

from typing import Any

import pytest

from gcs_formation.vehicle.member import Member
from tests.flights.in_memory import World
from tests.flights.routers import MavlinkRouter, Mavproxy

KEYS: dict[str, Any] = {
    "vehicles": {"count": 4},
    "formation": {"shape": "line", "spacing_m": 40},
    "telemetry": {"rate_hz": 4},
    "law": {"rate_hz": 4},
}


def members(world: World) -> list[Member]:
    return [each.member for each in world.station.vehicles.values()]


def test_behind_one_that_routes_by_target_all_fly() -> None:
    """None of the messages for one reaches another."""
    world = World(MavlinkRouter, **KEYS)
    world.run(3.0)
    assert members(world) == [Member.FLYING] * 4
    assert all(each.clock.samples for each in world.station.vehicles.values())


def test_behind_one_that_gives_timesync_to_the_first_the_others_tell_their_time_by_command() -> None:
    """The delay is measured as TIMESYNC measures it, up to the wait for the vehicle's loop, and the clocks too."""
    world = World(Mavproxy, links={"default": {"delay_ms": 150}}, **KEYS)
    world.run(13.0)
    assert members(world) == [Member.FLYING] * 4
    first, *others = world.station.vehicles.values()
    assert first.clock.samples > 2 * max(each.clock.samples for each in others) > 0
    for each in others:
        assert each.clock.one_way_s == pytest.approx(first.clock.one_way_s, abs=0.012)
        assert each.clock.offset_s == pytest.approx(first.clock.offset_s, abs=0.012)

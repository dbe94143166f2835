"""Two links a vehicle, in memory: telemetry once, from whichever is first; setpoints on the better; either may die."""

from __future__ import annotations

import itertools
import random
from pathlib import Path
from typing import Any

import pytest

import gcs_formation
from airlink.clock import NANOSECONDS
from airlink.endpoint import VehicleId
from gcs_formation.app.result_text import status_page
from gcs_formation.fleet.several_links import OTHERS
from tests.flights.conftest import Fly, scenario
from tests.flights.in_memory import World
from tests.flights.test_forwarding import Beside
from tests.processes import free_ports

ENDS = ["udpin:127.0.0.1:14550", "udpin:127.0.0.1:14551"]
TWO = {"count": 3, "endpoint": ENDS}
FAILOVER_S = 1.0
CURVE = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [500, 0, 100], [900, 400, 110], [900, 1500, 110]]}


def linked(*changes: dict[str, Any], first: float = 40.0, second: float = 400.0, **keys: Any) -> dict[str, Any]:
    """Return links with these delays, ms, which change as given."""
    worse = {"at_s": 0, "link": 2, "delay_ms": second, **keys}
    return {"default": {"delay_ms": first}, "changes": [worse, *changes]}


def used(world: World) -> list[int]:
    """Return the number of each vehicle's link in use."""
    return [vehicle.links.in_use.number for vehicle in world.station.vehicles.values() if vehicle.links]


def seen_s(world: World, seconds: float) -> list[tuple[float, float]]:
    """Return the stamps of the positions of vehicle 2 that were taken, each with when, s, to within 20 ms."""
    found, vehicle = list[tuple[float, float]](), world.station.vehicles[VehicleId(1, 2)]
    for _ in range(round(seconds / 0.02)):
        world.run(0.01)
        motion = vehicle.telemetry.motion
        if motion is not None and (not found or motion.stamp_s != found[-1][0]):
            found.append((motion.stamp_s, world.clock.now() / NANOSECONDS))
    return found


def test_telemetry_is_that_of_the_better_link_alone() -> None:
    alone = seen_s(World(links={"default": {"delay_ms": 40}}), 8.0)
    world = World(vehicles=TWO, links=linked(jitter_ms=30, loss=0.1))
    both = seen_s(world, 8.0)
    count = min(len(alone), len(both))
    assert count > 60
    assert [stamp_s for stamp_s, _ in both[:count]] == [stamp_s for stamp_s, _ in alone[:count]]
    assert [at_s for _, at_s in both[:count]] == pytest.approx([at_s for _, at_s in alone[:count]], abs=0.021)
    assert used(world) == [1, 1, 1]


def test_what_the_better_link_loses_the_other_brings() -> None:
    lossy = {"at_s": 0, "link": 1, "downlink": {"loss": 0.5}}
    world = World(vehicles=TWO, links=linked(lossy, second=60.0))
    world.run(15.0)
    (first, second) = world.station.vehicles[VehicleId(1, 2)].each_link
    assert first.sequence.loss == pytest.approx(0.5, abs=0.1)
    assert second.sequence.loss == 0.0
    ages_s = [tick.age_s[1] for tick in world.recorder.ticks[-40:]]
    assert max(ages_s) < 0.06 + 0.2 + 0.02, "a position each 0.1 s, 60 ms old at the latest"


@pytest.mark.parametrize(
    "way",
    [
        pytest.param({}, id="both ways"),
        pytest.param({"uplink": {}}, id="up", marks=pytest.mark.slow),
        pytest.param({"downlink": {}}, id="down", marks=pytest.mark.slow),
    ],
)
def test_a_link_that_dies_is_left_within_a_second_and_taken_again(way: dict[str, Any]) -> None:
    def outage(at_s: float, *, on: bool) -> dict[str, Any]:
        keys: dict[str, Any] = {name: {"outage": on} for name in way} or {"outage": on}
        return {"at_s": at_s, "link": 1, "vehicles": [2], **keys}

    links = linked(outage(5.0, on=True), outage(12.0, on=False), second=100.0, loss=0.02)
    world = World(vehicles=TWO, links=links, path=CURVE)
    world.fly_to(22.0)
    began_s = world.times_s("phase", text="flying")[0]
    left_s, back_s = (each - began_s for each in world.times_s("link_choice", 2))
    assert 5.0 < left_s <= 5.0 + FAILOVER_S
    assert 12.0 < back_s < 22.0
    assert used(world) == [1, 1, 1]
    assert not world.times_s("link_choice", 1)
    assert not world.times_s("link_choice", 3)
    assert len(world.times_s("member")) == 3, "none left the formation"
    errors_m = [abs(each) for tick in world.recorder.ticks[-200:] for each in tick.error_of(1)]
    assert max(errors_m) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, *(pytest.param(each, marks=pytest.mark.slow) for each in range(10, 18))])
def test_both_may_die_by_turns_at_any_time(seed: int) -> None:
    """At least one is up; outages up, down or both ways, of all vehicles."""
    rng, at_s, changes = random.Random(seed), 2.0, list[dict[str, Any]]()
    for link in itertools.islice(itertools.cycle((1, 2)), 6):
        for_s = rng.uniform(0.3, 4.0)
        way = rng.choice([None, "uplink", "downlink"])
        for when_s, on in ((at_s, True), (at_s + for_s, False)):
            keys = {"outage": on} if way is None else {way: {"outage": on}}
            changes.append({"at_s": when_s, "link": link, **keys})
        at_s += for_s + 1.5
    world = World(vehicles=TWO, links=linked(*changes, second=150.0, jitter_ms=20, loss=0.05), path=CURVE)
    world.fly_to(at_s + 2.0)
    assert len(world.times_s("member")) == 3
    assert not world.times_s("health")
    errors_m = [
        abs(each) for tick in world.recorder.ticks[-200:] for column in (1, 2) for each in tick.error_of(column)
    ]
    assert max(errors_m) < 1.0


@pytest.mark.slow
def test_a_worse_second_link_changes_nothing_of_how_well_it_flies(fly: Fly) -> None:
    keys = {"path": CURVE, "duration_s": 25}
    one = fly(links={"default": {"delay_ms": 100}}, **keys).to_dict()
    two = fly(vehicles=TWO, links=linked(first=100.0, jitter_ms=50, loss=0.2), **keys).to_dict()
    for name, figures in one["followers"].items():
        for axis in ("error_x_m", "error_y_m", "error_z_m"):
            alone_m, both_m = figures[axis]["rms"], two["followers"][name][axis]["rms"]
            assert both_m <= max(1.02 * alone_m, alone_m + 0.005)
    for figures in two["links"].values():
        first, second = figures["each"]
        assert [first["link"], second["link"]] == [1, 2]
        assert [first["endpoint"], second["endpoint"]] == ENDS
        assert first["measured_delay_ms"]["p50"] == pytest.approx(100.0, abs=2.0)
        assert second["measured_delay_ms"]["p50"] == pytest.approx(400.0, abs=25.0)
        assert second["measured_loss"] == pytest.approx(0.2, abs=0.05)
        assert second["injected_loss"] == pytest.approx(second["measured_loss"], abs=0.03)
        assert first["measured_loss"] == 0.0
        assert second["used_s"] == 0.0
        assert figures["measured_delay_ms"]["p50"] == pytest.approx(100.0, abs=2.0)
        assert figures["injected_delay_ms"] == pytest.approx(100.0, abs=0.1)


def test_the_law_goes_by_the_delay_of_the_link_in_use() -> None:
    outage = {"at_s": 4.0, "link": 1, "outage": True}
    world = World(vehicles=TWO, links=linked(outage, second=300.0))
    world.fly_to(10.0)
    assert used(world) == [2, 2, 2]
    delays_s = [tick.links[1].delay_s for tick in world.recorder.ticks]
    assert delays_s[-1] == pytest.approx(0.3, abs=0.01)
    assert pytest.approx(delays_s[len(delays_s) // 3], abs=0.01) == 0.04


def test_another_vehicle_with_the_same_id_does_not_come_in_by_the_second_link() -> None:
    """Vehicle 2 isn't at its second endpoint; somebody else is, who booted later."""
    peaceful, world = (World(vehicles=TWO) for _ in range(2))
    for each in (peaceful, world):
        for vehicle in each.fleet.vehicles:
            vehicle.link._fixed.pop()  # it sends nothing to its second end
    for each in (peaceful, world):
        each.run(8.0)
    twin = world.another(2, endpoint=world.config.vehicles[1].endpoints[1], further_endpoints=())
    world.attach(twin)
    for each in (peaceful, world):
        each.run(12.0)
    assert used(world) == [1, 1, 1]
    assert f"on link 2 {OTHERS}" in world.words("duplicate")
    setpoints = [[tick.setpoints for tick in each.recorder.ticks] for each in (peaceful, world)]
    assert setpoints[0] == setpoints[1]


def test_status_shows_the_delay_of_each_link() -> None:
    world = World(vehicles=TWO, links=linked())
    world.fly_to(3.0)
    assert "40* 400" in status_page(world.station, world.clock.now(), 200)


def test_a_vehicle_that_restarts_does_so_once_for_both_links() -> None:
    world = World(vehicles=TWO, links=linked(second=300.0), start={"in_air": False}, path={**CURVE})
    world.run(6.0)
    world.inject(2, "restart")
    world.run(6.0)
    assert len(world.times_s("restarted", 2)) == 1
    assert not world.times_s("duplicate")
    assert [link.agrees for link in world.station.vehicles[VehicleId(1, 2)].each_link] == [True, True]


@pytest.mark.parametrize("unsigned", ["refuse"])
def test_signed_links_take_what_the_slower_one_brings(tmp_path: Path, unsigned: str) -> None:
    key = tmp_path / "link.key"
    key.write_text("11" * 32)
    key.chmod(0o600)
    links = linked()
    links["default"] |= {"signing": {"key_file": str(key), "unsigned": unsigned}}
    outage = {"at_s": 3.0, "link": 1, "outage": True}
    links["changes"].append(outage)
    world = World(vehicles=TWO, links=links)
    world.fly_to(8.0)
    assert used(world) == [2, 2, 2]
    assert world.station.refused() == 0
    assert all(vehicle.link.signed and not vehicle.link.signed.judged for vehicle in world.fleet.vehicles)


def test_links_of_different_kinds(fly: Fly) -> None:
    ends = ["udpin:127.0.0.1:14550", "serial:/dev/ttyUSB0:57600"]
    outage = {"at_s": 2.0, "link": 1, "outage": True}
    summary = fly(vehicles={"count": 2, "endpoint": ends}, links={"changes": [outage]}, duration_s=6).to_dict()
    for figures in summary["links"].values():
        assert [each["endpoint"] for each in figures["each"]] == ends
        assert figures["each"][1]["used_s"] > 3.0


@pytest.mark.slow
def test_over_udp_one_of_two_links_dies(tmp_path: Path) -> None:
    ports = free_ports(2)
    outage = {"at_s": 2.0, "link": 1, "outage": True}
    planned = scenario(
        vehicles={"count": 2, "endpoint": [f"udpin:127.0.0.1:{port}" for port in ports]},
        links={"default": {"delay_ms": 20}, "changes": [outage]},
        duration_s=5,
        start={"in_air": True, "run_in_s": 16},
    )
    summary = gcs_formation.run(planned, clock="real", speedup=4.0, out=tmp_path / "run")
    figures = summary.to_dict()["links"]["2"]
    assert figures["each"][1]["used_s"] > 1.0
    assert figures["each"][1]["frames_in"] > 100
    assert figures["heard_to_s"] is None


@pytest.mark.slow
def test_a_second_ground_station_sees_the_link_in_use() -> None:
    outage = {"at_s": 3.0, "link": 1, "outage": True}
    received = list[dict[int, int]]()
    for beside in (Beside(), Beside(vehicles=TWO, links=linked(outage, first=0.0, second=20.0))):
        beside.world.fly_to(8.0)
        received.append(beside.second.received)
    one, two = received
    assert sorted(two) == [1, 2, 3]
    for system, count in two.items():
        assert 0.8 * one[system] < count < 1.2 * one[system]


def test_a_program_impairs_one_of_the_links() -> None:
    planned = scenario(vehicles=TWO, links=linked(second=60.0))
    with gcs_formation.Flight(planned, until=8) as flight:
        for tick in flight:
            if tick.mission_time_s > 2.0:
                flight.link(2, link=1, delay_ms=500)
                break
        for tick in flight:
            if tick.mission_time_s > 7.0:
                assert tick.vehicles[2].delay_s == pytest.approx(0.06, abs=0.01)
                assert tick.vehicles[3].delay_s == pytest.approx(0.04, abs=0.01)
                break

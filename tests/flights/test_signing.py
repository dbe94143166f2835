"""Flights over signed links: what others send changes nothing, and all of it is counted."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from airlink.clock import Instant, after
from airlink.endpoint import Address, Endpoint, VehicleId
from airlink.engine import Datagram, DelayQueue, Engine
from airlink.signing.authentication import A_MINUTE, Verdict
from airlink.signing.key import key_of_passphrase
from airlink.signing.signature import signed, timestamp_of, unsigned
from formation_scenario import ScenarioError, load_scenario
from gcs_formation.app.signing import open_links
from gcs_formation.errors import RunAbortedError
from gcs_formation.station import Station
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import Fly, scenario
from tests.flights.in_memory import Between, World

OTHER = key_of_passphrase("another")
LATER_S = 0.5


@pytest.fixture
def links(tmp_path: Path) -> dict[str, Any]:
    """Return the keys of signed links."""
    file = tmp_path / "link.key"
    file.write_text("a passphrase")
    file.chmod(0o600)
    return {"default": {"signing": {"key_file": str(file)}}}


def setpoints(world: World) -> np.ndarray:
    return np.array([tick.setpoints for tick in world.recorder.ticks])


def reported(flown: Any) -> list[Any]:
    return [flown.figures["followers"], flown.figures["control"]["ticks"], flown.figures["path"]]


def test_signed_frames_fly_the_same_and_are_authenticated(fly: Fly, links: dict[str, Any], tmp_path: Path) -> None:
    plain = fly(duration_s=2)
    record = (tmp_path / "run" / "flight.tlog").read_bytes()
    assert {each["authenticated"] for each in plain.figures["links"].values()} == {False}
    flown = fly(duration_s=2, links=links)
    assert reported(flown) == reported(plain)
    for link in flown.figures["links"].values():
        assert (link["authenticated"], link["frames_refused"], link["frames_unverified"]) == (True, 0, 0)
    assert (tmp_path / "run" / "flight.tlog").read_bytes() == record


def test_the_key_is_in_no_record_and_nothing_is_kept_under_the_virtual_clock(
    fly: Fly, links: dict[str, Any], tmp_path: Path
) -> None:
    fly(duration_s=1, links=links)
    octets = key_of_passphrase("a passphrase").octets
    for file in (tmp_path / "run").iterdir():
        data = file.read_bytes()
        assert octets not in data
        assert octets.hex().encode() not in data
        assert b"a passphrase" not in data
    assert "link.key" in (tmp_path / "run" / "run.yaml").read_text()
    assert sorted(each.name for each in tmp_path.iterdir()) == ["link.key", "run"]


class Forging(Engine):
    """An engine at which everything arrives again, half a second later: as it was, altered, unsigned, signed anew."""

    def __init__(self, engine: Engine) -> None:
        self.engine, self.forged = engine, dict.fromkeys(Verdict, 0)
        self._later = DelayQueue[Datagram]()
        self._count = 0

    def endpoints(self) -> tuple[Endpoint, ...]:
        return self.engine.endpoints()

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        for each in datagrams:
            self._later.push(after(now, LATER_S), Datagram(each.socket, each.peer, each.data))
        self.engine.receive(datagrams, now)

    def datagrams_to_send(self) -> list[Datagram]:
        return self.engine.datagrams_to_send()

    def next_timer(self) -> Instant | None:
        timer, later = self.engine.next_timer(), self._later.next()
        return timer if timer is None or later is None else min(timer, later)

    def handle_timer(self, now: Instant) -> None:
        for each in self._later.pop_due(now):
            for data, verdict in self._forged(each.data):
                self.forged[verdict] += 1
                self._count += 1
                peer = each.peer if self._count % 2 else Address("10.0.0.1", 14550)
                self.engine.receive([Datagram(each.socket, peer, data)], now)
        timer = self.engine.next_timer()
        if timer is not None and timer <= now:
            self.engine.handle_timer(now)

    def _forged(self, data: bytes) -> list[tuple[bytes, Verdict]]:
        late = timestamp_of(data) + 10**6
        altered = signed(unsigned(data), OTHER.octets, data[-13], late)
        return [
            (data, Verdict.REPLAYED),
            (unsigned(data), Verdict.UNSIGNED),
            (altered, Verdict.WRONG_KEY),
            (altered[:-6] + data[-6:], Verdict.WRONG_KEY),
        ]


def refused_by(fleet: Fleet) -> dict[Verdict, int]:
    """Return how many frames vehicles refused."""
    total = dict.fromkeys(Verdict, 0)
    for vehicle in fleet.vehicles:
        assert vehicle.link.signed is not None
        for judged in vehicle.link.signed.judged.values():
            for verdict, count in judged.refused.items():
                total[verdict] += count
    return total


def refused_by_station(station: Station) -> dict[Verdict, int]:
    total = dict.fromkeys(Verdict, 0)
    for identity in station.vehicles:
        for verdict, count in station.signatures.judged(identity).refused.items():
            total[verdict] += count
    return total


def test_replayed_altered_and_unsigned_frames_change_nothing_at_either_end_and_are_counted(
    links: dict[str, Any],
) -> None:
    in_peace = World(duration_s=3, links=links)
    in_peace.run()
    walls = list[Forging]()

    def around(engine: Engine, _: Station) -> Engine:
        walls.append(Forging(engine))
        return walls[-1]

    class Forged(Between):
        def __init__(self, fleet: Fleet) -> None:
            super().__init__(fleet)
            self.fleet = Forging(fleet)  # type: ignore[assignment]
            walls.append(self.fleet)  # type: ignore[arg-type]

    world = World(between=Forged, around=around, duration_s=3, links=links)
    world.run()
    assert np.array_equal(setpoints(world), setpoints(in_peace), equal_nan=True)
    at_vehicles, at_station = walls
    assert refused_by(world.fleet) == at_vehicles.forged
    assert refused_by_station(world.station) == at_station.forged
    assert min(sum(each.forged.values()) for each in walls) > 1000
    assert {each.kind for each in world.recorder.events} - {each.kind for each in in_peace.recorder.events} == {
        "signing"
    }


def test_with_another_key_no_vehicle_is_heard_and_the_reason_is_an_event(links: dict[str, Any]) -> None:
    world = World(duration_s=3, links=links)
    others = tuple(replace(each, signing_key=OTHER) for each in world.config.vehicles)
    stranger = World(duration_s=3, links=links)
    stranger.network._engines[0] = Fleet(replace(stranger.config, vehicles=others))
    stranger.run(3.0)
    assert [vehicle.frames_in for vehicle in stranger.station.vehicles.values()] == [0, 0, 0]
    words = stranger.words("signing")
    assert len(words) == 3
    assert all("signed with another key" in each for each in words)


def test_a_vehicle_without_a_key_is_refused_unless_unsigned_frames_are_accepted(links: dict[str, Any]) -> None:
    for policy in ("refuse", "accept"):
        links["default"]["signing"]["unsigned"] = policy
        world = World(duration_s=3, links=links)
        world.fleet.vehicles[1].link.set_key(None, 0)
        world.run(2.0)
        received = world.station.vehicles[VehicleId(1, 2)].frames_in
        assert (received > 0) is (policy == "accept")
        assert any("unsigned" in each or "not signed" in each for each in world.words("signing"))


def test_a_vehicle_whose_own_link_has_no_key_flies_beside_signed_ones(fly: Fly, links: dict[str, Any]) -> None:
    first, second, third = ({"id": number, "endpoint": f"udpin:127.0.0.1:{14550 + number}"} for number in (1, 2, 3))
    own = {"signing": {"key_file": "none"}}
    flown = fly(duration_s=2, links=links, vehicles=[{**first, "role": "leader"}, second, third | own])
    assert [each["authenticated"] for each in flown.figures["links"].values()] == [True, True, False]
    assert flown.figures["followers"]["3"]["error_x_m"]["max"] < 0.05


@pytest.mark.slow
def test_signed_frames_without_a_key_are_unverified(fly: Fly, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def keyed(planned: Any) -> Any:
        config = fleet_config(planned)
        vehicles = tuple(
            replace(each, signing_key=OTHER if each.identity.system == 2 else None) for each in config.vehicles
        )
        return replace(config, vehicles=vehicles)

    monkeypatch.setattr("gcs_formation.app.run.fleet_config", keyed)
    with pytest.raises(RunAbortedError, match="vehicle 2: not done"):  # it refuses what we send
        fly(duration_s=1)
    links = json.loads((tmp_path / "run" / "summary.json").read_text())["links"]
    assert [links[each]["authenticated"] for each in "123"] == [False] * 3
    assert [links[each]["frames_unverified"] > 50 for each in "123"] == [False, True, False]
    events = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
    assert [each["vehicle"] for each in events if each["kind"] == "signing"] == ["2"]


def test_a_vehicle_that_restarts_is_heard_again(links: dict[str, Any]) -> None:
    world = World(duration_s=25, links=links)
    world.fly_to(2.0)
    world.inject(3, "restart")
    world.run(8.0)
    assert world.times_s("restarted", 3)
    assert world.station.vehicles[VehicleId(1, 3)].connection.talks


@pytest.mark.slow
def test_vehicles_whose_timestamps_are_behind_hear_how_late_they_are_and_fly(links: dict[str, Any]) -> None:
    """Nobody's clock has to be right: a station that is ten minutes ahead is received, and then followed."""
    world = World(duration_s=3, links=links)
    signing = world.station.signatures.signing
    assert signing is not None
    for link in signing.links:
        assert link is not None
        link.authentication.timestamp += 10 * A_MINUTE + link.authentication.at(Instant(0))
    world.run()
    assert world.worst_m(0.5) < 0.05
    assert all(each.frames_in > 100 for each in world.station.vehicles.values())
    assert all("receives from us" in each for each in world.words("signing"))


@pytest.mark.parametrize(
    ("endpoint", "policy", "said"),
    [
        ("udpin:127.0.0.1:14550", None, ""),
        ("tcp:[::1]:5760", None, ""),
        ("tcp:localhost:5760", None, ""),
        ("udpin:0.0.0.0:14550", None, "isn't signed: any sender there can fly vehicles 1, 2, 3"),
        ("tcpin:192.168.1.2:5760", None, "isn't signed"),
        ("serial:/dev/ttyUSB0:57600", None, "isn't signed"),
        ("mcast:", None, "isn't signed"),
        ("udpin:0.0.0.0:14550", "refuse", ""),
        ("udpin:0.0.0.0:14550", "accept", "takes unsigned frames: any sender there can speak for vehicles"),
    ],
)
def test_links_that_others_reach_are_named_at_the_start(
    endpoint: str, policy: str | None, said: str, links: dict[str, Any]
) -> None:
    if policy is not None:
        links["default"]["signing"]["unsigned"] = policy
    vehicles = {"count": 3, "endpoint": endpoint}
    found = list(open_links(load_scenario(scenario(vehicles=vehicles, links={} if policy is None else links))))
    assert len(found) == bool(said)
    assert all(said in each for each in found)


@pytest.mark.parametrize(
    ("keys", "place", "found"),
    [
        ({"key_file": "gone.key"}, "links.default.signing.key_file", "No such file"),
        (
            {"key_file": "open.key"},
            "links.default.signing.key_file",
            "mode 0644, which others may use; allowed: a file",
        ),
        ({"key_file": "link.key", "unsigned": "ignore"}, "links.default.signing.unsigned", "allowed: refuse, accept"),
        ({}, "links.default.signing.key_file", "not found; allowed: text"),
    ],
)
def test_what_a_scenario_may_say_of_signing(tmp_path: Path, keys: dict[str, Any], place: str, found: str) -> None:
    for name, mode in (("open.key", 0o644), ("link.key", 0o600)):
        (tmp_path / name).write_text("Schwanensee")
        (tmp_path / name).chmod(mode)
    file = tmp_path / "scenario.yaml"
    file.write_text(yaml.safe_dump(scenario(links={"default": {"signing": keys}})))
    with pytest.raises(ScenarioError) as refused:
        load_scenario(file)
    assert f"{file}:" in str(refused.value)
    assert place in str(refused.value)
    assert found in str(refused.value)
    assert "Schwanensee" not in str(refused.value)


def test_vehicles_on_one_link_are_signed_alike(links: dict[str, Any]) -> None:
    first, second = {"id": 1, "role": "leader"}, {"id": 2, "signing": {"key_file": "none"}}
    with pytest.raises(ScenarioError, match=r"vehicles.1.signing: found another signing at udpin.* one link"):
        load_scenario(scenario(vehicles=[first, second], links=links))


def test_a_flown_scenario_is_read_without_its_key(links: dict[str, Any], fly: Fly, tmp_path: Path) -> None:
    fly(duration_s=1, links=links)
    (tmp_path / "link.key").unlink()
    with pytest.raises(ScenarioError, match="No such file"):
        load_scenario(tmp_path / "run" / "run.yaml")
    load_scenario(tmp_path / "run" / "run.yaml", flown=True)


@pytest.mark.parametrize("keyed", [True, False])
def test_a_forger_takes_a_silent_vehicles_place_only_where_nothing_is_signed(
    links: dict[str, Any], *, keyed: bool
) -> None:
    world = World(duration_s=20, links=links if keyed else {})
    world.fly_to(1.0)
    world.inject(3, "freeze")
    world.attach(world.another(3, signing_key=None))
    world.run(6.0)
    assert bool(world.words("address")) is not keyed
    assert bool(world.times_s("signing", 3, "not signed")) is keyed


@pytest.mark.parametrize("keyed", [True, False])
def test_a_forger_ends_a_flight_that_begins_only_where_nothing_is_signed(links: dict[str, Any], *, keyed: bool) -> None:
    """Two vehicles of one id are a reason not to arm anybody: so may be a forger."""
    world = World(duration_s=3, start={"in_air": False}, links=links if keyed else {})
    world.attach(world.another(3, signing_key=None))
    world.run(4.0)
    assert (world.station.phase_machine.failure is None) is keyed
    assert bool(world.words("duplicate")) is not keyed

"""An emulated vehicle with two links: the same telemetry on both, numbered by each; commands are taken on either."""

from __future__ import annotations

from itertools import pairwise

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import Address, VehicleId, parse_endpoint
from airlink.engine import Datagram
from airlink.frame import Frame, FrameWriter
from airlink.messages.command import CommandAck, CommandLong
from airlink.messages.telemetry import GlobalPositionInt
from airlink.stream_parser import StreamParser
from formation_scenario import load_scenario
from sim_vehicles.cli.fly import _ended
from sim_vehicles.config import VehicleConfig, fleet_config
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import scenario

ENDS = ["udpin:127.0.0.1:14550", "udpout:127.0.0.1:14561"]
GROUND = Address("127.0.0.1", 14550), Address("127.0.0.1", 40000)
TWO = [{"id": 1, "role": "leader"}, {"id": 2, "endpoint": ENDS}]
SOCKETS = 1, 2
"""Of vehicle 2: its first, and the first after those of all vehicles."""


@pytest.fixture
def fleet() -> Fleet:
    return Fleet(
        fleet_config(load_scenario(scenario(vehicles=TWO, path={"waypoints_m": [[0, 0, 100], [4000, 0, 100]]})))
    )


def said(fleet: Fleet, seconds: float, now: Instant) -> dict[int, list[Frame]]:
    """Return what the fleet sends within some time, by socket."""
    end, found, parsers = after(now, seconds), dict[int, list[Frame]](), dict[int, StreamParser]()
    while fleet.next_timer() <= end:
        fleet.handle_timer(fleet.next_timer())
        for sent in fleet.datagrams_to_send():
            found.setdefault(sent.socket, []).extend(parsers.setdefault(sent.socket, StreamParser()).feed(sent.data))
    return found


def command(rate_us: float) -> bytes:
    return FrameWriter(255, 25).encode(CommandLong(2, 1, 511, 0, 33, rate_us))


def test_its_sockets_are_its_own_end_of_each_link(fleet: Fleet) -> None:
    assert fleet.config.sockets_of(1) == SOCKETS
    assert [str(fleet.endpoints()[each]) for each in SOCKETS] == ["udpout:127.0.0.1:14550", "udpin:127.0.0.1:14561"]


def test_both_ends_have_the_same_telemetry_each_with_its_own_numbers(fleet: Fleet) -> None:
    received = said(fleet, 1.0, Instant(0))
    assert SOCKETS[1] not in received, "nobody has been heard at the end that listens"
    now = after(Instant(0), 1.0)
    fleet.receive([Datagram(socket, peer, command(100_000)) for socket, peer in zip(SOCKETS, GROUND, strict=True)], now)
    received = said(fleet, 3.0, now)
    positions = [
        [each.message for each in received[socket] if isinstance(each.message, GlobalPositionInt)] for socket in SOCKETS
    ]
    assert len(positions[0]) > 25
    assert [each.time_boot_s for each in positions[0]] == [each.time_boot_s for each in positions[1]]
    for socket in SOCKETS:
        numbers = [each.sequence for each in received[socket]]
        assert all((after_it - each) % 256 == 1 for each, after_it in pairwise(numbers))
    assert received[SOCKETS[0]][0].sequence != received[SOCKETS[1]][0].sequence


@pytest.mark.parametrize("link", [0, 1])
def test_a_command_is_taken_on_either_and_answered_there(fleet: Fleet, link: int) -> None:
    said(fleet, 1.0, Instant(0))
    now = after(Instant(0), 1.0)
    fleet.receive([Datagram(SOCKETS[link], GROUND[link], command(50_000))], now)
    received = said(fleet, 0.5, now)
    answers = {
        socket: sum(isinstance(each.message, CommandAck) for each in frames) for socket, frames in received.items()
    }
    assert answers[SOCKETS[link]] == 1
    assert answers.get(SOCKETS[1 - link], 0) == 0


def test_two_ends_given_for_one_vehicle_are_its_links(fleet: Fleet) -> None:
    ends = ("all=udpout:127.0.0.1:1", "2=serial:/dev/ttyS1:57600", "2=udpin:127.0.0.1:9")
    one, two = _ended(fleet.config.vehicles, ends)
    assert one.endpoints == (parse_endpoint("udpout:127.0.0.1:1"),)
    assert two.endpoints == (parse_endpoint("serial:/dev/ttyS1:57600"), parse_endpoint("udpin:127.0.0.1:9"))


def test_a_vehicle_has_one_link_by_default() -> None:
    endpoint = parse_endpoint("udpout:127.0.0.1:14550")
    config = VehicleConfig(VehicleId(1, 1), endpoint, fleet_config(load_scenario(scenario())).vehicles[0].start)
    assert config.endpoints == (endpoint,)

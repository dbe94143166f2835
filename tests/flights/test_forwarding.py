"""A second ground station beside ours: it sees every vehicle, commands them, and disturbs nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import VIRTUAL_EPOCH_US, Instant, after
from airlink.endpoint import Address, ComponentId, Endpoint, VehicleId, parse_endpoint
from airlink.engine import Datagram, Engine
from airlink.forwarding import FORGOTTEN_S, Forward, Forwarding, Remote
from airlink.frame import FrameWriter
from airlink.messages import Message
from airlink.messages.command import CommandAck, CommandInt, CommandLong, RequestDataStream
from airlink.messages.system import Heartbeat, SetupSigning
from airlink.signing.authentication import Authentication
from airlink.signing.key import SigningKey, read_key, write_new_key
from airlink.signing.signed_links import SignedLink, VerifyingReceiver
from airlink.stream_parser import StreamParser
from gcs_formation.station import Station
from gcs_formation.vehicle.autopilot_family import STATION
from sim_vehicles.autopilot.modes_and_failsafe import Mode
from tests.flights.in_memory import World

HERE = parse_endpoint("udpin:127.0.0.1:14660")
MAVPROXY = ComponentId(255, 230)
HEARTBEAT = Heartbeat(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID)


class Second(Engine):
    """A ground station at a forward: it keeps what it receives, and sends its heartbeat and what it is told to."""

    def __init__(self, ids: ComponentId = MAVPROXY, key: SigningKey | None = None) -> None:
        self.signed = None if key is None else SignedLink(Authentication(key, VIRTUAL_EPOCH_US))
        self.received, self.acknowledged = dict[int, int](), list[CommandAck]()
        self._writer, self._parser, self._out = FrameWriter(*ids), StreamParser(), list[Datagram]()
        self._next = Instant(0)

    def say(self, message: Message) -> None:
        raw = self._writer.encode(message)
        self._out.append(Datagram(0, HERE.address, raw if self.signed is None else self.signed.seal(raw, self._next)))

    def endpoints(self) -> tuple[Endpoint, ...]:
        return (HERE.opposite(),)

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        for datagram in datagrams:
            for frame in self._parser.feed(datagram.data):
                self.received[frame.system] = self.received.get(frame.system, 0) + 1
                if isinstance(frame.message, CommandAck):
                    self.acknowledged.append(frame.message)

    def datagrams_to_send(self) -> list[Datagram]:
        out, self._out = self._out, []
        return out

    def next_timer(self) -> Instant | None:
        return self._next

    def handle_timer(self, now: Instant) -> None:
        self._next = after(now, 1.0)
        self.say(HEARTBEAT)


class Beside:
    """A flight with a second ground station."""

    def __init__(
        self, *, takes: bool = True, ids: ComponentId = MAVPROXY, key: SigningKey | None = None, **keys: Any
    ) -> None:
        self.joined = list[ComponentId]()

        def around(engine: Engine, station: Station) -> Engine:
            def remotes() -> list[Remote]:
                links = [(each.identity.system, each.connection) for each in station.vehicles.values()]
                return [Remote(system, link.socket, link.peer) for system, link in links if link.peer]

            def join(sender: ComponentId, _peer: Address, _now: Instant) -> None:
                self.joined.append(sender)

            ids, forwards = station.scenario.station.ids, (Forward(HERE, takes),)
            signing = station.signatures.signing
            if signing is None:
                return Forwarding(engine, forwards, remotes, ids, join)
            passed = VerifyingReceiver(signing.copied()).passed
            return Forwarding(engine, forwards, remotes, ids, join, passed)

        self.world, self.second = World(around=around, **keys), Second(ids, key)
        self.world.attach(self.second)


def test_it_sees_every_vehicle_and_is_reported_once() -> None:
    beside = Beside(duration_s=3)
    beside.world.run()
    assert beside.joined == [MAVPROXY]
    assert sorted(beside.second.received) == [1, 2, 3]
    frames = {vehicle.identity.system: vehicle.frames_in for vehicle in beside.world.station.vehicles.values()}
    for system, count in beside.second.received.items():
        assert count > 0.5 * frames[system]
    assert all(each.target_component != STATION.component for each in beside.second.acknowledged)
    assert beside.world.worst_m(0.5) < 0.05


def test_what_it_commands_is_a_pilots_choice_and_its_answer_comes_back() -> None:
    beside = Beside(duration_s=20)
    world = beside.world
    world.fly_to(3.0)
    beside.second.say(CommandLong(3, 1, m.MAV_CMD_DO_SET_MODE, 0, 1.0, float(Mode.LOITER)))
    world.run(3.0)
    assert world.vehicle(3).pilot.mode is Mode.LOITER
    assert [each.result for each in beside.second.acknowledged] == [m.MAV_RESULT_ACCEPTED]
    assert any("pilot" in text for text in world.words("member"))
    beside.second.say(CommandLong(3, 1, m.MAV_CMD_DO_SET_MODE, 0, 1.0, float(Mode.GUIDED)))
    world.run(3.0)
    assert world.words("member")[-1] == "flying in formation"


@pytest.mark.parametrize("takes", [True, False])
def test_it_cannot_change_rates_hold_off_the_failsafe_or_command_where_it_only_sees(*, takes: bool) -> None:
    beside = Beside(takes=takes, duration_s=6, ids=ComponentId(255, 190))
    world = beside.world
    world.fly_to(2.0)
    beside.second.say(RequestDataStream(2, 1, m.MAV_DATA_STREAM_ALL, 1, 1))
    interval = m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
    beside.second.say(CommandLong(2, 1, m.MAV_CMD_SET_MESSAGE_INTERVAL, 0, float(interval), 1e6))
    beside.second.say(CommandInt(2, 1, m.MAV_FRAME_GLOBAL, m.MAV_CMD_GUIDED_CHANGE_SPEED, param1=77.0))
    world.run(3.0)
    assert world.words("streams") == world.words("own_id") == world.words("disobeys") == []
    assert bool(beside.joined) is True
    asked = [each for each in beside.second.acknowledged if each.command == m.MAV_CMD_SET_MESSAGE_INTERVAL]
    assert asked == []
    assert world.worst_m(0.5) < 0.05


@pytest.mark.parametrize("keyed", [True, False])
def test_on_signed_links_it_commands_with_the_key_alone_and_sees_nothing_forged(*, keyed: bool, tmp_path: Path) -> None:
    """What it sends without a signature isn't given one: vehicles refuse it."""
    write_new_key(tmp_path / "link.key")
    key, links = read_key(tmp_path / "link.key"), {"default": {"signing": {"key_file": str(tmp_path / "link.key")}}}
    beside = Beside(duration_s=6, key=key if keyed else None, links=links)
    world = beside.world
    world.fly_to(1.0)
    beside.second.say(CommandLong(3, 1, m.MAV_CMD_DO_SET_MODE, 0, 1.0, float(Mode.LOITER)))
    beside.second.say(SetupSigning(3, 1, (7,) * 32, 1))
    world.run(1.5)
    refused = world.vehicle(3).link.signed.judged.get(MAVPROXY.system)
    assert (world.vehicle(3).pilot.mode is Mode.LOITER) is keyed
    assert bool(refused and refused.refused) is not keyed
    assert sorted(beside.second.received) == [1, 2, 3]
    received = dict(beside.second.received)
    vehicle = world.station.vehicles[VehicleId(1, 2)].connection
    assert vehicle.peer is not None
    forged = Datagram(vehicle.socket, vehicle.peer, FrameWriter(2, 1).encode(HEARTBEAT))
    world.process.receive([forged] * 1000, world.clock.now())
    world.run(0.2)
    assert beside.second.received[2] - received[2] < 200


def test_a_key_isnt_passed_on() -> None:
    beside = Beside(duration_s=2)
    beside.world.fly_to(0.5)
    beside.second.say(SetupSigning(3, 1, (7,) * 32, 1))
    beside.world.run(0.5)
    assert beside.world.words("statustext") == []
    assert beside.world.vehicle(3).link.signed is None


def test_one_that_has_gone_is_sent_nothing_more() -> None:
    forwarding = Forwarding(World(duration_s=1).station, (Forward(HERE, takes=True),), list, MAVPROXY, lambda *_: None)
    vehicle, peer = Address("127.0.0.1", 9), Address("127.0.0.1", 10)
    forwarding._remotes = lambda: [Remote(1, 0, vehicle)]
    heartbeat = FrameWriter(1, 1).encode(HEARTBEAT)

    def sent(at_s: float) -> list[Datagram]:
        forwarding.receive([Datagram(0, vehicle, heartbeat)], after(Instant(0), at_s))
        return [each for each in forwarding.datagrams_to_send() if each.socket == 1]

    assert sent(0.0) == []
    forwarding.receive([Datagram(1, peer, FrameWriter(254, 1).encode(HEARTBEAT))], after(Instant(0), 1.0))
    assert [each.peer for each in sent(1.0 + 0.9 * FORGOTTEN_S)] == [peer]
    assert sent(1.0 + 1.1 * FORGOTTEN_S) == []

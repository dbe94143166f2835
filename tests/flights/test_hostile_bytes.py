"""A stranger on the network throws bytes at a ground station and at vehicles in flight."""

from __future__ import annotations

import random

import numpy as np
import pytest

from airlink.clock import Instant, VirtualClock, after
from airlink.endpoint import LOOPBACK, Address, Endpoint
from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.identity import VehicleId
from airlink.memory import FIRST_EPHEMERAL_PORT, MemoryNetwork
from airlink.messages import Attitude, CommandAck, GlobalPositionInt, Heartbeat, Statustext, Timesync
from formation_scenario import load_scenario
from gcs_formation.records import Event, Tick
from gcs_formation.station import Station
from sim_vehicles.fleet import Fleet
from sim_vehicles.from_scenario import fleet_config
from tests.flights.conftest import scenario

THROWS_A_TURN = 6
TURN_S = 0.02


class Notes:
    """A recorder in memory."""

    def __init__(self) -> None:
        self.ticks: list[Tick] = []
        self.events: list[Event] = []

    def frame(self, now: Instant, raw: bytes) -> None:
        """Keep nothing."""

    def tick(self, tick: Tick) -> None:
        self.ticks.append(tick)

    def event(self, event: Event) -> None:
        self.events.append(event)


class Stranger:
    """An engine that throws datagrams at addresses: noise, broken frames, and sound frames of systems nobody knows."""

    def __init__(self, targets: list[Address], seed: int) -> None:
        self._targets = targets
        self._random = random.Random(seed)
        self._writers = [FrameWriter(system, 1) for system in (0, 99, 200, 254, 255)]
        self._next = Instant(0)
        self._out: list[Datagram] = []
        self.thrown = 0

    def endpoints(self) -> tuple[Endpoint, ...]:
        return tuple(Endpoint("udpout", target) for target in self._targets)

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Listen to nothing."""

    def datagrams_to_send(self) -> list[Datagram]:
        out, self._out = self._out, []
        return out

    def next_timer(self) -> Instant:
        return self._next

    def handle_timer(self, now: Instant) -> None:
        self._next = after(now, TURN_S)
        for socket, target in enumerate(self._targets):
            for _ in range(THROWS_A_TURN):
                self._out.append(Datagram(socket, target, self._bytes()))
                self.thrown += 1

    def _bytes(self) -> bytes:
        choice = self._random.randrange(4)
        if choice == 0:
            return self._random.randbytes(self._random.randrange(300))
        frame = self._frame()
        if choice == 1:
            return frame
        if choice == 2:
            return frame[: self._random.randrange(len(frame))]
        place = self._random.randrange(len(frame))
        return frame[:place] + bytes([frame[place] ^ (1 << self._random.randrange(8))]) + frame[place + 1 :]

    def _frame(self) -> bytes:
        writer = self._random.choice(self._writers)
        extreme = self._random.choice((0.0, -1e30, 1e30, float("nan"), float("inf")))
        message = self._random.choice(
            (
                Heartbeat(1, 3, 0, 15, 4),
                Attitude(extreme, extreme, extreme, extreme, extreme, extreme, extreme),
                GlobalPositionInt(1.0, 9.0, -9.0, 1e9, 1e9, 300.0, -300.0, 99.0, 1.0),
                CommandAck(43000, 4, 255, -1, 255, 190),
                Timesync(-1, 0),
                Statustext(0, "\x00\xff\x1b[2J"),
            )
        )
        return writer.encode(message)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_flight_does_not_notice(seed: int) -> None:
    planned = load_scenario(scenario(duration_s=20))
    clock, notes = VirtualClock(), Notes()
    network, station = MemoryNetwork(clock), Station(planned, notes)
    network.attach(Fleet(fleet_config(planned)))
    network.attach(station)
    vehicles = [Address(LOOPBACK, FIRST_EPHEMERAL_PORT + i) for i in range(3)]
    stranger = Stranger([station.endpoints()[0].address, *vehicles], seed)
    network.attach(stranger)
    network.run(lambda: station.flight.ended)
    assert stranger.thrown > 20_000
    errors = np.concatenate([tick.error_m[1:] for tick in notes.ticks if tick.mission_time_s > 5])
    assert np.abs(errors).max() < 0.1
    assert {str(event.vehicle) for event in notes.events if event.kind == "stranger"} == {"None"}
    assert sum(event.kind == "stranger" for event in notes.events) <= 5


def test_broken_frames_are_counted_for_the_vehicle_they_came_from() -> None:
    station = Station(load_scenario(scenario(duration_s=5)), Notes())
    peer, writer = Address(LOOPBACK, 40000), FrameWriter(2, 1)
    station.receive(Datagram(0, peer, writer.encode(Heartbeat(1, 3))), Instant(0))
    for _ in range(3):
        broken = bytearray(writer.encode(Heartbeat(1, 3)))
        broken[12] ^= 0x10
        station.receive(Datagram(0, peer, bytes(broken)), Instant(0))
    assert station.bad_frames(VehicleId(1, 2)) == 3

"""Every field of every message takes its extremes: NaN, infinities, the ends of its range; at both ends, in flight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, VirtualClock
from airlink.endpoint import LOOPBACK, Address
from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.identity import VehicleId
from airlink.mavlink import Layout
from airlink.memory import FIRST_EPHEMERAL_PORT, MemoryNetwork
from airlink.messages import RequestDataStream, SetMode
from gcs_formation.station import Station
from gcs_formation.vehicle.vehicle import STATION_COMPONENT, STATION_SYSTEM
from sim_vehicles.commands import HANDLERS
from sim_vehicles.fleet import Fleet
from sim_vehicles.from_scenario import fleet_config
from tests.fuzz.frames import LAYOUTS, Header, extreme_payloads, framed
from tests.fuzz.siege import Flown, Notes, check, planned

FOLLOWER = VehicleId(1, 2)
USUAL = {"target_system": FOLLOWER.system, "target_component": 1, "tc1": 1, "base_mode": 209, "custom_mode": 15}
TURN_S = 0.02


class Flight:
    """A formation in flight, in memory, that can be told things between its turns."""

    def __init__(self) -> None:
        plan = planned(600)
        self.notes, self.clock = Notes(), VirtualClock()
        self.station, self.fleet = Station(plan, self.notes), Fleet(fleet_config(plan))
        self._network = MemoryNetwork(self.clock)
        self._network.attach(self.fleet)
        self._network.attach(self.station)
        self.run(12)

    def run(self, seconds: float) -> None:
        """Fly on."""
        until = self.clock.now() + round(seconds * NANOSECONDS)
        self._network.run(lambda: self.clock.now() >= until)

    def tell_station(self, frame: bytes) -> None:
        """Let the follower's own autopilot say something."""
        peer = Address(LOOPBACK, FIRST_EPHEMERAL_PORT + FOLLOWER.system - 1)
        self.station.receive(Datagram(0, peer, frame), self.clock.now())

    def tell_vehicle(self, frame: bytes) -> None:
        """Let the ground station say something to the follower."""
        ground = self.station.endpoints()[0].address
        self.fleet.receive(Datagram(FOLLOWER.system - 1, ground, frame), self.clock.now())

    def probe(self) -> int:
        """Return the stamp of the last probe to the follower."""
        return next(reversed(self.station.vehicles[FOLLOWER]._probes), 0)

    def check(self) -> None:
        """Hold it to what no datagram may break."""
        check(Flown(self.station, self.fleet, self.notes, 0, 0, 0, (0, 0)))

    def flies_on(self) -> None:
        """Check that the formation is commanded: one follower in its slot, the other there or on its way back to it."""
        self.run(60)
        self.check()
        assert not self.station.flight.ended
        before, now = (np.abs(self.notes.errors_m[place]).max(axis=1) for place in (-20, -1))
        assert now[1] < 0.5
        assert now[0] < max(0.5, before[0] - 5.0)


def payloads(layout: Layout, probe: int) -> Iterator[bytes]:
    """Yield a message's payloads, those of a command for every command that vehicles know."""
    usual = {field: value for field, value in (USUAL | {"ts1": probe}).items() if field in layout.fields}
    commands = HANDLERS if "command" in layout.fields else (0,)
    for command in commands:
        yield from extreme_payloads(layout, usual | {"command": command})


@pytest.mark.slow
def test_no_value_that_a_vehicle_tells_breaks_the_flight() -> None:
    flight = Flight()
    for layout in LAYOUTS:
        for payload in payloads(layout, flight.probe()):
            flight.tell_station(framed(layout.message_id, payload, Header(FOLLOWER.system)))
            flight.run(TURN_S)
        flight.check()
    assert flight.station.vehicles[FOLLOWER].frames_implausible > 20
    flight.flies_on()


@pytest.mark.slow
def test_no_value_that_a_vehicle_is_told_breaks_the_flight() -> None:
    flight = Flight()
    for layout in LAYOUTS:
        for payload in payloads(layout, 0):
            flight.tell_vehicle(framed(layout.message_id, payload, Header(STATION_SYSTEM, STATION_COMPONENT)))
            flight.run(TURN_S)
        flight.check()
    # Some of it was sound, and obeyed: no telemetry, other modes.
    writer = FrameWriter(STATION_SYSTEM, STATION_COMPONENT)
    streams = RequestDataStream(FOLLOWER.system, 1, m.MAV_DATA_STREAM_ALL, 10, 1)
    flight.tell_vehicle(writer.encode(streams))
    flight.tell_vehicle(
        writer.encode(SetMode(FOLLOWER.system, m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, m.PLANE_MODE_GUIDED))
    )
    flight.flies_on()

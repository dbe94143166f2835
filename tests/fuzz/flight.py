"""A formation in flight, in memory, that can receive messages between its cycles."""

from __future__ import annotations

import numpy as np

from airlink.clock import NANOSECONDS, VirtualClock
from airlink.endpoint import LOOPBACK, Address, VehicleId
from airlink.engine import FIRST_EPHEMERAL_PORT, Datagram, MemoryNetwork
from gcs_formation.station import Station
from sim_vehicles.autopilot.autopilot import Autopilot
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet
from tests.fuzz.siege import Flown, MemoryRecorder, check, planned

FOLLOWER = VehicleId(1, 2)
USUAL = {"target_system": FOLLOWER.system, "target_component": 1, "tc1": 1, "base_mode": 209, "custom_mode": 15}


class Flight:
    """A leader and two followers, on their path after 6 s."""

    def __init__(self, age_s: float = 12.0) -> None:
        plan = planned(600)
        self.recorder, self.clock = MemoryRecorder(), VirtualClock()
        self.station, self.fleet = Station(plan, self.recorder), Fleet(fleet_config(plan))
        self._network = MemoryNetwork(self.clock)
        self._network.attach(self.fleet)
        self._network.attach(self.station)
        self.run(age_s)

    def run(self, seconds: float) -> None:
        """Fly on."""
        until = self.clock.now() + round(seconds * NANOSECONDS)
        self._network.run(lambda: self.clock.now() >= until)

    def tell_station(self, frame: bytes) -> None:
        """Send a message in the name of the follower's own autopilot to the station."""
        peer = Address(LOOPBACK, FIRST_EPHEMERAL_PORT + FOLLOWER.system - 1)
        self.station.receive([Datagram(0, peer, frame)], self.clock.now())

    @property
    def follower(self) -> Autopilot:
        """The follower's own autopilot."""
        return self.fleet.vehicles[FOLLOWER.system - 1]

    def next_number(self) -> int:
        """Return the sequence number of the follower's next frame to the station, and count it as sent."""
        (writer,) = (peer.writer for peer in self.follower.link._peers.values())
        number = int(writer._sequence)
        writer._sequence = (number + 1) % 256
        return number

    def tell_vehicle(self, frame: bytes) -> None:
        """Send a message in the name of the ground station to the follower."""
        ground = self.station.endpoints()[0].address
        self.fleet.receive([Datagram(FOLLOWER.system - 1, ground, frame)], self.clock.now())

    def probe(self) -> int:
        """Return the time stamp of the last probe to the follower."""
        return next(reversed(self.station.vehicles[FOLLOWER].round_trips._pending), 0)

    def check(self) -> None:
        """Check what no datagram may break."""
        check(Flown(self.station, self.fleet, self.recorder, 0, 0, 0, (0, 0)))

    def flies_on(self) -> None:
        """Check that the formation is commanded: one follower in its slot, the other there or on its way back."""
        self.run(60)
        self.check()
        assert not self.station.flight.ended
        # From the side it flies to the leader's track first and falls back meanwhile: the sum of errors shows the way.
        before, now = (np.abs(self.recorder.errors_m[place]).sum(axis=1) for place in (-20, -1))
        assert now[1] < 0.5
        assert now[0] < max(0.5, before[0] - 5.0)

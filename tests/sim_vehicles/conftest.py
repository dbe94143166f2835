"""A ground station made with pymavlink, an independent implementation, connected to a fleet by hand."""

import importlib
import math
from typing import Any

import pytest

from airlink.endpoint import Address, VehicleId, parse_endpoint
from airlink.engine import Datagram
from flight_model.earth import GeodeticOrigin
from formation_scenario.start_states import StartState
from formation_scenario.vehicles import Vehicle, family_of
from sim_vehicles.config import FleetConfig, VehicleConfig
from sim_vehicles.fleet import Fleet

mavlink = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
GROUND = Address("127.0.0.1", 14550)
GROUND_SYSTEM, GROUND_COMPONENT = 255, 190
LOOP_S = 0.02


class Peer:
    """pymavlink at one address: encodes frames, and keeps received messages as (seconds, message)."""

    def __init__(self, fleet, address=GROUND, system=GROUND_SYSTEM, component=GROUND_COMPONENT):
        self.fleet, self.address = fleet, address
        self.dialect = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self.parser = mavlink.MAVLink(None)
        self.parser.robust_parsing = True
        self.received = []

    def send(self, message, vehicle=0):
        self.send_bytes(message.pack(self.dialect), vehicle)

    def send_bytes(self, data, vehicle=0):
        self.fleet.receive([Datagram(vehicle, self.address, data)], self.fleet.next_timer())

    def receive(self, data, seconds):
        self.received += [(seconds, message) for message in self.parser.parse_buffer(data) or []]

    def of(self, name, system=None):
        return [
            message
            for _, message in self.received
            if message.get_type() == name and system in (None, message.get_srcSystem())
        ]


class Air:
    """A fleet and its peers, run cycle by cycle of the main loop."""

    def __init__(self, config):
        self.fleet = Fleet(config)
        self.seconds = 0.0
        self.sent = []
        self.peers = {}
        self.ground = self.peer()

    def peer(self, address=GROUND, **identity):
        self.peers[address] = Peer(self.fleet, address, **identity)
        return self.peers[address]

    def run(self, seconds):
        for _ in range(round(seconds / LOOP_S)):
            now = self.fleet.next_timer()
            self.fleet.handle_timer(now)
            self.seconds = now / 1e9
            for datagram in self.fleet.datagrams_to_send():
                self.sent.append((now, datagram))
                if datagram.peer in self.peers:
                    self.peers[datagram.peer].receive(datagram.data, self.seconds)

    def run_until(self, holds, limit_s):
        while not holds():
            assert self.seconds < limit_s
            self.run(LOOP_S)

    def send_mission_time(self, seconds, vehicle=0):
        self.ground.send(self.ground.dialect.named_value_float_encode(0, b"MISSION_T", seconds), vehicle)

    def command_int(self, command, *params, frame=3, x=0, y=0, z=0.0, target=1, component=1, vehicle=0, peer=None):
        """Send COMMAND_INT, run a cycle, and return the MAV_RESULT; None if there was no answer."""
        p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
        message = mavlink.MAVLink_command_int_message(target, component, frame, command, 0, 0, p1, p2, p3, p4, x, y, z)
        return self._result(message, command, vehicle, peer or self.ground)

    def command_long(self, command, *params, target=1, component=1, vehicle=0, peer=None):
        """Send COMMAND_LONG, run a cycle, and return the MAV_RESULT; None if there was no answer."""
        values = (*params, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[:7]
        message = mavlink.MAVLink_command_long_message(target, component, command, 0, *values)
        return self._result(message, command, vehicle, peer or self.ground)

    def _result(self, message, command, vehicle, peer):
        before = len(peer.of("COMMAND_ACK"))
        peer.send(message, vehicle)
        self.run(LOOP_S)
        answers = peer.of("COMMAND_ACK")[before:]
        assert all(answer.command == command for answer in answers)
        assert len(answers) <= 1
        return answers[0].result if answers else None

    def set_mode(self, mode, **where):
        return self.command_long(mavlink.MAV_CMD_DO_SET_MODE, 1, mode, **where)

    def state(self, name, vehicle=0):
        return getattr(self.fleet.bodies[vehicle].state, name)


def fleet_config(count=1, *, in_air=True, endpoint="udpout:127.0.0.1:14550", separation_m=100.0, **changes):
    """Return vehicles abreast, heading north, 100 m up at 22 m/s or standing on the ground."""
    vehicle_keys: dict[str, Any] = {key: changes.pop(key) for key in ("model", "clock", "navigation") if key in changes}
    if "model" in vehicle_keys:
        vehicle_keys["family"] = family_of(Vehicle(id=1, model=vehicle_keys["model"]))
    vehicles = tuple(
        VehicleConfig(
            VehicleId(1, 1 + i),
            parse_endpoint(endpoint),
            StartState(0.0, separation_m * i, 100.0 if in_air else 0.0, 0.0, 22.0 if in_air else 0.0, in_air),
            **vehicle_keys,
        )
        for i in range(count)
    )
    origin = GeodeticOrigin(math.radians(35), math.radians(125), changes.pop("origin_alt_m", 0.0))
    return FleetConfig(origin, vehicles, **changes)


@pytest.fixture(scope="session")
def make_air_for_any_bytes():
    """Return a factory of flying vehicles in GUIDED, for tests that hypothesis repeats."""

    def make():
        return Air(fleet_config())

    return make


@pytest.fixture
def make_air():
    """Return a factory of fleets with a ground station."""

    def make(count=1, **keys):
        return Air(fleet_config(count, **keys))

    return make


@pytest.fixture
def flying(make_air):
    """One vehicle in the air, in GUIDED."""
    air = make_air()
    air.run(0.1)
    assert air.set_mode(15) == 0
    return air


@pytest.fixture
def parked(make_air):
    """One vehicle on the ground, ready to be armed."""
    air = make_air(in_air=False)
    air.run(3.1)
    return air

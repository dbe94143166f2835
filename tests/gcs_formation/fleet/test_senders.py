"""Which vehicle sent a frame."""

from __future__ import annotations

import math

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address, VehicleId
from airlink.engine import Datagram
from airlink.frame import Frame, FrameWriter
from airlink.messages import Message
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude
from airlink.stream_parser import ParserCounts
from flight_model.earth import GeodeticOrigin
from gcs_formation.fleet.flood_watch import FloodWatch
from gcs_formation.fleet.senders import Senders
from gcs_formation.link.link_health import Connection
from gcs_formation.phases import Flight, Phase
from gcs_formation.vehicle.autopilot_family import STATION
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.vehicle import Vehicle
from tests.gcs_formation.event_log import EventLog, GivenUp

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
PLANE = Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA)
COMPANION = Heartbeat(m.MAV_TYPE_ONBOARD_CONTROLLER, m.MAV_AUTOPILOT_INVALID)
HERE, THERE = 40000, 50000
FIRST, SECOND = VehicleId(1, 2), VehicleId(2, 2)


class Ground:
    """Two networks, a socket each, with a vehicle 2 in both."""

    def __init__(self, phase: Phase) -> None:
        plane = ArduPlane(2, ORIGIN, 0.25)
        self.vehicles = {
            identity: Vehicle(identity, socket, plane, Connection(socket), 10.0)
            for socket, identity in enumerate((FIRST, SECOND))
        }
        self.logged, self.given_up = EventLog(), GivenUp()
        self.writers = dict[tuple[int, int], FrameWriter]()
        self.identities = Senders(self.vehicles, (1, 2), Flight(phase), self.logged, self.given_up)

    def receive(
        self, message: Message, system: int = 2, component: int = 1, port: int = HERE, socket: int = 0, at_s: float = 0
    ) -> Vehicle | None:
        """Receive a frame; let its vehicle take it."""
        writer = self.writers.setdefault((port, socket), FrameWriter(system, component))
        for _ in range(port % 7):  # each sender counts otherwise
            writer.encode(message)
        now, raw = after(Instant(0), at_s), writer.encode(message)
        frame = Frame(system, component, 0, message.kind().message_id, 2, message, raw)
        sender = self.identities.sender(frame, Datagram(socket, Address("127.0.0.1", port), b""), now)
        if sender:
            sender.connection.record_frame(now, heartbeat=isinstance(message, Heartbeat))
        return sender


@pytest.fixture
def ground() -> Ground:
    return Ground(Phase.FLYING)


def test_one_id_in_two_networks_is_two_vehicles(ground: Ground) -> None:
    assert ground.receive(PLANE, socket=0) is ground.vehicles[FIRST]
    assert ground.receive(PLANE, socket=1) is ground.vehicles[SECOND]
    assert ground.logged == []


@pytest.mark.parametrize(
    ("system", "kind", "words"),
    [
        (0, "stranger", "system 0 is heard, but is the broadcast address and no vehicle's id"),
        (9, "stranger", "system 9 is heard, but isn't in the scenario"),
        (
            STATION.system,
            "own_id",
            "another ground station, 255/1, has our system id; its heartbeats hold off the vehicles' failsafe",
        ),
    ],
)
def test_who_is_not_ours_is_reported_once_by_its_heartbeat(ground: Ground, system: int, kind: str, words: str) -> None:
    assert ground.receive(Attitude(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), system) is None
    assert ground.logged == []
    for _ in range(3):
        assert ground.receive(PLANE, system) is None
    (said,) = ground.logged.of(kind)
    assert said.startswith(words)
    assert ground.receive(PLANE, 9, socket=1) is None
    assert any("system 2:9" in said for said in ground.logged.of("stranger")), "a stranger in each network is another"


def test_a_vehicle_s_other_components_and_companions_say_nothing_of_its_autopilot(ground: Ground) -> None:
    assert ground.receive(PLANE, component=191) is None
    assert ground.receive(COMPANION) is None
    assert ground.vehicles[FIRST].connection.peer is None
    assert ground.logged == []


@pytest.mark.parametrize(("phase", "ends"), [(Phase.CONNECTING, True), (Phase.FLYING, False)])
def test_two_with_one_id_are_not_taken_off_and_the_second_is_ignored_in_flight(phase: Phase, ends: bool) -> None:
    ground = Ground(phase)
    for tenth in range(20):
        assert ground.receive(PLANE, at_s=0.1 * tenth) is ground.vehicles[FIRST]
        assert ground.receive(PLANE, port=THERE, at_s=0.1 * tenth) is None
    (said,) = ground.logged.of("duplicate", 2)
    assert said == "another sender has its system id, from 127.0.0.1:50000, beside 127.0.0.1:40000; it is ignored"
    names = f"vehicle 2: {said}; allowed: each id once. If it is one vehicle with two links, name both: "
    assert ground.given_up == ([names + "endpoint: [A, B]"] if ends else [])


def test_one_that_has_moved_is_the_same_and_its_sequence_numbers_begin_again(ground: Ground) -> None:
    vehicle = ground.vehicles[FIRST]
    ground.receive(PLANE)
    vehicle.sequence.observe(200, Instant(0), Instant(0))
    while vehicle.connection.check(after(Instant(0), 6.0)):
        pass
    assert ground.receive(PLANE, port=THERE, at_s=6.0) is vehicle
    vehicle.sequence.observe(3, after(Instant(0), 6.0), Instant(0))
    assert vehicle.sequence.lost == 0
    (said,) = ground.logged.of("address", 2)
    assert said.startswith("is heard from 127.0.0.1:50000; 127.0.0.1:40000 fell silent 6.0 s ago")
    assert ground.given_up == []


@pytest.mark.parametrize(
    ("garbage_bytes", "frames", "said"), [(3_500_000, 0, "3500 kB of no frame and 0 frames"), (0, 4000, "4000 frames")]
)
def test_a_flood_is_reported_once_and_when_it_is_over(garbage_bytes: int, frames: int, said: str) -> None:
    """Otherwise missing telemetry would look like the vehicles' own failure."""
    logged = EventLog()
    flood, garbage, refused = FloodWatch(logged), 0, 0
    for at_s in range(20):
        share = 1.0 if 5 <= at_s < 12 else 0.01
        garbage, refused = garbage + round(share * garbage_bytes), refused + round(share * frames)
        flood.compare(after(Instant(0), float(at_s)), ParserCounts(garbage_bytes=garbage), refused)
    begun, over = logged.of("flood")
    assert said in begun
    assert "frames of vehicles may be lost" in begun
    assert over == "is over"

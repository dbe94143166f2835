"""Which sender is a vehicle: second vehicles with its id, new addresses, restarts, and our own frames."""

from __future__ import annotations

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import LOOPBACK, Address, Endpoint, VehicleId
from airlink.engine import Datagram
from airlink.frame import HEADER_V2, FrameWriter
from airlink.messages.command import CommandInt
from airlink.messages.system import Heartbeat, Statustext
from formation_scenario import load_scenario
from formation_scenario.vehicles import VehicleClock
from gcs_formation.phases import Phase
from gcs_formation.station import Station
from gcs_formation.vehicle.autopilot_family import STATION
from sim_vehicles.autopilot.modes_and_failsafe import Condition
from sim_vehicles.fleet import Fleet
from tests.flights.conftest import scenario
from tests.flights.in_memory import Between, MemoryRecorder, World

PLANE = Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA)


class Moving(Between):
    """A fleet that sends from other ports once it has moved, as behind a router that forgot its bindings."""

    moved = False

    def endpoints(self) -> tuple[Endpoint, ...]:
        return self.fleet.endpoints() * 2

    def take(self, datagram: Datagram, now: Instant) -> None:
        count = len(self.fleet.vehicles)
        if self.moved == (datagram.socket >= count):
            self.fleet.receive([Datagram(datagram.socket % count, datagram.peer, datagram.data)], now)

    def datagrams_to_send(self) -> list[Datagram]:
        shift = len(self.fleet.vehicles) if self.moved else 0
        return [Datagram(each.socket + shift, each.peer, each.data) for each in super().datagrams_to_send()]


class Echoing(Between):
    """Sends back to the sender what a vehicle is sent, and lets vehicles hear their own messages."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._back: list[Datagram] = []

    def take(self, datagram: Datagram, now: Instant) -> None:
        self._back.append(Datagram(datagram.socket, datagram.peer, datagram.data))
        super().take(datagram, now)

    def datagrams_to_send(self) -> list[Datagram]:
        sent, (back, self._back) = super().datagrams_to_send(), (self._back, [])
        for each in sent:
            self.fleet.receive([Datagram(each.socket, each.peer, each.data)], Instant(0))
        return [*sent, *back]


class Routing(Between):
    """A router: vehicle 2 and, once it exists, another with the same id have one address."""

    other: Fleet | None = None

    def take(self, datagram: Datagram, now: Instant) -> None:
        super().take(datagram, now)
        if self.other and datagram.socket == 1:
            self.other.receive([Datagram(0, datagram.peer, datagram.data)], now)

    def handle_timer(self, now: Instant) -> None:
        super().handle_timer(now)
        if self.other:
            self.other.handle_timer(now)

    def datagrams_to_send(self) -> list[Datagram]:
        others = self.other.datagrams_to_send() if self.other else []
        return [*super().datagrams_to_send(), *(Datagram(1, each.peer, each.data) for each in others)]


def test_two_vehicles_with_one_id_are_not_taken_off() -> None:
    world = World(start={"in_air": False})
    world.attach(world.another(2))
    world.run()
    assert world.station.flight.phase is Phase.FAILED
    assert world.now_s < 5.0
    assert world.station.phase_machine.failure
    assert "vehicle 2: another sender has its system id, from 127.0.0.1:49155, beside 127.0.0.1:49153" in (
        world.station.phase_machine.failure
    )
    assert all(vehicle.pilot.condition is Condition.DISARMED for vehicle in world.fleet.vehicles)


def test_in_flight_a_second_vehicle_with_the_same_id_is_reported_and_ignored() -> None:
    world = World(duration_s=10)
    world.fly_to(3.0)
    twin = world.another(2)
    world.attach(twin)
    begun_s = world.now_s
    world.run()
    assert world.worst_m() < 0.05
    (reported_s,) = world.times_s("duplicate", 2)
    assert 1.0 <= reported_s - begun_s < 2.5
    assert not world.times_s("address")
    assert twin.vehicles[0].link._senders == []  # nothing was ever sent to it
    taken = sum(vehicle.frames_in for vehicle in world.station.vehicles.values())
    assert world.station.received().frames - taken == world.station.frames_refused > 100


@pytest.mark.slow
def test_two_vehicles_behind_one_address_are_distinguished_by_their_clocks() -> None:
    world = World(Routing, duration_s=12)
    world.fly_to(3.0)
    assert isinstance(world.between, Routing)
    world.between.other = world.another(2, clock=VehicleClock(offset_s=500.0))
    begun_s = world.now_s
    world.run()
    (reported_s,) = world.times_s("duplicate", 2, "from the same address, its clock is another's")
    assert reported_s - begun_s < 3.0
    assert world.times_s("restarted") == []
    assert world.worst_m() < 0.05


@pytest.mark.slow
def test_a_vehicle_heard_from_another_port_is_the_same_when_its_clock_goes_on() -> None:
    world = World(Moving, duration_s=13)
    world.fly_to(6.0)
    assert isinstance(world.between, Moving)
    world.between.moved = True
    moved_s = world.now_s
    world.run()
    assert [1.5 < at_s - moved_s < 2.5 for at_s in world.times_s("address")] == [True] * 3
    assert all("its clock goes on" in text for text in world.words("address"))
    assert world.times_s("restarted") == []
    assert world.worst_m() < 0.05
    assert world.station.phase_machine.failure is None


@pytest.mark.slow
def test_a_vehicle_that_restarts_at_another_port_is_taken_up_again() -> None:
    world = World(Moving, duration_s=30)
    world.fly_to(6.0)
    assert isinstance(world.between, Moving)
    world.between.moved = True
    for number in (1, 2, 3):
        world.inject(number, "restart")
    world.run()
    assert all("its clock began after that" in text for text in world.words("address"))
    assert len(world.times_s("address")) == len(world.times_s("restarted")) == 3
    assert world.worst_m(26.0) < 0.1


@pytest.mark.slow
def test_the_place_of_a_silent_vehicle_is_not_taken_by_another_clock() -> None:
    world = World(duration_s=15)
    world.fly_to(3.0)
    world.inject(2, "freeze")
    impostor = world.another(2, clock=VehicleClock(offset_s=500.0))
    world.attach(impostor)
    world.run()
    assert world.times_s("address") == world.times_s("restarted") == []
    assert world.words("duplicate") == [
        "another sender has its system id, from 127.0.0.1:49155, beside 127.0.0.1:49153, its clock is another's; "
        "it is ignored"
    ]
    assert impostor.vehicles[0].link._senders == []


class HeartbeatsOnly(Between):
    """A fleet of which only heartbeats get through until it may send more."""

    silent = True

    def datagrams_to_send(self) -> list[Datagram]:
        beat = m.MAVLINK_MSG_ID_HEARTBEAT.to_bytes(3, "little")
        sent = super().datagrams_to_send()
        return [each for each in sent if not self.silent or each.data[HEADER_V2 - 3 : HEADER_V2] == beat]


@pytest.mark.slow
def test_the_place_of_a_lost_vehicle_is_taken_by_heartbeats_alone_and_their_clock_shown_by_a_probe() -> None:
    world = World(duration_s=14)
    world.fly_to(3.0)
    world.inject(2, "freeze")
    struck_s = world.now_s
    other = HeartbeatsOnly(world.another(2, clock=VehicleClock(offset_s=500.0)))
    world.attach(other)
    world.run(7.0)
    (taken_s,) = world.times_s("address", 2)
    assert taken_s - struck_s == pytest.approx(5.5, abs=0.7)  # a heartbeat is due once a second
    assert world.words("address")[0].endswith("nothing tells its clock")
    other.silent = False
    probed_s = world.now_s
    world.run()
    (again_s,) = world.times_s("restarted", 2)
    assert again_s - probed_s < 0.5


@pytest.mark.slow
def test_our_own_frames_that_come_back_change_nothing() -> None:
    world = World(Echoing, duration_s=10)
    world.run()
    (said,) = world.words("own_id")
    assert said.startswith("255/25 are our own ids: another ground station has them, or our own frames come back")
    assert world.words("stranger") == world.words("duplicate") == []
    assert world.worst_m() < 0.05


class SecondStation(Between):
    """Another ground station, QGroundControl at its defaults, behind the same router: its commands are all refused."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._writer, self._turn = FrameWriter(255, 190), 0

    def take(self, datagram: Datagram, now: Instant) -> None:
        super().take(datagram, now)
        self._turn += 1
        if self._turn % 5 == 0:
            system = self.fleet.vehicles[datagram.socket].config.identity.system
            nonsense = CommandInt(system, 1, m.MAV_FRAME_GLOBAL, m.MAV_CMD_GUIDED_CHANGE_SPEED, param1=77.0)
            super().take(Datagram(datagram.socket, datagram.peer, self._writer.encode(nonsense)), now)


def test_what_vehicles_answer_to_another_ground_station_with_our_system_id_says_nothing_of_our_setpoints() -> None:
    world = World(SecondStation, duration_s=8)
    world.run()
    assert world.words("disobeys") == world.words("refused") == []
    assert world.worst_m() < 0.05


@pytest.fixture
def station() -> Station:
    return Station(load_scenario(scenario()), MemoryRecorder())


def receive(station: Station, writer: FrameWriter, message, at_s: float = 0.0, port: int = 40000) -> None:
    station.receive([Datagram(0, Address(LOOPBACK, port), writer.encode(message))], after(Instant(0), at_s))


@pytest.mark.parametrize(
    ("system", "component", "kind", "words"),
    [
        (0, 1, "stranger", "system 0 is heard, but is the broadcast address and no vehicle's id"),
        (254, 1, "stranger", "system 254 is heard, but isn't in the scenario"),
        (255, 190, "own_id", "another ground station, 255/190, has our system id"),
        (*STATION, "own_id", "255/25 are our own ids"),
    ],
)
def test_systems_that_are_not_ours_are_reported_once(
    station: Station, system: int, component: int, kind: str, words: str
) -> None:
    for _ in range(3):
        receive(station, FrameWriter(system, component), PLANE)
    recorder = station._recorder
    assert isinstance(recorder, MemoryRecorder)
    (event,) = recorder.events
    assert event.kind == kind
    assert words in event.text
    assert event.details["peer"] == "127.0.0.1:40000"


def test_a_vehicles_other_components_say_nothing_of_its_autopilot(station: Station) -> None:
    vehicle = station.vehicles[VehicleId(1, 2)]
    for component in (0, m.MAV_COMP_ID_MISSIONPLANNER, 191):
        receive(station, FrameWriter(2, component), PLANE, port=50000)
    assert vehicle.connection.peer is None
    autopilot, companion = FrameWriter(2, m.MAV_COMP_ID_AUTOPILOT1), FrameWriter(2, 191)
    for i in range(20):
        receive(station, autopilot, PLANE, 0.1 * i)
        receive(station, companion, Statustext(2, "not the autopilot's words"), 0.1 * i, port=50000)
    assert vehicle.connection.peer == Address(LOOPBACK, 40000)
    assert vehicle.sequence.loss == 0.0
    assert vehicle.frames_in == 20
    assert not vehicle.telemetry.texts

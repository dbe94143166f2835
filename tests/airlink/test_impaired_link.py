"""Two engines on the memory network, the ground's behind impaired links."""

from typing import Any

import pytest

from airlink.clock import Instant, VirtualClock, after, seconds_between
from airlink.endpoint import Address, VehicleId
from airlink.engine import Datagram, MemoryNetwork
from airlink.frame import FrameWriter
from airlink.impaired_link import ImpairedEngine
from airlink.impairment import UNIMPAIRED, Direction, Impairment
from airlink.messages.system import Heartbeat, SystemTime
from airlink.receiver import MAX_REMOTES
from airlink.stream_parser import StreamParser
from tests.airlink.engines import PlainEngine

PERIOD_S = 0.05


class Vehicle(PlainEngine):
    """Sends its time every period; records what it receives."""

    def __init__(self, system, port=14550):
        super().__init__(f"udpout:127.0.0.1:{port}")
        self.writer = FrameWriter(system, 1)

    def take(self, datagram, now):
        (frame,) = StreamParser().feed(datagram.data)
        message: Any = frame.message
        self.received.append((now, message.time_boot_s))

    def handle_timer(self, now):
        frame = self.writer.encode(SystemTime(0, seconds_between(Instant(0), now)))
        self.outbox.append(Datagram(0, self.wanted[0].address, frame))
        self.timer = after(now, PERIOD_S)


class Ground(PlainEngine):
    """Answers each datagram with its own time; records when it came, from whom, and how old it was."""

    def __init__(self, *ports):
        super().__init__(*(f"udpin:127.0.0.1:{port}" for port in ports or (14550,)))
        self.writer = FrameWriter(255, 190)
        self.ticks = []

    def take(self, datagram, now):
        for frame in StreamParser().feed(datagram.data):
            message: Any = frame.message
            age_s = seconds_between(Instant(0), now) - message.time_boot_s
            self.received.append((now, frame.system, age_s))
        answer = self.writer.encode(SystemTime(0, seconds_between(Instant(0), now)))
        self.outbox.append(Datagram(datagram.socket, datagram.peer, answer))

    def handle_timer(self, now):
        self.ticks.append(now)
        self.timer = after(now, 0.1)

    def ages(self, system):
        return [age_s for _, received, age_s in self.received if received == system]


def fly(schedule, seconds=10.0, systems=(1, 2), seed=1):
    clock = VirtualClock()
    network = MemoryNetwork(clock)
    ground, vehicles = Ground(), {system: Vehicle(system) for system in systems}
    engine = ImpairedEngine(ground, [1], schedule, seed)
    network.attach(engine)
    for vehicle in vehicles.values():
        network.attach(vehicle)
    network.run(lambda: clock.now() >= after(Instant(0), seconds))
    return ground, vehicles, engine


def only_for(system, uplink, downlink):
    return lambda vehicle, now: (uplink, downlink) if vehicle.system == system else (UNIMPAIRED, UNIMPAIRED)


def test_each_vehicle_has_the_delays_of_its_own_link_in_each_direction():
    ground, vehicles, engine = fly(only_for(2, Impairment(delay_s=0.1), Impairment(delay_s=0.3)))
    assert ground.ages(2) == pytest.approx([0.3] * len(ground.ages(2)), abs=1e-9)
    assert ground.ages(1) == pytest.approx([0.0] * len(ground.ages(1)), abs=1e-9)
    ages = [seconds_between(Instant(0), now) - sent_s for now, sent_s in vehicles[2].received]
    assert ages == pytest.approx([0.1] * len(ages), abs=1e-9)
    assert len(ages) > 190
    statistics = engine.statistics(VehicleId(1, 2))
    assert statistics[Direction.UPLINK].mean_delay_s == pytest.approx(0.1)
    assert statistics[Direction.DOWNLINK].mean_delay_s == pytest.approx(0.3)
    assert engine.statistics(VehicleId(1, 1))[Direction.DOWNLINK].mean_delay_s == 0.0
    assert engine.statistics(VehicleId(1, 9))[Direction.DOWNLINK].datagrams == 0


def test_the_engines_own_timers_are_not_disturbed():
    ground, _, _ = fly(only_for(2, Impairment(0.1, 0.05), Impairment(0.3, 0.1)))
    assert ground.ticks == [after(Instant(0), 0.1 * number) for number in range(len(ground.ticks))]
    assert len(ground.ticks) >= 100


def test_what_is_lost_never_arrives_and_is_counted():
    ground, vehicles, engine = fly(only_for(1, Impairment(outage=True), Impairment(loss=0.3)), 100.0)
    downlink = engine.statistics(VehicleId(1, 1))[Direction.DOWNLINK]
    assert vehicles[1].received == []
    assert len(ground.ages(1)) == downlink.datagrams - downlink.lost
    assert downlink.loss == pytest.approx(0.3, abs=4 * (0.21 / 2000) ** 0.5)
    assert len(ground.ages(2)) == len(vehicles[2].received)


def test_a_run_repeats_itself_and_another_seed_does_not():
    schedule = only_for(2, Impairment(0.1, 0.05), Impairment(0.2, 0.1, duplicate=0.1, loss=0.1))
    first, again, other = fly(schedule), fly(schedule), fly(schedule, seed=2)
    assert first[0].received == again[0].received
    assert first[1][2].received == again[1][2].received
    assert first[0].received != other[0].received


def test_changing_one_link_leaves_the_others_alone():
    def both(second):
        first = Impairment(0.2, 0.1, loss=0.1)
        return lambda vehicle, now: (first, first) if vehicle.system == 1 else (second, second)

    a, b = fly(both(UNIMPAIRED))[0], fly(both(Impairment(0.4, 0.2, loss=0.5)))[0]
    assert a.ages(1) == b.ages(1)
    assert a.ages(2) != b.ages(2)


def test_both_copies_of_a_duplicate_reach_their_receiver():
    _, vehicles, _ = fly(only_for(1, Impairment(duplicate=1.0), UNIMPAIRED), 2.0)
    once, twice = ([sent_s for _, sent_s in vehicles[system].received] for system in (2, 1))
    assert twice == [sent_s for sent_s in once for _ in range(2)]


def test_a_schedule_may_change_in_flight():
    before, then = Impairment(delay_s=0.1), Impairment(delay_s=0.3)
    ground, _, _ = fly(lambda vehicle, now: (UNIMPAIRED, before if now < after(Instant(0), 5.0) else then))
    sent = [(seconds_between(Instant(0), now) - age_s, round(age_s, 6)) for now, _, age_s in ground.received]
    assert {age_s for sent_s, age_s in sent if sent_s < 4.999} == {0.1}
    assert {age_s for sent_s, age_s in sent if sent_s > 4.999} == {0.3}


def test_without_impairment_everything_is_as_without_the_links():
    clock = VirtualClock()
    network = MemoryNetwork(clock)
    bare, vehicle = Ground(), Vehicle(1)
    network.attach(bare)
    network.attach(vehicle)
    network.run(lambda: clock.now() >= after(Instant(0), 10.0))
    ground, vehicles, _ = fly(lambda vehicle, now: (UNIMPAIRED, UNIMPAIRED), systems=(1,))
    assert (ground.received, vehicles[1].received) == (bare.received, vehicle.received)


def test_one_system_id_on_two_networks_is_two_vehicles():
    ground = Ground(14550, 14551)
    engine = ImpairedEngine(ground, [1, 2], lambda vehicle, now: (UNIMPAIRED, Impairment(float(vehicle.network))), 1)
    frame = FrameWriter(7, 1).encode(SystemTime(0, 0.0))
    for socket in (0, 1):
        engine.receive([Datagram(socket, Address("127.0.0.1", 5), frame)], Instant(0))
    assert engine.statistics(VehicleId(1, 7))[Direction.DOWNLINK].mean_delay_s == 1.0
    assert engine.statistics(VehicleId(2, 7))[Direction.DOWNLINK].mean_delay_s == 2.0


def test_what_belongs_to_no_vehicle_passes_as_it_is():
    ground = Ground()
    engine = ImpairedEngine(ground, [1], lambda vehicle, now: (Impairment(outage=True), UNIMPAIRED), 1)
    stranger = Datagram(0, Address("127.0.0.1", 6), b"no frame")
    engine.receive([stranger], Instant(0))
    assert [datagram.peer for datagram in engine.datagrams_to_send()] == [stranger.peer]


def test_equal_instants_keep_the_order_in_which_they_came():
    ground = Ground()
    engine = ImpairedEngine(ground, [1], lambda vehicle, now: (UNIMPAIRED, Impairment(delay_s=0.5)), 1)
    for system in (3, 1, 2):
        frame = FrameWriter(system, 1).encode(SystemTime(0, 0.0))
        engine.receive([Datagram(0, Address("127.0.0.1", system), frame)], Instant(0))
    assert engine.next_timer() == ground.next_timer() == 0
    engine.handle_timer(Instant(0))
    ground.timer = None
    assert engine.next_timer() == 500_000_000
    engine.handle_timer(Instant(500_000_000))
    assert [system for _, system, _ in ground.received] == [3, 1, 2]
    assert engine.next_timer() is None


def test_a_cut_frame_is_its_senders_too():
    ground = Ground()
    engine = ImpairedEngine(ground, [1], lambda vehicle, now: (UNIMPAIRED, Impairment(delay_s=0.5)), 1)
    frame = FrameWriter(1, 1).encode(Heartbeat(1, 3))
    for part in (frame, frame[:12], frame[12:]):
        engine.receive([Datagram(0, Address("127.0.0.1", 9), part)], Instant(0))
    assert engine.statistics(VehicleId(1, 1))[Direction.DOWNLINK].datagrams == 3


def test_a_header_alone_makes_no_sender():
    """An invalid frame neither changes a vehicle's address nor is kept."""
    ground = Ground()
    engine = ImpairedEngine(ground, [1], lambda vehicle, now: (UNIMPAIRED, Impairment(delay_s=0.5)), 1)
    for system in (1, 2):
        frame = FrameWriter(system, 1).encode(Heartbeat(1, 3))
        broken = frame[:-1] + bytes([frame[-1] ^ 1])
        engine.receive([Datagram(0, Address("127.0.0.1", 9), frame if system == 1 else broken)], Instant(0))
        engine.receive([Datagram(0, Address("127.0.0.1", 10), broken)], Instant(0))
    assert engine.statistics(VehicleId(1, 1))[Direction.DOWNLINK].datagrams == 2
    assert engine.statistics(VehicleId(1, 2))[Direction.DOWNLINK].datagrams == 0


def test_thousands_of_senders_are_forgotten_but_for_those_heard_last():
    engine = ImpairedEngine(Ground(), [1], lambda vehicle, now: (UNIMPAIRED, Impairment(delay_s=0.5)), 1)
    frame = FrameWriter(1, 1).encode(Heartbeat(1, 3))
    for port in range(1, 3 * MAX_REMOTES):
        engine.receive([Datagram(0, Address("127.0.0.1", port), frame)], Instant(0))
    assert len(engine._vehicle_at) == MAX_REMOTES

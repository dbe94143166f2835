"""A radio's path: medium, air, and RADIO_STATUS about both; around an engine, and in the proxy."""

from __future__ import annotations

from statistics import median

import pytest

from airlink.clock import Instant, VirtualClock, after, seconds_between
from airlink.endpoint import VehicleId
from airlink.engine import Datagram, MemoryNetwork
from airlink.frame import FrameWriter
from airlink.impaired_link import ImpairedEngine
from airlink.impairment import UNIMPAIRED, Direction, Impairment
from airlink.messages.system import RadioStatus
from airlink.radio.settings import RADIO, RadioSettings
from airlink.radio.shared_radio import SharedRadio
from airlink.relay import Relay
from airlink.stream_parser import StreamParser
from tests.airlink.test_impaired_link import Ground, Vehicle

UP, DOWN = Direction.UPLINK, Direction.DOWNLINK
START = Instant(0)


def status(frame: bytes) -> RadioStatus:
    (parsed,) = StreamParser().feed(frame)
    assert (parsed.system, parsed.component) == RADIO == (51, 68)
    assert isinstance(parsed.message, RadioStatus)
    return parsed.message


def test_both_ends_report_their_own_buffer_and_what_they_received_with_errors() -> None:
    radio = SharedRadio[int](RadioSettings(8e3, 8e3, buffer_bytes=1000), seed=1)
    for number in range(3):
        radio.offer(UP, (1, 1), 200, number, START)
    radio.offer(DOWN, (1, 1), 100, 3, START)
    radio.lose((1, 1), UP)
    ground, vehicle = status(radio.ground_report()), status(radio.vehicle_report((1, 1)))
    assert (ground.txbuf, ground.rxerrors) == (60, 0)
    assert (vehicle.txbuf, vehicle.rxerrors) == (90, 1)
    assert status(radio.vehicle_report((1, 2))).txbuf == 100


def test_reports_are_due_once_a_second_from_the_first_datagram_on() -> None:
    radio = SharedRadio[int](RadioSettings(8e3, 8e3), seed=1)
    assert radio.next_timer() is None
    radio.offer(UP, (1, 1), 1, 0, after(START, 0.5))
    radio.passed(after(START, 1.0))
    assert radio.next_timer() == after(START, 1.5)
    assert [radio.report_due(after(START, at_s)) for at_s in (1.4, 1.5, 1.6, 2.5, 9.0, 9.4, 9.5)] == [
        False, True, False, True, True, False, True,
    ]  # fmt: skip
    silent = SharedRadio[int](RadioSettings(8e3, 8e3, reports=False), seed=1)
    silent.offer(UP, (1, 1), 1, 0, START)
    assert silent.passed(after(START, 5.0))
    assert silent.next_timer() is None


def test_the_air_delays_and_loses_what_has_used_its_time() -> None:
    air = Impairment(delay_s=0.02, loss=0.3, reorder=True)
    radio = SharedRadio[int](RadioSettings(8e5, 8e5, buffer_bytes=10**6, air=air), seed=1)
    for number in range(1000):
        radio.offer(DOWN, (1, number % 3), 100, number, START)
    sent = radio.passed(after(START, 2.0))
    assert [each.left for each in sent] == [after(START, 0.001 * (i + 1)) for i in range(1000)]
    lost = sum(each.air_s is None for each in sent)
    assert lost == pytest.approx(300, abs=4 * (1000 * 0.21) ** 0.5)
    assert {each.air_s for each in sent} == {None, 0.02}
    again = SharedRadio[int](RadioSettings(8e5, 8e5, buffer_bytes=10**6, air=air), seed=1)
    for number in range(1000):
        again.offer(DOWN, (1, number % 3), 100, number, START)
    assert again.passed(after(START, 2.0)) == sent


def fly(settings: RadioSettings, own: Impairment = UNIMPAIRED, seconds: float = 10.0):
    """Fly three vehicles, of which 1 and 2 share a radio; return the ground, the vehicles, the links and the radio."""
    clock = VirtualClock()
    network, radio = MemoryNetwork(clock), SharedRadio[Datagram](settings, seed=1)
    ground, vehicles = Ground(), {system: Vehicle(system) for system in (1, 2, 3)}
    radios = {VehicleId(1, 1): radio, VehicleId(1, 2): radio}
    links = ImpairedEngine(ground, [1], lambda vehicle, now: (own, own), 1, radios)
    network.attach(links)
    for vehicle in vehicles.values():
        network.attach(vehicle)
    network.run(lambda: clock.now() >= after(START, seconds))
    return ground, vehicles, links, radio


SILENT = RadioSettings(57_600.0, 57_600.0, reports=False)


def test_vehicles_with_one_radio_share_its_time_and_others_have_their_own() -> None:
    """A SYSTEM_TIME has 22 bytes, 3.06 ms; two come together every 50 ms, each is answered when it has arrived."""
    ground, _, links, radio = fly(SILENT)
    size_s = SILENT.airtime_s(22, up=True)
    first, second, alone = (median(ground.ages(system)) for system in (1, 2, 3))
    assert (first, second, alone) == (pytest.approx(size_s, abs=1e-6), pytest.approx(2 * size_s, abs=1e-6), 0.0)
    for system in (1, 2):
        assert all(each.lost == 0 and each.datagrams > 190 for each in links.statistics(VehicleId(1, system)))
        downlink = links.statistics(VehicleId(1, system))[DOWN]
        assert downlink.mean_delay_s == pytest.approx(system * size_s, rel=0.02)
    busy_s = radio.medium.lanes[UP].busy_ns / 1e9
    assert busy_s == pytest.approx(4 * 200 * size_s, rel=0.02)


def test_a_links_own_delay_and_loss_come_on_top_and_count_as_errors() -> None:
    plain, own = fly(SILENT)[2], fly(SILENT, Impairment(delay_s=0.1, loss=0.2))
    for direction in Direction:
        before = plain.statistics(VehicleId(1, 1))[direction].mean_delay_s
        assert own[2].statistics(VehicleId(1, 1))[direction].mean_delay_s == pytest.approx(before + 0.1, abs=0.004)
    lost = sum(own[2].statistics(VehicleId(1, system))[DOWN].lost for system in (1, 2))
    assert status(own[3].ground_report()).rxerrors == lost > 50


def test_a_channel_that_is_too_narrow_drops_and_the_statistics_say_so() -> None:
    ground, _, links, radio = fly(RadioSettings(4_000.0, 4_000.0, buffer_bytes=300, reports=False))
    both = [each for system in (1, 2) for each in links.statistics(VehicleId(1, system))]
    assert sum(each.lost for each in both) > 100
    assert all(each.lost <= each.datagrams for each in both)
    assert radio.medium.lanes[UP].busy_ns > 0.97 * 10e9
    assert len(ground.ages(3)) > 190


class Listener(Vehicle):
    """Keeps what its radio reports."""

    def __init__(self, system: int) -> None:
        super().__init__(system)
        self.reports: list[RadioStatus] = []

    def take(self, datagram, now):
        (frame,) = StreamParser().feed(datagram.data)
        if isinstance(frame.message, RadioStatus):
            self.reports.append(frame.message)


class Watcher(Ground):
    """Keeps what the radio reports, and from where."""

    def __init__(self) -> None:
        super().__init__()
        self.reports: list[tuple[object, RadioStatus]] = []

    def take(self, datagram, now):
        (frame,) = StreamParser().feed(datagram.data)
        if isinstance(frame.message, RadioStatus):
            self.reports.append((datagram.peer, frame.message))
        else:
            super().take(datagram, now)


def test_an_engine_gets_the_report_at_every_address_of_the_radios_vehicles_and_the_vehicles_get_theirs() -> None:
    clock = VirtualClock()
    network, radio = MemoryNetwork(clock), SharedRadio[Datagram](RadioSettings(57_600.0, 57_600.0), seed=1)
    ground, vehicles = Watcher(), [Listener(system) for system in (1, 2, 3)]
    radios = {VehicleId(1, 1): radio, VehicleId(1, 2): radio}
    network.attach(ImpairedEngine(ground, [1], lambda vehicle, now: (UNIMPAIRED, UNIMPAIRED), 1, radios))
    for vehicle in vehicles:
        network.attach(vehicle)
    network.run(lambda: clock.now() >= after(START, 10.5))
    assert [len(vehicle.reports) for vehicle in vehicles] == [10, 10, 0]
    assert len(ground.reports) == 20
    assert len({peer for peer, _ in ground.reports}) == 2


def test_a_real_radios_report_doesnt_make_its_address_that_of_a_vehicle() -> None:
    ground = Watcher()
    links = ImpairedEngine(ground, [1], lambda vehicle, now: (Impairment(0.1), Impairment(0.1)), 1)
    report = FrameWriter(*RADIO).encode(RadioStatus(1, 2, 3, 4, 5, 6, 7))
    vehicle = Vehicle(7)
    vehicle.handle_timer(START)
    (own,) = vehicle.datagrams_to_send()
    links.receive([Datagram(0, own.peer, own.data)], START)
    links.receive([Datagram(0, own.peer, report)], START)
    assert links.statistics(VehicleId(1, 7))[DOWN].datagrams == 1
    assert links.statistics(VehicleId(1, 51))[DOWN].datagrams == 0


def test_a_relay_puts_all_remotes_behind_one_radio_and_reports_to_each() -> None:
    relay = Relay(1, RadioSettings(8e3, 8e3, buffer_bytes=600))
    for remote in (0, 1):
        for _ in range(3):
            relay.accept((remote, DOWN, b"x" * 200), START)
    came: list[tuple[float, int, int]] = []
    reports: list[tuple[int, Direction]] = []
    while (timer := relay.next_timer()) is not None and timer <= after(START, 2.1):
        for remote, direction, data in relay.pop_due(timer):
            if len(data) == 200:
                came.append((seconds_between(START, timer), remote, len(data)))
            else:
                status(data)
                reports.append((remote, direction))
    assert [round(at_s, 3) for at_s, _, _ in came] == [0.2, 0.4, 0.6, 0.8, 1.0, 1.2]
    assert sorted(remote for _, remote, _ in came) == [0, 0, 0, 1, 1, 1]
    assert reports == [(0, DOWN), (1, DOWN), (0, UP), (1, UP)] * 2
    relay.accept((0, DOWN, b"x" * 601), timer or START)
    assert relay.statistics(DOWN).lost == 1
    relay.disconnect(0)
    assert relay.statistics(DOWN).datagrams == 7

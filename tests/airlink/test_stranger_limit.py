"""What is read of strangers: a limited amount of each and of all, whatever they send."""

from __future__ import annotations

import socket
import time

from airlink.clock import Instant, RealClock, after
from airlink.driver import Driver
from airlink.endpoint import LOOPBACK, Address
from airlink.engine import Datagram
from airlink.stranger_limit import ALL_AT_ONCE_BYTES, ALL_BYTES_PER_S, EACH_BYTES_PER_S, StrangerLimit
from tests.airlink.engines import PlainEngine

SECOND = 1_000_000_000
SIZE = 1400
VEHICLE = 60
"""Bytes of a vehicle's datagram."""


def read(limit: StrangerLimit, peers: list[Address], size: int, rate_hz: int, seconds: int) -> int:
    """Return how many datagrams are read if each peer sends that many a second."""
    return sum(
        limit.admits(peer, size, round(number / rate_hz * SECOND))
        for number in range(seconds * rate_hz)
        for peer in peers
    )


def test_a_flood_is_read_no_faster_than_its_share() -> None:
    count = read(StrangerLimit(0), [Address(LOOPBACK, 1)], SIZE, 4500, 10)
    assert 10 * EACH_BYTES_PER_S / (SIZE + 100) < count <= 11 * EACH_BYTES_PER_S / SIZE + 1


def test_many_strangers_share_what_is_read_of_all() -> None:
    peers = [Address(LOOPBACK, port) for port in range(5000)]
    octets = SIZE * read(StrangerLimit(0), peers, SIZE, 10, 5)
    assert octets <= ALL_AT_ONCE_BYTES + 5 * ALL_BYTES_PER_S + SIZE


def test_a_flood_keeps_no_other_from_being_received() -> None:
    limit, flood, vehicle = StrangerLimit(0), Address(LOOPBACK, 1), Address(LOOPBACK, 2)
    received = 0
    for at in range(0, 20 * SECOND, SECOND // 4500):
        limit.admits(flood, SIZE, at)
        if at % SECOND < SECOND // 4500:
            received += limit.admits(vehicle, VEHICLE, at)
    assert received == 20


def test_vehicles_heard_for_the_first_time_are_read_at_once_however_many_they_are() -> None:
    limit = StrangerLimit(0)
    assert all(limit.admits(Address(LOOPBACK, port), VEHICLE, 0) for port in range(250) for _ in range(8))


class Knowing(PlainEngine):
    """Knows one address, and counts what it gets and what was left unread."""

    def __init__(self, *endpoints: str) -> None:
        super().__init__(*endpoints)
        self.known, self.unread = Address(LOOPBACK, 0), 0

    def known_peers(self) -> frozenset[Address]:
        return frozenset({self.known})

    def left_unread(self, octets: int) -> None:
        self.unread += octets

    def take(self, datagram, now):
        self.received.append(datagram)

    def handle_timer(self, now: Instant) -> None:
        self.timer = after(now, 0.001)


def of_vehicle(engine: Knowing) -> list[Datagram]:
    return [each for each in engine.received if each.peer == engine.known]


def test_of_a_stranger_s_flood_little_arrives_and_of_a_known_peer_everything() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        here = probe.getsockname()
    engine = Knowing(f"udpin:{LOOPBACK}:{here[1]}")
    flood, vehicle = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    with flood, vehicle, Driver(engine, RealClock()) as driver:
        vehicle.bind((LOOPBACK, 0))
        engine.known = Address(*vehicle.getsockname())
        for _ in range(200):
            flood.sendto(b"\xfe" * SIZE, here)
            vehicle.sendto(bytes(VEHICLE), here)
        ends = time.monotonic() + 60.0
        driver.run(lambda: len(of_vehicle(engine)) >= 200 or time.monotonic() > ends)
    own = of_vehicle(engine)
    others = [each for each in engine.received if each.peer != engine.known]
    assert len(own) == 200
    assert 0 < len(others) < 200
    assert engine.unread + SIZE * len(others) == 200 * SIZE

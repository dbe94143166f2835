import selectors
import socket
import sys
import time

import pytest

from airlink.clock import Instant, RealClock, after
from airlink.driver import PORTION, Driver, select_for
from airlink.endpoint import Address, PortError, parse_endpoint
from airlink.engine import Datagram
from airlink.transports.udp import Inbox, open_socket, resolved
from tests.airlink.engines import PlainEngine


class Echo(PlainEngine):
    """Answers datagrams and has a timer at intervals."""

    def __init__(self, *endpoints):
        super().__init__(*endpoints)
        self.timers = []

    def take(self, datagram, now):
        self.received.append(datagram)
        self.outbox.append(Datagram(datagram.socket, datagram.peer, datagram.data.upper()))

    def handle_timer(self, now):
        self.timers.append(now)
        self.timer = after(now, 0.001)


@pytest.fixture
def port():
    """Return a free port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_datagrams_come_in_and_answers_go_back(port):
    engine = Echo(f"udpin:127.0.0.1:{port}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as remote, Driver(engine, RealClock()) as driver:
        remote.bind(("127.0.0.1", 0))
        remote.settimeout(120.0)
        remote.sendto(b"hello", ("127.0.0.1", port))
        driver.run(lambda: bool(engine.received) and len(engine.timers) >= 3)
        assert remote.recv(100) == b"HELLO"
        assert [(each.remote, each.data) for each in engine.received] == [
            ((0, Address(*remote.getsockname())), b"hello")
        ]
        assert engine.timers == sorted(engine.timers)


def test_the_end_is_not_looked_for_after_each_datagram_but_without_any_timer_too(port):
    """300 datagrams, each the answer to the one before, wake the driver 300 times; checking costs more than most do."""
    engine, looks = Echo(f"udpin:127.0.0.1:{port}"), []
    engine.timer = None
    engine.outbox.append(Datagram(0, Address("127.0.0.1", port), b"on and on"))
    with Driver(engine, RealClock()) as driver:
        driver.run(lambda: looks.append(len(engine.received)) or looks[-1] >= 300)
    assert len(looks) < 100


def test_a_taken_port_is_named_and_nothing_stays_open(port):
    taken = f"udpin:127.0.0.1:{port}"
    with open_socket(parse_endpoint(taken)), pytest.raises(PortError, match=f"{port} is taken"):
        Driver(Echo("udpout:127.0.0.1:9", taken), RealClock())


def test_an_address_of_another_machine_cannot_be_listened_at(port):
    with pytest.raises(PortError, match="cannot listen at udpin:192"):
        open_socket(parse_endpoint(f"udpin:192.0.2.1:{port}"))


def test_the_previous_source_port_is_used_again_unless_it_is_taken(port):
    to = "udpout:127.0.0.1:9"
    with Driver(Echo(to, f"udpin:127.0.0.1:{port}"), RealClock()) as first:
        before = first.from_ports
        with Driver(Echo(to), RealClock(), before) as beside:
            assert beside.from_ports != before
    assert list(before) == [to]
    with Driver(Echo(to), RealClock(), before) as again:
        assert again.from_ports == before


def test_who_cannot_be_reached_is_no_error(port):
    engine = Echo(f"udpout:127.0.0.1:{port}")
    engine.outbox.append(Datagram(0, Address("127.0.0.1", port), b"x"))
    engine.outbox.append(Datagram(0, Address("127.0.0.1", port), bytes(70_000)))
    with Driver(engine, RealClock()) as driver:
        driver.run(lambda: len(engine.timers) >= 2)
    assert engine.received == []


@pytest.mark.parametrize("platform", [sys.platform, "without recvmmsg"])
def test_all_that_waits_is_taken_in_its_order_from_any_sender(port, platform, monkeypatch):
    monkeypatch.setattr(sys, "platform", platform)
    sent = [b"", bytes(65_507), *(bytes([number % 256]) * (1 + number % 90) for number in range(200))]
    first, second = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    with open_socket(parse_endpoint(f"udpin:127.0.0.1:{port}")) as here, first, second:
        senders = [(second if number % 3 else first) for number in range(len(sent))]
        for sender, data in zip(senders, sent, strict=True):
            sender.sendto(data, ("127.0.0.1", port))
        inbox = Inbox()
        addresses = [Address("127.0.0.1", each.getsockname()[1]) for each in senders]
        assert inbox.drain(here, 3) == [Datagram(3, *each) for each in zip(addresses, sent, strict=True)]
        assert inbox.drain(here) == []
        first.sendto(b"again", ("127.0.0.1", port))
        assert inbox.drain(here) == [Datagram(0, addresses[0], b"again")]


class ManualClock(RealClock):
    """Advances by the time an engine takes, and by a millisecond where the driver waits."""

    ns = 0

    def now(self):
        return Instant(self.ns)

    def wall_seconds_until(self, instant):
        self.ns += 1_000_000
        return 0.0


class Busy(Echo):
    """Takes time to read datagrams; its timer is due ten times a second."""

    def __init__(self, clock, ns_per_byte, *endpoints):
        super().__init__(*endpoints)
        self.clock, self.ns_per_byte, self.log = clock, ns_per_byte, []
        self.timer = after(Instant(0), 0.1)

    def receive(self, datagrams, now):
        for datagram in datagrams:
            self.log.append((datagram.socket, len(datagram.data)))
            self.clock.ns += self.ns_per_byte * len(datagram.data)

    def handle_timer(self, now):
        self.log.append("timer")
        self.timer = after(now, 0.1)


@pytest.fixture
def clock(monkeypatch):
    """Return a clock that replaces the machine's clock too."""
    manual = ManualClock()
    monkeypatch.setattr(time, "monotonic_ns", lambda: manual.ns)
    return manual


@pytest.fixture
def two_ports(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        other = probe.getsockname()[1]
    return (port, other), (f"udpin:127.0.0.1:{port}", f"udpin:127.0.0.1:{other}")


def test_junk_at_one_socket_stops_neither_the_others_nor_the_timers(two_ports, clock):
    """At 10 us a byte, the former speed for junk, a datagram of 60,000 bytes takes six ticks."""
    (flooded, other), endpoints = two_ports
    engine = Busy(clock, 10_000, *endpoints)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as remote, Driver(engine, clock) as driver:
        for _ in range(4):
            remote.sendto(b"\xfe" * 60_000, ("127.0.0.1", flooded))
        remote.sendto(b"alive", ("127.0.0.1", other))
        driver.run(lambda: sum(each[1] for each in engine.log if each != "timer") >= 240_005)
    assert engine.log.index((1, 5)) <= 1, "before the second portion of the junk"
    assert engine.log.count("timer") >= 10
    assert max(each[1] for each in engine.log if each != "timer") == PORTION


def test_no_timer_is_handled_before_what_arrived_during_a_long_receive(two_ports, clock):
    """Silence is judged at timers: a vehicle that sent during another's long receive must be received by then."""
    (slow, other), endpoints = two_ports

    class HeldUp(Busy):
        def receive(self, datagrams, now):
            super().receive(datagrams, now)
            if self.log == [(0, 7)]:
                remote.sendto(b"alive", ("127.0.0.1", other))

    engine = HeldUp(clock, 1_000_000_000, *endpoints)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as remote, Driver(engine, clock) as driver:
        remote.sendto(b"seven s", ("127.0.0.1", slow))
        driver.run(lambda: "timer" in engine.log)
    assert engine.log == [(0, 7), (1, 5), "timer"]


def test_after_a_stop_all_that_came_meanwhile_is_read_first_however_much_that_is(two_ports, clock):
    (here, other), endpoints = two_ports
    engine = Busy(clock, 10_000, *endpoints)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as remote, Driver(engine, clock) as driver:
        for each in (here, other) * 150:
            remote.sendto(bytes(100), ("127.0.0.1", each))
        clock.ns = 8_000_000_000
        driver.run(lambda: "timer" in engine.log)
    assert engine.log.index("timer") == 300


class Stopped(selectors.SelectSelector):
    """A process that was stopped for longer than it wanted to wait, and hasn't polled what arrived meanwhile."""

    def select(self, timeout=None):
        return [] if timeout else super().select(timeout)


def test_after_the_process_was_stopped_what_came_meanwhile_goes_before_the_timers():
    here, there = socket.socketpair()
    with here, there, Stopped() as selector:
        selector.register(here, selectors.EVENT_READ)
        there.send(b"x")
        assert [key.fileobj for key, _ in select_for(selector, 0.01)] == [here]


def test_a_peer_is_known_by_the_number_of_its_host_and_a_name_on_which_we_listen_stays():
    assert str(resolved(parse_endpoint("udpout:localhost:9"))) == "udpout:127.0.0.1:9"
    assert str(resolved(parse_endpoint("udpin:localhost:9"))) == "udpin:localhost:9"
    with pytest.raises(PortError, match=r"cannot send to udpout:nowhere\.invalid:9"):
        resolved(parse_endpoint("udpout:nowhere.invalid:9"))

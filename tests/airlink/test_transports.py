"""Links of each kind over real sockets and pseudo-terminals: what is sent arrives; what is lost is found again."""

import os
import pty
import socket
import time
import tty

import pytest

from airlink.clock import RealClock
from airlink.driver import Driver
from airlink.endpoint import Address, PortError, parse_endpoint
from airlink.engine import Datagram
from airlink.transports.backlog import Backlog
from airlink.transports.opening import open_transport
from airlink.transports.udp import Inbox
from tests.airlink.engines import PlainEngine

LIMIT_S = 60.0


class Hearing(PlainEngine):
    """Keeps what it receives, and can answer."""

    def __init__(self, *endpoints):
        super().__init__(*endpoints)
        self.timer = None

    def take(self, datagram, now):
        self.received.append(datagram)

    def say(self, data, peer=None, number=0):
        self.outbox.append(Datagram(number, peer or self.wanted[number].peer, data))

    def bytes_of(self, number=0):
        return b"".join(each.data for each in self.received if each.socket == number)


def run_both(one, other, until):
    """Run two drivers in turns until something holds."""
    ends_s = time.monotonic() + LIMIT_S
    while not until():
        assert time.monotonic() < ends_s
        for each in (one, other):
            passes = iter((False, True))
            each.run(lambda passes=passes: next(passes))


@pytest.fixture
def port():
    """Return a port that is free for TCP and UDP."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def serial_pair():
    """Return two file descriptors of a line's far end, and the device of its near end."""
    far, near = pty.openpty()
    tty.setraw(far)
    tty.setraw(near)
    return far, near, os.ttyname(near)


@pytest.mark.parametrize(("near", "far"), [("tcp", "tcpin"), ("udpout", "udpin")])
@pytest.mark.parametrize("host", ["127.0.0.1", "[::1]"])
def test_what_is_sent_arrives_and_is_answered(near, far, host, port):
    one, other = Hearing(f"{near}:{host}:{port}"), Hearing(f"{far}:{host}:{port}")
    with Driver(other, RealClock()) as there, Driver(one, RealClock()) as here:
        run_both(here, there, lambda: one.say(b"a") or other.received)
        other.say(b"answer", other.received[0].peer)
        run_both(here, there, lambda: one.received)
        assert one.received[0].peer == parse_endpoint(f"{near}:{host}:{port}").address
        assert one.bytes_of() == b"answer"


def test_a_tcp_client_waits_for_its_listener_and_connects_again_after_each_loss(port):
    one = Hearing(f"tcp:127.0.0.1:{port}")
    with Driver(one, RealClock()) as here:
        for _ in range(2):
            other = Hearing(f"tcpin:127.0.0.1:{port}")
            with Driver(other, RealClock()) as there:
                run_both(here, there, lambda other=other: one.say(b"again") or other.received)
            one.outbox.clear()


@pytest.mark.slow
def test_a_listener_has_many_clients_and_forgets_those_that_have_gone(port):
    listening = Hearing(f"tcpin:127.0.0.1:{port}")
    with Driver(listening, RealClock()) as there:
        clients = [Hearing(f"tcp:127.0.0.1:{port}") for _ in range(3)]
        for number, client in enumerate(clients):
            with Driver(client, RealClock()) as here:
                word = b"%d" % number
                run_both(here, there, lambda client=client, word=word: client.say(word) or word in listening.bytes_of())
        assert len({each.peer for each in listening.received}) == 3
        listening.say(b"to one that has gone", listening.received[0].peer)
        passes = iter((False, True))
        there.run(lambda: next(passes))


def test_a_taken_tcp_port_is_named(port):
    with Driver(Hearing(f"tcpin:127.0.0.1:{port}"), RealClock()), pytest.raises(PortError, match=f"{port} is taken"):
        open_transport(parse_endpoint(f"tcpin:127.0.0.1:{port}"), Inbox())


def test_bytes_go_over_a_serial_line_in_both_directions():
    far, near, device = serial_pair()
    one = Hearing(f"serial:{device}:57600")
    with Driver(one, RealClock()) as here:
        os.write(far, b"half a fr")
        os.write(far, b"ame")
        ends_s = time.monotonic() + LIMIT_S
        here.run(lambda: one.bytes_of() == b"half a frame" or time.monotonic() > ends_s)
        one.say(b"answer")
        passes = iter((False, True))
        here.run(lambda: next(passes))
        assert os.read(far, 100) == b"answer"
    assert {each.peer for each in one.received} == {parse_endpoint(f"serial:{device}:57600").peer}
    os.close(near)
    os.close(far)


def test_several_sockets_on_one_line_all_hear_it():
    far, near, device = serial_pair()
    one = Hearing(f"serial:{device}:57600", f"serial:{device}:57600")
    with Driver(one, RealClock()) as here:
        os.write(far, b"to all")
        here.run(lambda: one.bytes_of(1) == b"to all")
        assert one.bytes_of(0) == b"to all"
        for number in (0, 1):
            one.say(b"%d" % number, number=number)
        passes = iter((False, True))
        here.run(lambda: next(passes))
        assert os.read(far, 100) == b"01"
    os.close(near)
    os.close(far)


def test_a_line_that_is_unplugged_is_opened_again_when_it_is_back(tmp_path):
    far, near, device = serial_pair()
    link = tmp_path / "radio"
    link.symlink_to(device)
    one = Hearing(f"serial:{link}:57600")
    with Driver(one, RealClock()) as here:
        os.close(near)
        os.close(far)
        link.unlink()
        passes = iter((False, True))
        here.run(lambda: next(passes))
        one.say(b"into nothing")
        far, near, device = serial_pair()
        link.symlink_to(device)
        ends_s = time.monotonic() + LIMIT_S
        here.run(lambda: os.write(far, b"a") == 0 or bool(one.received) or time.monotonic() > ends_s)
    assert set(one.bytes_of()) == set(b"a")
    os.close(near)
    os.close(far)


@pytest.mark.parametrize("device", ["/dev/no-such-radio", "/dev/null"])
def test_what_is_no_serial_line_is_named(device):
    with pytest.raises(PortError, match=f"cannot open serial:{device}"):
        open_transport(parse_endpoint(f"serial:{device}:57600"), Inbox())


def test_in_a_group_every_end_receives_every_other_and_not_itself(port):
    members = [Hearing(f"mcast:239.255.145.51:{port}") for _ in range(2)]
    with Driver(members[0], RealClock()) as here, Driver(members[1], RealClock()) as there:
        run_both(here, there, lambda: members[0].say(b"a") or members[1].received)
        members[1].say(b"b")
        run_both(here, there, lambda: members[0].received)
    assert set(members[0].bytes_of()) == set(b"b")
    assert {each.peer for each in members[0].received} == {Address("239.255.145.51", port)}


def test_a_full_stream_loses_whole_datagrams_and_never_cuts_one():
    backlog, written, room = Backlog(10), bytearray(), [3]

    def write(data):
        taken = min(len(data), room[0])
        written.extend(data[:taken])
        room[0] -= taken
        return taken

    for data in (b"aaaa", b"bbbb", b"cccc", b"dd"):  # the third finds too much waiting, the fourth has room
        backlog.add(data)
    backlog.flush(write)
    assert written == b"aaa"
    room[0] = 100
    backlog.flush(write)
    assert written == b"aaaabbbbdd"

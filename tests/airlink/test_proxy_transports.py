"""The proxy between links of every kind: TCP, serial lines (pseudo-terminals), UDP, a multicast group."""

import os
import pty
import socket
import time
import tty
from contextlib import ExitStack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.cli.proxy import apply_line
from airlink.clock import RealClock
from airlink.driver import Driver
from airlink.endpoint import EndpointError, parse_endpoint
from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.frame_pieces import Pieces
from airlink.impairment import Direction
from airlink.messages.system import Heartbeat, Statustext
from airlink.proxy import Proxy
from airlink.relay import Relay
from airlink.signing.signature import signed
from airlink.stream_parser import StreamParser
from tests.airlink.engines import PlainEngine

LIMIT_S = 60.0
VEHICLE, STATION = FrameWriter(1, 1), FrameWriter(255, 25)
SAID = [VEHICLE.encode(Statustext(6, "x" * size)) for size in (1, 20, 50)]
ANSWER = STATION.encode(Heartbeat(6, 8))


class Hearing(PlainEngine):
    """Keeps what it receives, and can say something."""

    def __init__(self, endpoint):
        super().__init__(endpoint)
        self.timer = None

    def take(self, datagram, now):
        self.received.append(datagram)

    def say(self, data):
        peer = self.wanted[0].peer or (self.received[-1].peer if self.received else None)
        if peer is not None:
            self.outbox.append(Datagram(0, peer, data))

    @property
    def octets(self):
        return b"".join(each.data for each in self.received)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Line:
    """A serial line: both devices of a pseudo-terminal pair, joined by nothing but the kernel."""

    def __init__(self):
        self.far, self.near = pty.openpty()
        for each in (self.far, self.near):
            tty.setraw(each)
        self.device = os.ttyname(self.near)

    def close(self):
        os.close(self.far)
        os.close(self.near)


@pytest.fixture
def ends():
    """Return the proxy's end and the other one of a link of some kind."""
    with ExitStack() as stack:

        def made(kind):
            here = f"127.0.0.1:{free_port()}"
            if kind == "serial":
                line = Line()
                stack.callback(line.close)
                return parse_endpoint(f"serial:{line.device}:57600"), line
            opposite = {"udpin": "udpout", "udpout": "udpin", "tcp": "tcpin", "tcpin": "tcp"}[kind]
            return parse_endpoint(f"{kind}:{here}"), f"{opposite}:{here}"

        yield made


class Station:
    """Whoever is at the other end of one of the proxy's links."""

    def __init__(self, end, stack):
        self.line = end if isinstance(end, Line) else None
        if self.line is None:
            self.engine = Hearing(end)
            self.driver = stack.enter_context(Driver(self.engine, RealClock()))
        else:
            os.set_blocking(self.line.far, False)
        self.octets = b""

    def turn(self):
        if self.line is None:
            passes = iter((False, True))
            self.driver.run(lambda: next(passes))
            self.octets = self.engine.octets
            return
        try:
            self.octets += os.read(self.line.far, 4096)
        except BlockingIOError:
            return

    def say(self, data):
        if self.line is None:
            self.engine.say(data)
        else:
            os.write(self.line.far, data)


def run(proxy, stations, until):
    ends_s = time.monotonic() + LIMIT_S
    while not until():
        assert time.monotonic() < ends_s
        passes = iter((False, True))
        proxy.run(lambda passes=passes: next(passes))
        for each in stations:
            each.turn()


KINDS = ["udpin", "udpout", "tcp", "tcpin", "serial"]
SILENT = {"udpout", "tcp"}
"""Ends at which the other side listens, and doesn't speak before it has received somebody."""
SOME = {("udpin", "serial"), ("serial", "serial"), ("tcp", "tcpin"), ("tcpin", "udpout"), ("udpout", "udpin")}
PAIRS = [
    pytest.param(listen, to, marks=[] if (listen, to) in SOME else pytest.mark.slow)
    for listen in KINDS
    for to in KINDS
    if not {listen, to} <= SILENT
]


@pytest.mark.parametrize(("listen", "to"), PAIRS)
def test_frames_pass_in_both_directions_between_any_two_kinds(ends, listen, to):
    (here, vehicle_end), (there, station_end) = ends(listen), ends(to)
    with ExitStack() as stack:
        proxy = stack.enter_context(Proxy(here, there, Relay(1)))
        vehicle, station = Station(vehicle_end, stack), Station(station_end, stack)
        said = b"".join(SAID)

        def passes():
            vehicle.say(said)
            station.say(ANSWER)
            return said in station.octets and ANSWER in vehicle.octets

        run(proxy, (vehicle, station), passes)


@pytest.mark.slow
def test_of_a_stream_whole_frames_are_lost(ends):
    here, line = ends("serial")
    there, station_end = ends("udpout")
    relay = Relay(5)
    apply_line(relay.impairments, "downlink loss 0.5")
    with ExitStack() as stack:
        proxy, station = stack.enter_context(Proxy(here, there, relay)), Station(station_end, stack)
        stream = b"".join(SAID * 20)
        for begin in range(0, len(stream), 201):
            os.write(line.far, stream[begin : begin + 201])
            run(proxy, [station], iter((False, True)).__next__)
        run(proxy, [station], lambda: relay.statistics(Direction.DOWNLINK).datagrams == 60)
        run(proxy, [station], iter((False, False, True)).__next__)
        received = [each.data for each in station.engine.received]
    assert set(received) <= set(SAID)
    assert len(received) == 60 - relay.statistics(Direction.DOWNLINK).lost
    assert 10 < len(received) < 50


def test_a_vehicle_on_tcp_is_met_with_delay(ends):
    (here, vehicle_end), (there, station_end) = ends("tcp"), ends("tcpin")
    relay = Relay(1)
    apply_line(relay.impairments, "delay-ms 30")
    with ExitStack() as stack:
        proxy = stack.enter_context(Proxy(here, there, relay))
        both = Station(vehicle_end, stack), Station(station_end, stack)

        def passes():
            for each, data in zip(both, (SAID[0], ANSWER), strict=True):
                each.say(data)
            return SAID[0] in both[1].octets

        run(proxy, both, passes)
    assert relay.statistics(Direction.DOWNLINK).mean_delay_s == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("listen", "to"),
    [
        ("tcpin:127.0.0.1:5760", "tcp:localhost:5760"),
        ("udpout:127.0.0.1:5760", "udpin:127.0.0.1:5760"),
        ("mcast:", "mcast:"),
        ("serial:/dev/null:57600", "serial:/dev/null:57600"),
    ],
)
def test_its_own_end_is_refused_as_a_target(listen, to):
    with pytest.raises(EndpointError, match="where we listen ourselves"):
        Proxy(parse_endpoint(listen), parse_endpoint(to), Relay(1))


FRAMES = st.lists(
    st.sampled_from([*SAID, ANSWER, signed(SAID[1], bytes(32), 0, 7), VEHICLE.encode(Heartbeat(1, 3), 1)])
)


@given(FRAMES, st.lists(st.integers(1, 40), min_size=1))
def test_a_stream_is_cut_into_its_frames_however_it_comes(frames, sizes):
    stream, pieces, cut, at, turn = b"".join(frames), Pieces(), [], 0, 0
    while at < len(stream):
        size = sizes[turn % len(sizes)]
        cut += pieces.cut(stream[at : at + size])
        at, turn = at + size, turn + 1
    assert cut == frames


@given(st.binary(max_size=600))
def test_no_byte_is_changed_or_left_out_for_long(data):
    pieces = Pieces()
    cut = b"".join(pieces.cut(data))
    assert data.startswith(cut)
    assert len(data) - len(cut) < 300
    rest = b"".join(pieces.cut(b"\x00" * 300))
    assert (cut + rest).startswith(data)


def test_frames_after_noise_pass_whole():
    parser = StreamParser()
    cut = Pieces().cut(b"noise" + b"".join(SAID))
    assert cut == [b"noise", *SAID]
    assert [each.raw for piece in cut for each in parser.feed(piece)] == SAID

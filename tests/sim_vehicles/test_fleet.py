"""Many vehicles as one engine: links, order, repeatability."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.clock import Instant, VirtualClock, after
from airlink.endpoint import Address, parse_endpoint
from airlink.engine import Datagram, Engine, MemoryNetwork
from airlink.frame import FrameWriter
from airlink.messages.command import CommandInt, CommandLong
from airlink.messages.system import Heartbeat, Timesync
from airlink.stream_parser import StreamParser

GROUND = Address("127.0.0.1", 14550)
SPEED, HEADING = 43000, 43002


class Recorder(Engine):
    """A ground station that steers vehicle 1 at 10 Hz and keeps every byte."""

    def __init__(self, endpoint="udpin:0.0.0.0:14550"):
        self.endpoint, self.bytes, self.out, self.peers = parse_endpoint(endpoint), [], [], []
        self.timer, self.ticks, self.writer = Instant(0), 0, FrameWriter(255, 190)

    def endpoints(self):
        return (self.endpoint,)

    def receive(self, datagrams, now):
        for datagram in datagrams:
            self._take(datagram, now)

    def _take(self, datagram, now):
        self.bytes.append((now, datagram.peer, datagram.data))
        if datagram.peer not in self.peers:
            self.peers.append(datagram.peer)
            self._say(datagram.peer, CommandLong(0, 1, 176, 0, 1, 15))
            self._say(datagram.peer, CommandLong(0, 1, 511, 0, 33, 100_000))

    def datagrams_to_send(self):
        out, self.out = self.out, []
        return out

    def next_timer(self):
        return self.timer

    def handle_timer(self, now):
        self.timer = after(now, 0.1)
        self.ticks += 1
        for peer in self.peers or ([self.endpoint.address] if self.endpoint.kind == "udpout" else []):
            self._say(peer, CommandInt(0, 1, 3, SPEED, 0, 0, 0.0, 20.0 + self.ticks % 7))
            self._say(peer, CommandInt(0, 1, 3, HEADING, 0, 0, 1.0, float(self.ticks % 90), 5.0))

    def _say(self, peer, message):
        self.out.append(Datagram(0, peer, self.writer.encode(message)))


def test_two_runs_send_the_same_bytes_at_the_same_instants(make_air):
    def sent():
        ground, network = Recorder(), MemoryNetwork(VirtualClock())
        network.attach(make_air(4).fleet)
        network.attach(ground)
        network.run(lambda: network.clock.now() > after(Instant(0), 20.0))
        return ground.bytes

    once = sent()
    assert once == sent()
    assert len(once) > 4 * 20 * 20


def test_a_late_timer_catches_up_turn_by_turn(make_air):
    prompt, late = make_air().fleet, make_air().fleet
    reported = []
    for fleet, step_s in ((prompt, 0.02), (late, 1.0)):
        instant = Instant(0)
        while instant < after(Instant(0), 10.0):
            instant = after(instant, step_s)
            fleet.handle_timer(instant)
        reported.append(fleet.datagrams_to_send())
    assert reported[0] == reported[1]
    assert late.next_timer() == prompt.next_timer()


def test_a_reply_leaves_on_the_main_loop_and_not_before(make_air):
    fleet = make_air().fleet
    fleet.receive([Datagram(0, GROUND, FrameWriter(255, 190).encode(CommandLong(1, 1, 520)))], Instant(5_000_000))
    assert fleet.datagrams_to_send() == []
    fleet.handle_timer(fleet.next_timer())
    assert fleet.datagrams_to_send()


def test_vehicles_speak_with_their_own_system_ids_and_do_what_they_are_reported_alone(make_air):
    air = make_air(3)
    air.run(5.0)
    for vehicle in range(3):
        assert air.set_mode(15, target=vehicle + 1, vehicle=vehicle) == 0
        reported = air.command_int(HEADING, 1, 30.0 * vehicle, 10.0, target=vehicle + 1, vehicle=vehicle)
        assert reported == 0
    air.run(60.0)
    assert {message.get_srcSystem() for _, message in air.ground.received} == {1, 2, 3}
    for vehicle in range(3):
        assert math.degrees(air.state("heading_rad", vehicle)) - 30.0 * vehicle < 1e-6


def test_a_listening_vehicle_tells_everyone_it_receives_and_forgets_the_silent(make_air):
    air = make_air(endpoint="udpin:127.0.0.1:14560")
    other = air.peer(Address("127.0.0.1", 15000), system=250)
    air.run(3.0)
    assert not air.ground.received
    beat = air.ground.dialect.heartbeat_encode(6, 8, 0, 0, 0)
    other.send(beat)
    for _ in range(30):
        air.ground.send(beat)
        air.run(1.0)
    assert len(air.ground.of("ATTITUDE")) >= 29
    assert 9 <= len(other.of("ATTITUDE")) <= 11


def test_a_frame_cut_over_two_datagrams_is_understood(flying):
    raw = FrameWriter(255, 190).encode(CommandLong(1, 1, 520))
    flying.ground.send_bytes(raw[:9])
    flying.run(0.02)
    flying.ground.send_bytes(raw[9:])
    flying.run(0.02)
    assert flying.ground.of("COMMAND_ACK")[-1].command == 520


def test_a_mavlink_1_request_is_answered(flying):
    raw = FrameWriter(255, 190).encode(CommandLong(1, 1, 520), version=1)
    flying.ground.send_bytes(raw)
    flying.run(0.02)
    assert flying.ground.of("COMMAND_ACK")[-1].command == 520


def test_a_parser_is_kept_for_each_remote(flying):
    other = flying.peer(Address("127.0.0.1", 15000))
    raw = FrameWriter(255, 190).encode(CommandLong(1, 1, 520))
    flying.ground.send_bytes(raw[:9])
    other.send_bytes(FrameWriter(250, 190).encode(Heartbeat(6, 8)))
    flying.ground.send_bytes(raw[9:])
    flying.run(0.02)
    assert flying.ground.of("COMMAND_ACK")[-1].command == 520


@given(st.lists(st.binary(max_size=300), max_size=20))
@settings(deadline=None, max_examples=50)
def test_no_bytes_from_the_network_stop_a_vehicle(make_air_for_any_bytes, datagrams):
    air = make_air_for_any_bytes()
    for data in datagrams:
        air.ground.send_bytes(data)
    air.run(1.1)
    assert air.ground.of("HEARTBEAT")


@given(
    command=st.sampled_from([22, 20, 176, 178, 186, 192, 300, 400, 410, 510, 511, 512, 520, 43000, 43001, 43002]),
    params=st.lists(st.floats(width=32), min_size=7, max_size=7),
    frame=st.integers(0, 255),
    position=st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1)),
)
@settings(deadline=None, max_examples=120)
def test_every_known_command_is_answered_once_whatever_its_numbers(
    make_air_for_any_bytes, command, params, frame, position
):
    air = make_air_for_any_bytes()
    assert air.command_long(command, *params) is not None
    x, y = position
    assert air.command_int(command, *params[:4], frame=frame, x=x, y=y, z=params[6]) is not None
    air.run(0.1)
    assert all(math.isfinite(air.state(name)) for name in ("north_m", "east_m", "height_m", "heading_rad"))


def test_what_arrives_after_a_pause_is_read_by_no_cycle_that_is_made_up_for(flying):
    """A probe is answered with the time of its arrival, not with an earlier one."""
    cycle, paused_s = flying.fleet.next_timer(), 5.0
    arrived = after(cycle, paused_s)
    flying.fleet.receive([Datagram(0, GROUND, FrameWriter(255, 190).encode(Timesync(0, 7)))], arrived)
    flying.fleet.handle_timer(after(cycle, paused_s + 1.0))
    sent = [StreamParser().feed(datagram.data)[0].message for datagram in flying.fleet.datagrams_to_send()]
    (answer,) = [message for message in sent if isinstance(message, Timesync) and message.ts1_ns == 7]
    assert arrived <= answer.tc1_ns <= after(arrived, 0.02)

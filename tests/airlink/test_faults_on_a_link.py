"""Faults of telemetry that `airlink-proxy` injects: frames altered as they pass, from one system, for a time."""

from __future__ import annotations

import math

import pytest

from airlink.cli.fault_option import changed, described, parse_fault
from airlink.clock import NANOSECONDS, Instant
from airlink.frame import FrameWriter
from airlink.impairment import Direction
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import GlobalPositionInt, VfrHud
from airlink.relay import Relay
from airlink.stream_parser import StreamParser
from airlink.telemetry_faults.passing import FaultError

HEARTBEAT = Heartbeat(1, 3)
HUD = VfrHud(22.0, 21.0, 0.3, 50, 130.0, 1.0)


def position(time_s=10.0):
    return GlobalPositionInt(time_s, 0.6, 2.0, 130.0, 100.0, 20.0, 5.0, -1.0, 0.3)


def at(time_s):
    return Instant(NANOSECONDS + round(time_s * NANOSECONDS))


def passed(relay, data, time_s, direction=Direction.DOWNLINK):
    relay.accept((0, direction, data), at(time_s))
    return [each for _, _, each in relay.pop_due(at(time_s))]


def frames(data):
    return [frame for each in data for frame in StreamParser().feed(each)]


def test_only_the_vehicle_named_is_altered_while_the_fault_lasts_and_its_frames_keep_ids_and_numbers():
    relay = Relay(1)
    relay.faults = (parse_fault("quantity=height,effect=offset,amount=-20,vehicles=[3],at_s=5,for_s=10"),)
    third, second = FrameWriter(3, 1), FrameWriter(2, 1)
    reported = {}
    for time_s in (0.0, 6.0, 16.0):
        both = third.encode(HEARTBEAT) + third.encode(position()) + second.encode(position())
        reported[time_s] = frames(passed(relay, both, time_s))
    heights = {time_s: [each.message.alt_m for each in found[1:]] for time_s, found in reported.items()}
    assert heights == {0.0: [130.0, 130.0], 6.0: [110.0, 130.0], 16.0: [130.0, 130.0]}
    assert [(each.system, each.component, each.sequence) for each in reported[6.0]] == [(3, 1, 2), (3, 1, 3), (2, 1, 1)]


def test_without_faults_that_act_every_byte_passes_as_it_came():
    relay = Relay(1)
    relay.faults = (parse_fault("quantity=velocity,effect=zero,vehicles=[9]"),)
    for data in (b"no frame \xfd\x00", FrameWriter(3, 1).encode(position()) + b"\xfe\x05begun", b""):
        assert b"".join(passed(relay, data, 1.0)) == data


def test_commands_to_vehicles_are_never_altered():
    relay = Relay(1)
    relay.faults = (parse_fault("quantity=heartbeat,effect=missing"),)
    data = FrameWriter(255, 190).encode(HEARTBEAT)
    assert passed(relay, data, 0.0, Direction.UPLINK) == [data]
    assert passed(relay, data, 0.0) == []


def test_late_messages_come_later_and_the_others_of_their_datagram_at_once():
    relay, writer = Relay(1), FrameWriter(3, 1)
    relay.faults = (parse_fault("quantity=position,effect=late,amount=2"),)
    at_once = frames(passed(relay, writer.encode(position()) + writer.encode(HUD), 0.0))
    assert [type(each.message) for each in at_once] == [VfrHud]
    assert relay.next_timer() == at(2.0)
    assert relay.pop_due(at(1.9)) == []
    (late,) = relay.pop_due(at(2.0))
    assert [type(each.message) for each in frames([late[2]])] == [GlobalPositionInt]
    assert relay.elapsed_s == 0.0
    relay.accept((0, Direction.DOWNLINK, writer.encode(position())), at(3.0))
    relay.disconnect(0)
    assert relay.next_timer() is None


def test_two_faults_act_one_after_the_other():
    relay = Relay(1)
    relay.faults = (
        parse_fault("quantity=velocity,effect=scale,amount=0.5"),
        parse_fault("quantity=velocity,effect=sign"),
    )
    ((frame,),) = [frames(passed(relay, FrameWriter(3, 1).encode(position()), 0.0))]
    assert (frame.message.vx_mps, frame.message.vz_mps) == (-10.0, 0.5)


def test_a_fault_typed_while_it_runs_begins_then_and_none_ends_all():
    (fault,) = changed((), "quantity=position,effect=offset,amount=[0, 20, 0],for_s=20", 31.0)
    assert (fault.at_s, fault.for_s, fault.amount, fault.vehicles) == (31.0, 20.0, (0.0, 20.0, 0.0), frozenset())
    reported = "quantity=position,effect=offset,amount=[0.0,20.0,0.0],vehicles=all,at_s=31,for_s=20"
    assert described(fault) == f"fault: {reported}"
    assert changed((fault,), "none", 40.0) == ()
    assert math.isinf(parse_fault("quantity=position,effect=freeze").for_s)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("position", "found 'position'; allowed: KEY=VALUE,..., KEY one of quantity, effect, amount"),
        ("quantity=place,effect=freeze", "quantity: found place; allowed: position, velocity"),
        ("quantity=position", "effect: found none; allowed: freeze, offset"),
        ("quantity=position,effect=freeze,until_s=3", "found key 'until_s'; allowed: quantity"),
        ("quantity=position,effect=offset", "amount: found none for offset; allowed: a number, or a list of 3"),
        ("quantity=position,effect=offset,amount=[1,2]", "amount: found [1, 2]; allowed: a number, or a list of 3"),
        ("quantity=position,effect=freeze,at_s=-1", "at_s: found -1; allowed: numbers from 0"),
        ("quantity=position,effect=freeze,vehicles=[0]", "vehicles: found [0]; allowed: a list of system ids from 1"),
        ("quantity=heartbeat,effect=nan", "effect: found nan of heartbeat; allowed: freeze, late"),
    ],
)
def test_what_cannot_be_injected_is_refused_with_what_can(text, error):
    with pytest.raises(FaultError) as refused:
        parse_fault(text)
    assert str(refused.value).startswith(error)

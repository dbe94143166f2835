"""Messages against pymavlink as a peer: it reads what we write, writes the same bytes, and we read what it writes."""

import importlib
import math
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink import mavlink as m
from airlink.frame import FrameWriter
from airlink.messages import KINDS
from airlink.messages.command import CommandAck, CommandInt, CommandLong, ParamSet, ParamValue
from airlink.messages.system import CurrentMode, Heartbeat, Statustext
from airlink.messages.telemetry import Attitude, GlobalPositionInt, HomePosition, VfrHud, Wind
from airlink.stream_parser import StreamParser
from tests.airlink import generate_messages

dialect = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
dialect_v1 = importlib.import_module("pymavlink.dialects.v10.ardupilotmega")

KIND = {type(kind.example): kind for kind in KINDS.values()}
MESSAGES = tuple(each for each, kind in KIND.items() if kind.name not in m.LATER)
DEGREE = math.pi / 180
SI = {
    "ms": ("_ms", "_s", 1e-3),
    "m": ("", "_m", 1.0),
    "mm": ("", "_m", 1e-3),
    "m/s": ("", "_mps", 1.0),
    "cm/s": ("", "_mps", 1e-2),
    "m/s/s": ("", "_mps2", 1.0),
    "rad": ("", "_rad", 1.0),
    "rad/s": ("", "_radps", 1.0),
    "deg": ("", "_rad", DEGREE),
    "cdeg": ("", "_rad", DEGREE / 100),
    "degE7": ("", "_rad", DEGREE / 1e7),
    "mV": ("", "_v", 1e-3),
    "cA": ("", "_a", 1e-2),
    "ns": ("", "_ns", None),
}
INTEGERS = {
    "int8_t": "b", "uint8_t": "B", "uint8_t_mavlink_version": "B", "int16_t": "h", "uint16_t": "H",
    "int32_t": "i", "uint32_t": "I", "int64_t": "q", "uint64_t": "Q",
}  # fmt: skip


def source(kind):
    return dialect.mavlink_map[KIND[kind].message_id]


def fields(kind):
    """Yield name, type, unit and array length of every field of the dialect's message."""
    described = source(kind)
    for name, of_type in zip(described.fieldnames, described.fieldtypes, strict=True):
        length = described.array_lengths[described.ordered_fieldnames.index(name)]
        yield name, of_type, described.fieldunits_by_name.get(name, ""), length


def wire_values(of_type, length):
    if of_type == "char":
        text = st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=length)
        return text.map(str.encode)
    if of_type == "float":
        number = st.floats(width=32, allow_nan=False)
    else:
        bits = 8 * struct.calcsize(INTEGERS[of_type])
        low, high = (0, 2**bits - 1) if of_type.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        number = st.integers(low, high) | st.sampled_from((low, high, 0))
    return st.lists(number, min_size=length, max_size=length) if length else number


def to_si(value, of_type, unit):
    if of_type == "char":
        return value.decode()
    if isinstance(value, list):
        return tuple(to_si(each, of_type, unit) for each in value)
    factor = SI.get(unit, ("", "", None))[2]
    if factor is None:
        return value
    return math.nan if of_type == "uint16_t" and value == 65535 else value * factor


def left_out(of_type, length):
    if of_type == "char":
        return b""
    return [0] * length if length else 0


def draw_message(data, kind):
    """Return one message twice: the dialect's fields by name, as on the wire, and ours."""
    wire, ours = {}, []
    for index, (name, of_type, unit, length) in enumerate(fields(kind)):
        if index < len(KIND[kind].fields):
            wire[name] = data.draw(wire_values(of_type, length), name)
            ours.append(to_si(wire[name], of_type, unit))
        else:
            wire[name] = left_out(of_type, length)
    return wire, kind(*ours)


def peer(speaks=dialect, system=7, component=9, sequence=0):
    mav = speaks.MAVLink(None, system, component)
    mav.seq = sequence
    return mav


def each_message(test):
    return pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)(
        settings(max_examples=10, deadline=None)(given(st.data())(test))
    )


@each_message
def test_frames_are_pymavlinks_to_the_byte_and_each_side_reads_the_others(kind, data):
    wire, message = draw_message(data, kind)
    ours, theirs = FrameWriter(7, 9).encode(message), source(kind)(**wire).pack(peer())
    assert ours == theirs
    pymavlink_reads(ours, kind, wire, tuple(wire)[: len(KIND[kind].fields)])
    we_read(source(kind)(**wire).pack(peer(sequence=200)), message)

    of_version_1 = dialect_v1.mavlink_map.get(KIND[kind].message_id)
    if of_version_1 is None:  # the message is new in version 2
        return
    base = {name: wire[name] for name in of_version_1.fieldnames}  # version 1 has no extension fields
    older = FrameWriter(7, 9).encode(message, version=1)
    assert older == of_version_1(**base).pack(peer(dialect_v1))
    pymavlink_reads(older, kind, wire, [name for name in base if name in tuple(wire)[: len(KIND[kind].fields)]])


def pymavlink_reads(raw, kind, wire, names):
    (received,) = peer().parse_buffer(raw)
    assert (received.get_srcSystem(), received.get_srcComponent(), received.get_seq()) == (7, 9, 0)
    assert received.get_type() == KIND[kind].name
    for name in names:
        assert getattr(received, name) == (wire[name].decode() if isinstance(wire[name], bytes) else wire[name])


def we_read(raw, message):
    (frame,) = StreamParser().feed(raw)
    assert (frame.system, frame.component, frame.sequence, frame.version) == (7, 9, 200, 2)
    assert frame.message_id == KIND[type(message)].message_id
    received: Any = frame.message
    assert isinstance(received, type(message))
    for ours, expected in zip(received.values().values(), message.values().values(), strict=True):
        close = expected if isinstance(expected, str) else pytest.approx(expected, rel=1e-15, abs=0.0, nan_ok=True)
        assert ours == close


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
def test_a_fields_name_is_mavlinks_with_the_si_unit(kind):
    for (name, _, unit, _), ours in zip(fields(kind), KIND[kind].fields, strict=False):
        old, new, _ = SI.get(unit, ("", "", None))
        assert ours == name.removesuffix(old) + new


def test_a_message_that_the_dialect_lacks_is_as_in_the_one_that_has_it():
    newer = importlib.import_module("pymavlink.dialects.v20.development")
    theirs = newer.MAVLink_current_mode_message(3, 0x03040000, 0x05040000).pack(peer(newer))
    assert FrameWriter(7, 9).encode(CurrentMode(3, 0x03040000, 0x05040000)) == theirs
    (frame,) = StreamParser().feed(theirs)
    assert frame.message == CurrentMode(3, 0x03040000, 0x05040000)


def test_what_a_command_leaves_open_is_0():
    """These are confirmation, parameters and position."""
    long = dialect.MAVLink_command_long_message(1, 2, 400, 0, *(7 * [0])).pack(peer(dialect))
    assert FrameWriter(7, 9).encode(CommandLong(1, 2, 400)) == long
    scaled = dialect.MAVLink_command_int_message(1, 2, 6, 400, *(9 * [0])).pack(peer(dialect))
    assert FrameWriter(7, 9).encode(CommandInt(1, 2, 6, 400)) == scaled
    answer = dialect.MAVLink_command_ack_message(400, 3, 0, 0, 0, 0).pack(peer(dialect))
    assert FrameWriter(7, 9).encode(CommandAck(400, 3)) == answer


@pytest.mark.parametrize("name", generate_messages.MODULES)
def test_the_classes_are_those_of_the_table(name):
    written = (generate_messages.HERE / f"{name}.py").read_text()
    assert written == generate_messages.module(generate_messages.MODULES[name]), f"stale: {generate_messages.WRITE}"


def test_a_message_shows_its_values_and_equals_what_is_sent_alike():
    lost = GlobalPositionInt(1.0, 0.1, 0.2, 3.0, 2.0, 3.0, 4.0, 5.0, math.nan)
    assert lost == lost.but(time_boot_s=1.0)
    assert hash(Heartbeat(2, 3)) == hash(Heartbeat(2, 3))
    assert lost != lost.but(hdg_rad=0.0)
    assert Heartbeat(2, 3) != CurrentMode(2, 3)
    assert repr(CurrentMode(3, 4)) == "CurrentMode(standard_mode=3, custom_mode=4, intended_custom_mode=0)"


def over_the_wire(message) -> Any:
    (frame,) = StreamParser().feed(FrameWriter(1, 1).encode(message))
    return frame.message


def test_a_golden_frame():
    """HEARTBEAT of a copter, as in the MAVLink guide's packet format: ids, then custom_mode first."""
    frame = FrameWriter(1, 1).encode(Heartbeat(2, 3, 81, 4, 3))
    assert frame.hex() == "fd090000000101000000" + "04000000" + "0203510303" + "7e22"


@pytest.mark.parametrize(("given_s", "sent_s"), [(-5.0, 0.0), (1e10, (2**32 - 1) / 1e3), (math.inf, (2**32 - 1) / 1e3)])
def test_what_a_field_cannot_hold_is_sent_as_the_nearest_that_it_can(given_s, sent_s):
    received = over_the_wire(GlobalPositionInt(given_s, 0, 0, 1e9, -1e9, 400.0, -400.0, 1.0, 0))
    assert received.time_boot_s == pytest.approx(sent_s)
    assert received.alt_m == pytest.approx((2**31 - 1) / 1e3)
    assert received.relative_alt_m == pytest.approx(-(2**31) / 1e3)
    assert (received.vx_mps, received.vy_mps, received.vz_mps) == pytest.approx((327.67, -327.68, 1.0))


def test_integers_saturate_too():
    received = over_the_wire(CommandLong(300, -1, 70_000, 256))
    assert received == CommandLong(255, 0, 65535, 255)


def test_nan_is_unknown_where_a_16_bit_field_has_an_unknown_and_zero_in_other_integers():
    received = over_the_wire(GlobalPositionInt(1.0, 0.1, 0.2, math.nan, 2.0, 3.0, 4.0, 5.0, math.nan))
    assert math.isnan(received.hdg_rad)
    assert received.alt_m == 0.0
    assert received.relative_alt_m == 2.0


def test_nan_stays_nan_in_a_float():
    received = over_the_wire(CommandLong(1, 1, m.MAV_CMD_NAV_LOITER_UNLIM, 0, math.nan, 2.0))
    assert math.isnan(received.param1)
    assert received.param2 == 2.0


@pytest.mark.parametrize("value", [3.5e38, -1e300, 1.7e308])
def test_what_float32_cannot_hold_is_its_largest_number(value):
    largest = math.copysign(3.4028234663852886e38, value)
    assert over_the_wire(Attitude(0.0, value, 1.0, 0, 0, 0, 0)) == Attitude(0.0, largest, 1.0, 0, 0, 0, 0)
    assert over_the_wire(Wind(0.0, value, 0.25)) == Wind(0.0, largest, 0.25)
    assert over_the_wire(HomePosition(0, 0, 0, 0, 0, 0, (1.0, value, 0.0, 0.0))).q == (1.0, largest, 0.0, 0.0)


def test_infinity_is_a_float32():
    message = Attitude(0.0, math.inf, -math.inf, 0, 0, 0, 0)
    assert over_the_wire(message) == message


def test_a_whole_parameter_name_has_no_terminating_zero():
    name = "A234567890123456"
    assert over_the_wire(ParamSet(1, 1, name, 2.0, 9)).param_id == name
    assert over_the_wire(ParamSet(1, 1, name + "7", 2.0, 9)).param_id == name


@given(st.text(), st.integers(0, 7))
def test_any_text_can_be_sent(text, severity):
    received = over_the_wire(Statustext(severity, text))
    assert received.severity == severity
    assert len(received.text) <= 50


def test_bytes_that_are_no_text_are_replaced():
    wire = {
        "param_id": b"\xff\xfeGAIN",
        "param_value": 1.0,
        "param_type": 9,
        "param_count": 1,
        "param_index": 0,
    }
    parser = StreamParser()
    (frame,) = parser.feed(dialect.MAVLink_param_value_message(**wire).pack(peer()))
    assert frame.message == ParamValue("\ufffd\ufffdGAIN", 1.0, 9, 1, 0)


def test_trailing_zeros_are_not_sent_but_one_byte_always_is():
    assert FrameWriter(1, 1).encode(CommandLong(0, 0, 0))[1] == 1
    assert FrameWriter(1, 1).encode(CommandLong(0, 0, 22, 0, 1.0))[1] == 29
    assert FrameWriter(1, 1).encode(CommandLong(0, 0, 22, 0, 1.0), version=1)[1] == 33


@given(st.binary(max_size=255))
def test_a_payload_of_any_length_decodes_as_if_filled_with_zeros_and_cut(payload):
    kind = KIND[VfrHud]
    fitted = (payload + bytes(255))[: kind.length]
    one, other = (kind.example.read(each, 0, len(each)) for each in (payload, fitted))
    assert repr(one) == repr(other)


def test_the_sequence_number_counts_the_writers_frames_and_wraps():
    writer = FrameWriter(1, 1)
    parser = StreamParser()
    received = [parser.feed(writer.encode(Heartbeat(1, 3)))[0].sequence for _ in range(300)]
    assert received == [number % 256 for number in range(300)]

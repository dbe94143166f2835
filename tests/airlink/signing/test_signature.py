"""Signatures byte for byte against pymavlink's, in both directions."""

import importlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.frame import FrameWriter
from airlink.messages.command import CommandLong
from airlink.messages.system import Heartbeat, SetupSigning, Statustext
from airlink.signing.signature import (
    is_authentic,
    is_signed,
    link_id_of,
    signed,
    timestamp_of,
    unsigned,
    without_key,
)
from airlink.stream_parser import StreamParser

mavlink = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
KEY = bytes(range(32))
STAMP = 36_000_000_000_000
MESSAGES = [
    Heartbeat(6, 8, 0, 0, 4),
    Heartbeat(0, 0),
    CommandLong(2, 1, 400, 0, 1.0),
    Statustext(4, "x" * 50),
    SetupSigning(2, 1, tuple(KEY), STAMP),
]


def peer(system=255, component=25, stamp=STAMP, link_id=7, key=KEY):
    """Return pymavlink's end of a link with a key."""
    found = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    found.signing.secret_key, found.signing.timestamp, found.signing.link_id = key, stamp, link_id
    found.signing.sign_outgoing = True
    return found


@pytest.mark.parametrize("message", MESSAGES, ids=lambda each: each.kind().name)
def test_a_signed_frame_is_the_one_that_pymavlink_sends(message):
    ours, theirs = FrameWriter(255, 25), peer()
    for sequence in range(3):
        theirs.seq = sequence
        sent = mavlink.mavlink_map[message.kind().message_id]
        plain = ours.encode(message)
        frame = signed(plain, KEY, 7, STAMP + sequence)
        packed = mavlink.MAVLink(None).parse_char(plain)
        assert packed.msgname == sent.msgname
        assert frame == bytes(packed.pack(theirs))
        assert peer().parse_char(frame).get_signed()
        assert (is_signed(plain), is_signed(frame), unsigned(frame)) == (False, True, plain)
        assert (link_id_of(frame), timestamp_of(frame)) == (7, STAMP + sequence)


@given(
    st.integers(0, 255),
    st.integers(1, 2**48 - 2),
    st.binary(min_size=32, max_size=32).filter(any),
    st.text(max_size=50),
)
def test_what_pymavlink_signs_is_authentic_and_what_we_sign_pymavlink_takes(link_id, stamp, key, text):
    theirs = peer(stamp=stamp, link_id=link_id, key=key)
    raw = bytes(theirs.statustext_encode(3, text.encode()[:50]).pack(theirs))
    assert is_authentic(raw, key)
    assert (timestamp_of(raw), link_id_of(raw)) == (stamp, link_id)
    assert signed(unsigned(raw), key, link_id, stamp) == raw
    assert [each.raw for each in StreamParser().feed(unsigned(raw))] == [unsigned(raw)]


@given(st.integers(0, 8 * 40), st.sampled_from(MESSAGES[:3]))
def test_a_frame_with_any_bit_changed_is_none_or_not_authentic(bit, message):
    raw = bytearray(signed(FrameWriter(2, 1).encode(message), KEY, 0, STAMP))
    raw[bit // 8 % len(raw)] ^= 1 << bit % 8
    frame = StreamParser().first(bytes(raw))
    assert frame is None or not (is_signed(frame.raw) and is_authentic(frame.raw, KEY))


@given(st.binary(min_size=32, max_size=32), st.booleans(), st.integers(0, 2**48))
def test_a_record_has_no_key(key, sign, stamp):
    raw = FrameWriter(255, 25).encode(SetupSigning(2, 1, tuple(key), stamp))
    recorded = without_key(signed(raw, KEY, 0, STAMP) if sign else raw)
    messages = [each.message for each in StreamParser().feed(recorded)]
    assert messages == [SetupSigning(2, 1, (0,) * 32, stamp)]
    assert mavlink.MAVLink(None).parse_char(recorded).secret_key == [0] * 32


def test_other_frames_are_recorded_as_they_are():
    for message in MESSAGES[:4]:
        raw = FrameWriter(255, 25).encode(message)
        assert without_key(raw) is raw

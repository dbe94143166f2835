"""The stream parser: it never raises, buffers little, and finds every valid frame."""

import hashlib
import importlib
from itertools import pairwise

import pytest
from fastcrc import crc16
from hypothesis import given
from hypothesis import strategies as st

from airlink import checksum as checksum_module
from airlink import frame as frame_module
from airlink.checksum import Checksums, by_words, checksum
from airlink.clock import Instant
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import HEADER_V1, HEADER_V2, FrameWriter, frame_length
from airlink.messages.command import CommandAck, ParamValue
from airlink.messages.system import Heartbeat, Statustext
from airlink.messages.telemetry import Attitude
from airlink.receiver import Receiver
from airlink.stream_parser import MAX_REFUSED, StreamParser

dialect = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")

LONGEST_FRAME = 280
SOUND = FrameWriter(3, 1).encode(Heartbeat(1, 3, 81))

messages = st.one_of(
    st.builds(Heartbeat, st.integers(0, 255), st.integers(0, 255), st.integers(0, 255)),
    st.builds(Attitude, st.floats(0, 1e5), *[st.floats(-10, 10)] * 6),
    st.builds(Statustext, st.integers(0, 7), st.text(st.characters(codec="ascii"), max_size=50)),
    st.builds(CommandAck, st.integers(0, 65535), st.integers(0, 9)),
)
garbage = st.binary(max_size=40) | st.lists(
    st.sampled_from([b"\xfd", b"\xfe", b"\xfd\x00\x00", b"\xfd\xff\x01", b"\xfe\x09", SOUND[:9], SOUND[:-2]]),
    max_size=5,
).map(b"".join)


@given(st.binary(min_size=1, max_size=300), st.integers(0, 255))
def test_checksums_are_those_of_a_peer(data, extra):
    expected = crc16.mcrf4xx(data[1:] + bytes([extra]))
    assert checksum(data, len(data), extra) == by_words(data, len(data), extra) == expected


@given(st.binary(min_size=7, max_size=300), st.lists(st.tuples(st.integers(0, 1000), st.integers(0, 255))))
def test_checksums_of_parts_that_overlap_are_the_same(data, parts):
    checksums = Checksums(data)
    for offset, extra in parts:
        at = offset % (len(data) - 6)
        part = data[at : at + HEADER_V2 + 255]
        assert checksums.of(part, len(part), extra, at) == checksum(part, len(part), extra)


def frames_of(*chunks):
    parser = StreamParser()
    return [frame for chunk in chunks for frame in parser.feed(chunk)]


def raws(frames):
    return [frame.raw for frame in frames]


def cut(stream, offsets):
    borders = [0, *sorted(offset % (len(stream) + 1) for offset in offsets), len(stream)]
    return [stream[start:end] for start, end in pairwise(borders)]


@st.composite
def frame_lists(draw):
    writer = FrameWriter(draw(st.integers(1, 255)), draw(st.integers(0, 255)))
    versions = st.sampled_from((1, 2))
    return [writer.encode(message, draw(versions)) for message in draw(st.lists(messages, max_size=6))]


@given(st.lists(st.binary(max_size=400) | garbage, max_size=8))
def test_no_bytes_raise_and_little_is_kept(chunks):
    parser = StreamParser()
    taken = 0
    for chunk in chunks:
        taken += sum(len(frame.raw) for frame in parser.feed(chunk))
        assert len(parser._pending) < LONGEST_FRAME
    assert taken + parser.counts.garbage_bytes + len(parser._pending) == sum(map(len, chunks))


@given(frame_lists(), st.lists(st.integers(0, 10_000), max_size=12))
def test_frames_do_not_depend_on_how_the_stream_is_cut(frames, offsets):
    stream = b"".join(frames)
    assert raws(frames_of(*cut(stream, offsets))) == frames
    assert raws(frames_of(*[bytes([byte]) for byte in stream])) == frames


@given(st.lists(st.tuples(garbage, messages), max_size=6), st.lists(st.integers(0, 10_000), max_size=8))
def test_every_sound_frame_is_found_whatever_stands_between(parts, offsets):
    writer = FrameWriter(1, 1)
    frames = [writer.encode(message) for _, message in parts]
    stream = b"".join(noise + frame for (noise, _), frame in zip(parts, frames, strict=True))
    assert raws(frames_of(*cut(stream, offsets))) == frames


BEGINNINGS = [b"\xfe", b"\xfe\xff\x00\x01\x01\x1e", b"\xfd\xff\x00\x00\x00\x01\x01\x1e\x00\x00"]
"""The longest frames of known messages, one after the other."""


@pytest.mark.parametrize("beginning", BEGINNINGS)
def test_nested_frame_starts_are_checked_once(beginning, monkeypatch):
    gone_over = []

    def counting(data, end, extra):
        gone_over.append(end)
        return checksum(data, end, extra)

    monkeypatch.setattr(checksum_module, "checksum", counting)
    stream = beginning * (60_000 // len(beginning)) + SOUND
    assert raws(frames_of(stream)) == [SOUND]
    assert sum(gone_over) <= len(stream) + LONGEST_FRAME


def one_by_one(stream):
    """Return what the parser finds from each position on."""
    found, offset = [], 0
    while offset < len(stream):
        raw = stream[offset : offset + frame_length(stream, offset)]
        complete = len(raw) == frame_length(stream, offset) > 0
        if complete and StreamParser()._accept(raw, counted=False) is not None:
            found.append(raw)
        offset += len(raw) if found[-1:] == [raw] else 1
    return found


@given(
    st.lists(st.tuples(st.sampled_from(BEGINNINGS), st.integers(0, 99), messages), min_size=1, max_size=3),
    st.lists(st.integers(0, 10_000), max_size=8),
)
def test_sound_frames_among_nested_starts_are_found_and_every_byte_is_counted(parts, offsets):
    writer = FrameWriter(1, 1)
    stream = b"".join(beginning * times + writer.encode(message) for beginning, times, message in parts)
    whole, in_pieces = StreamParser(), StreamParser()
    found = raws(whole.feed(stream))
    assert found == one_by_one(stream)
    assert found == [raw for piece in cut(stream, offsets) for raw in raws(in_pieces.feed(piece))]
    assert whole.counts.garbage_bytes == in_pieces.counts.garbage_bytes
    assert whole.counts.garbage_bytes + len(whole._pending) + sum(map(len, found)) == len(stream)


@given(garbage, garbage)
def test_a_sound_frame_is_found_in_the_datagram_that_completes_it(before, after):
    parser = StreamParser()
    parser.feed(before)
    assert SOUND in raws(parser.feed(SOUND + after))


def test_a_frame_cut_by_a_sound_frame_is_given_up():
    parser = StreamParser()
    assert parser.feed(SOUND[:12]) == []
    assert raws(parser.feed(SOUND)) == [SOUND]
    assert parser.counts.garbage_bytes == 12


def test_garbage_that_announces_a_long_frame_hides_nothing():
    assert raws(frames_of(b"\xfd\xff\x00" + SOUND)) == [SOUND]
    assert raws(frames_of(b"\xfe\xff" + SOUND + SOUND)) == [SOUND, SOUND]


@given(st.integers(1, len(SOUND) - 1), st.integers(1, 255))
def test_one_changed_byte_makes_a_frame_unsound(index, change):
    broken = bytearray(SOUND)
    broken[index] ^= change
    parser = StreamParser()
    assert parser.feed(bytes(broken)) == []
    assert raws(parser.feed(SOUND)) == [SOUND]


def test_a_broken_frame_is_counted_once():
    text = FrameWriter(1, 1).encode(Statustext(6, "\xfd\xfe a text that holds markers"))
    parser = StreamParser()
    parser.feed(text[:-1] + bytes([text[-1] ^ 1]))
    parser.feed(SOUND)
    assert (parser.counts.frames, parser.counts.bad_checksums, parser.counts.bad) == (1, 1, 1)
    assert parser.counts.garbage_bytes == len(text)


def unknown_frame(payload=b"\x01\x02"):
    return bytes([0xFD, len(payload), 0, 0, 9, 1, 1, 0xF0, 0xFF, 0xFE]) + payload + b"\x12\x34"


def test_messages_that_the_dialect_lacks_are_dropped_and_counted():
    parser = StreamParser()
    assert raws(parser.feed(unknown_frame() + SOUND + unknown_frame() + SOUND)) == [SOUND, SOUND]
    assert parser.counts.unknown_messages == 2
    assert parser.counts.bad == 2


@given(st.binary(max_size=100))
def test_an_unknown_message_holds_back_nothing_whatever_its_payload(payload):
    assert raws(frames_of(unknown_frame(payload) + SOUND))[-1] == SOUND


def test_messages_of_the_dialect_that_have_no_class_are_frames_all_the_same():
    mav = dialect.MAVLink(None, 4, 1)
    raw = dialect.MAVLink_raw_imu_message(1, 2, 3, 4, 5, 6, 7, 8, 9, 10).pack(mav)
    (frame,) = StreamParser().feed(raw)
    assert (frame.system, frame.message_id, frame.message) == (4, dialect.MAVLINK_MSG_ID_RAW_IMU, None)


def resealed(raw, incompatible_flags):
    crc = dialect.x25crc
    body = raw[1:2] + bytes([incompatible_flags]) + raw[3:-2]
    return raw[:1] + body + crc(bytearray(body + b"\x32")).crc.to_bytes(2, "little")


@pytest.mark.parametrize("flags", [0x02, 0x80])
def test_frames_with_unknown_flags_are_dropped(flags):
    parser = StreamParser()
    assert raws(parser.feed(resealed(SOUND, flags) + SOUND)) == [SOUND]
    assert (parser.counts.incompatible, parser.counts.bad_checksums) == (1, 0)


@given(frame_lists(), st.lists(st.integers(0, 10_000), max_size=6))
def test_signed_frames_are_taken_whole_and_unverified(others, offsets):
    mav = dialect.MAVLink(None, 5, 1)
    mav.signing.sign_outgoing = True
    mav.signing.secret_key = hashlib.sha256(b"key").digest()
    signed = dialect.MAVLink_heartbeat_message(1, 3, 81, 0, 4, 3).pack(mav)
    stream = b"".join([signed, *others, signed])
    frames = frames_of(*cut(stream, offsets))
    assert raws(frames) == [signed, *others, signed]
    assert frames[0].message == Heartbeat(1, 3, 81, 0, 4, 3)
    assert len(signed) == len(FrameWriter(5, 1).encode(Heartbeat(1, 3, 81, 0, 4, 3))) + 13


def test_a_payload_with_newer_extension_fields_is_read_as_far_as_we_know_it():
    crc = dialect.x25crc
    known = FrameWriter(1, 1).encode(ParamValue("GAIN", 1.5, 9, 3, 2))
    payload = known[HEADER_V2:-2] + b"\x07\x08\x09"
    body = bytes([len(payload)]) + known[2:HEADER_V2] + payload
    raw = b"\xfd" + body + crc(bytearray(body + bytes([220]))).crc.to_bytes(2, "little")
    (frame,) = StreamParser().feed(raw)
    assert frame.message == ParamValue("GAIN", 1.5, 9, 3, 2)


def test_both_versions_may_alternate_on_one_stream():
    writer = FrameWriter(1, 1)
    stream = b"".join(writer.encode(Heartbeat(1, 3), version) for version in (1, 2, 1, 2))
    frames = frames_of(stream)
    assert [frame.version for frame in frames] == [1, 2, 1, 2]
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3]
    assert len(frames[0].raw) == HEADER_V1 + 9 + 2


@pytest.mark.parametrize("pattern", [b"\xfe", b"\xfd", b"\xfe\xfd", b"\xfd\xfe", b"\xfe\xfe\xfd"])
def test_a_flood_of_markers_is_tried_once_a_candidate_s_length(pattern, monkeypatch):
    """A candidate begins at each byte; nearly all are excluded by their headers, not one by one."""
    tried = []

    def counting(data, offset):
        tried.append(offset)
        return frame_length(data, offset)

    monkeypatch.setattr(frame_module, "frame_length", counting)
    stream = (pattern * 1400)[:1400]
    assert raws(frames_of(*[stream] * 10, SOUND)) == [SOUND]
    assert len(tried) < 10 * (len(stream) // 250 + HEADER_V2)


@pytest.mark.parametrize(("length", "found"), [(8, 0), (9, 1), (10, 1), (72, 1), (73, 0)])
def test_a_frame_of_mavlink_1_has_its_message_s_length_and_some_extension_fields_at_most(length, found):
    body = bytes([length, 7, 1, 1, 0]) + bytes([5, 0, 0, 0, 1, 3, 81, 4, 3, *[0] * 64])[:length]
    raw = b"\xfe" + body + crc16.mcrf4xx(body + b"\x32").to_bytes(2, "little")
    assert len(frames_of(raw)) == found
    assert len(frames_of(b"\xfe", raw)) == found


@pytest.mark.parametrize("beginning", [*BEGINNINGS, SOUND[:12], SOUND[:-1] + bytes([SOUND[-1] ^ 1])])
def test_a_datagram_of_beginnings_costs_a_few_checksums_and_the_next_frame_is_found(beginning, monkeypatch):
    tried = []
    accept = StreamParser._accept

    def counting(parser, raw, **keys):
        tried.append(len(raw))
        return accept(parser, raw, **keys)

    monkeypatch.setattr(StreamParser, "_accept", counting)
    receiver, peer = Receiver(), Address("127.0.0.1", 14550)
    data = (beginning * 1400)[:1400]
    assert receiver.first(Datagram(0, peer, data), Instant(0)) is None
    assert len(tried) <= MAX_REFUSED
    found = receiver.first(Datagram(0, peer, SOUND), Instant(0))
    assert found is not None
    assert found.raw == SOUND
    assert receiver.total().garbage_bytes == len(data)


def test_a_frame_split_over_datagrams_is_found_after_garbage():
    receiver, peer = Receiver(), Address("127.0.0.1", 14550)
    parts = BEGINNINGS[1] * 4 + SOUND[:9], SOUND[9:] + SOUND
    assert receiver.first(Datagram(0, peer, parts[0]), Instant(0)) is None
    found = receiver.first(Datagram(0, peer, parts[1]), Instant(0))
    assert found is not None
    assert [found.raw, found.following and found.following.raw] == [SOUND, SOUND]

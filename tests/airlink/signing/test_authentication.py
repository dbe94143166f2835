"""Which frames a key admits: new ones of its holders, and nobody else's."""

import importlib

from hypothesis import given
from hypothesis import strategies as st

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.messages.system import Heartbeat
from airlink.signing.authentication import A_MINUTE, EPOCH_US, Authentication, Verdict
from airlink.signing.key import SigningKey, key_of_passphrase
from airlink.signing.signature import MAX_TIMESTAMP, signed, timestamp_of
from airlink.signing.signed_links import SignedLink, SignedLinks, VerifyingReceiver

mavlink = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
KEY, OTHER = key_of_passphrase("ours"), key_of_passphrase("theirs")
START = Instant(0)
NOW_US = EPOCH_US + 10**9
NOW = (NOW_US - EPOCH_US) // 10
"""The timestamp at instant 0."""
HEARTBEAT = Heartbeat(6, 8, 0, 0, 4)
HERE = Address("127.0.0.1", 14550)


def state(key=KEY, **given):
    return Authentication(key, NOW_US, **given)


def frame(stamp, system=2, component=1, link_id=0, key=KEY):
    return signed(FrameWriter(system, component).encode(HEARTBEAT), key.octets, link_id, stamp)


def test_each_verdict():
    seen = state()
    plain = FrameWriter(2, 1).encode(HEARTBEAT)
    assert seen.verify(plain, START) is Verdict.UNSIGNED
    assert seen.verify(frame(NOW, key=OTHER), START) is Verdict.WRONG_KEY
    assert seen.verify(frame(NOW - A_MINUTE - 1), START) is Verdict.STALE
    assert seen.verify(frame(NOW - A_MINUTE), START) is Verdict.AUTHENTIC
    assert seen.verify(frame(NOW), START) is Verdict.AUTHENTIC
    assert seen.verify(frame(NOW), START) is Verdict.REPLAYED
    assert seen.verify(frame(NOW - 1), START) is Verdict.REPLAYED
    assert seen.verify(frame(NOW - 1, link_id=1), START) is Verdict.AUTHENTIC
    assert seen.verify(frame(NOW - 1, component=2), START) is Verdict.AUTHENTIC


def test_a_stream_that_is_known_may_be_as_late_as_its_link_is():
    seen = state()
    assert seen.verify(frame(NOW), START) is Verdict.AUTHENTIC
    assert seen.verify(frame(NOW + 1), after(START, 600.0)) is Verdict.AUTHENTIC
    assert seen.verify(frame(NOW + 1), after(START, 600.0)) is Verdict.STALE


def test_timestamps_grow_with_every_frame_and_follow_whichever_clock_is_ahead():
    ours = state()
    plain = FrameWriter(255, 25).encode(HEARTBEAT)
    stamps = [timestamp_of(ours.sign(plain, 0, START)) for _ in range(3)]
    assert stamps == [NOW, NOW + 1, NOW + 2]
    assert timestamp_of(ours.sign(plain, 0, after(START, 1.0))) == NOW + 100_000
    ahead = NOW + 10**9
    assert ours.verify(frame(ahead, key=OTHER), START) is Verdict.WRONG_KEY
    assert timestamp_of(ours.sign(plain, 0, START)) < ahead
    assert ours.verify(frame(ahead), START) is Verdict.AUTHENTIC
    assert timestamp_of(ours.sign(plain, 0, START)) == ahead + 1


def test_the_last_timestamp_of_all_ends_nothing():
    ours = state()
    assert ours.verify(frame(MAX_TIMESTAMP), START) is Verdict.AUTHENTIC
    assert timestamp_of(ours.sign(FrameWriter(255, 25).encode(HEARTBEAT), 0, START)) == MAX_TIMESTAMP


STAMPS = st.integers(NOW - 2 * A_MINUTE, NOW + 2 * A_MINUTE)
FRAMES = st.tuples(STAMPS, st.integers(1, 2), st.integers(1, 2), st.integers(0, 1), st.sampled_from((KEY, OTHER)))


@given(st.lists(FRAMES, max_size=30))
def test_the_timestamps_taken_of_a_stream_only_grow_and_forged_frames_change_nothing(frames):
    seen, undisturbed, taken = state(), state(), dict[tuple[int, int, int], int]()
    for stamp, system, component, link_id, key in frames:
        raw = frame(stamp, system, component, link_id, key)
        verdict = seen.verify(raw, START)
        if key is KEY:
            assert undisturbed.verify(raw, START) is verdict
        stream = system, component, link_id
        if verdict is Verdict.AUTHENTIC:
            assert key is KEY
            assert stamp > taken.get(stream, -1)
            assert stream in taken or stamp + A_MINUTE >= NOW
            taken[stream] = stamp
            assert seen.verify(raw, START) in {Verdict.REPLAYED, Verdict.STALE}
        elif key is OTHER:
            assert verdict is Verdict.WRONG_KEY
        else:
            assert stamp <= taken.get(stream, -1) or stamp + A_MINUTE < seen.timestamp or stamp + A_MINUTE < NOW
    assert seen.streams == undisturbed.streams == taken


@given(st.lists(FRAMES.filter(lambda each: each[-1] is KEY), max_size=30))
def test_of_signed_frames_those_are_taken_that_pymavlink_takes(frames):
    """It looks at timestamps before signatures, so a forged frame moves a stream there; among true ones it agrees."""
    seen, theirs = state(), mavlink.MAVLink(None)
    theirs.signing.secret_key, theirs.signing.timestamp = KEY.octets, NOW
    for stamp, system, component, link_id, _ in frames:
        raw = frame(stamp, system, component, link_id)
        taken = seen.verify(raw, START) is Verdict.AUTHENTIC
        assert taken == theirs.check_signature(bytearray(raw), system, component)
    assert max(seen.timestamp, NOW) == theirs.signing.timestamp


def link(**given):
    return SignedLink(state(), **given)


def first(signed_link, *raws):
    links = SignedLinks([signed_link])
    found, received = VerifyingReceiver(links).first(Datagram(0, HERE, b"".join(raws)), START), []
    while found is not None:
        received.append(found.raw)
        found = found.following
    return received


def test_of_a_datagram_the_frames_that_are_admitted_come_without_signatures():
    plain = FrameWriter(2, 1).encode(HEARTBEAT)
    signed_link = link()
    raws = (frame(NOW), plain, frame(NOW, key=OTHER), frame(NOW + 1), frame(NOW + 1))
    assert first(signed_link, *raws) == [plain, plain]
    judged = signed_link.judged[2]
    assert judged.refused == {Verdict.UNSIGNED: 1, Verdict.WRONG_KEY: 1, Verdict.REPLAYED: 1}
    assert judged.frames_refused == 3


def test_unsigned_frames_are_taken_and_counted_where_that_is_asked_for_and_forged_ones_are_not():
    plain = FrameWriter(2, 1).encode(HEARTBEAT)
    signed_link = link(takes_unsigned=True)
    assert first(signed_link, plain, frame(NOW, key=OTHER), frame(NOW)) == [plain, plain]
    assert (signed_link.judged[2].unsigned, signed_link.judged[2].frames_refused) == (1, 1)


def test_a_radios_own_frames_need_no_key_but_are_none_of_an_autopilot():
    radio = mavlink.MAVLink(None, srcSystem=51, srcComponent=68)
    status = bytes(radio.radio_status_encode(200, 200, 90, 50, 50, 0, 0).pack(radio))
    forger = mavlink.MAVLink(None, srcSystem=2, srcComponent=1)
    forged = bytes(forger.radio_status_encode(200, 200, 90, 50, 50, 0, 0).pack(forger))
    signed_link = link()
    assert first(signed_link, status, forged) == [status]
    assert signed_link.judged[2].refused == {Verdict.UNSIGNED: 1}


def test_links_without_a_key_take_no_one_whose_own_link_has_one():
    receiver = VerifyingReceiver(links := SignedLinks([link(), None], [frozenset(), frozenset({2})]))
    assert receiver.first(Datagram(1, HERE, FrameWriter(2, 1).encode(HEARTBEAT)), START) is None
    assert receiver.first(Datagram(1, HERE, FrameWriter(3, 1).encode(HEARTBEAT)), START) is not None
    assert links.judged([0, 1], 2).refused == {Verdict.ELSEWHERE: 1}
    assert links.frames_refused == 1


def test_a_recording_of_one_link_is_old_on_every_other():
    shared = state()
    links = SignedLinks([SignedLink(shared), SignedLink(shared)])
    receiver, raw = VerifyingReceiver(links), frame(NOW)
    assert receiver.first(Datagram(0, HERE, raw), START) is not None
    assert receiver.first(Datagram(1, HERE, raw), START) is None


def test_who_is_behind_is_named_once_and_limited():
    signed_link = link()
    links = SignedLinks([signed_link])
    receiver = VerifyingReceiver(links)
    for port in (*range(1, 40), 1):
        receiver.first(Datagram(0, Address("127.0.0.1", port), frame(NOW - 2 * A_MINUTE)), START)
    assert [peer.port for _, peer in links.take_behind()] == list(range(1, 17))
    assert links.take_behind() == []


def test_a_key_is_in_no_text():
    key = SigningKey(bytes(range(1, 33)))
    assert repr(key) == str(key) == "SigningKey(…)"
    assert m.MAVLINK_MSG_ID_SETUP_SIGNING == 256

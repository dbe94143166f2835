"""A signature's bytes: appended to a frame, verified, removed. Frames here are whole and have a valid checksum.

Source: MAVLink guide, "Message Signing", "Signature".
"""

from __future__ import annotations

import hashlib
import hmac
from typing import Final

from mypy_extensions import i64

from airlink import mavlink as m
from airlink.checksum import BYTE, checksum, with_byte
from airlink.frame import HEADER_V2, SIGNATURE, SIGNED_FLAG
from airlink.mavlink import crc_extras
from airlink.messages.payload import MARKER_V2
from airlink.signing.key import KEY_BYTES

FLAGS_AT: Final = 2
HASH_BYTES: Final = 6
TIMESTAMP_BYTES: Final = 6
MAX_TIMESTAMP: Final = (1 << BYTE * TIMESTAMP_BYTES) - 1
KEY_AT: Final = HEADER_V2 + 10
"""Where SETUP_SIGNING has its key, after the timestamp and the target."""
SETUP_SIGNING: Final = m.MAVLINK_MSG_ID_SETUP_SIGNING
_AFTER_FLAGS: Final = 7
"""Bytes of the header after the flags."""


def _flag_effects() -> list[int]:
    """Return by which bits the flag changes a frame's checksum, by the length of its payload.

    A checksum is linear but for its start: the effect of a bit is its remainder, which every later byte shifts.
    """
    effect = with_byte(0, SIGNED_FLAG)
    for _ in range(_AFTER_FLAGS):
        effect = with_byte(effect, 0)
    found = list[int]()
    for _ in range(256):
        effect = with_byte(effect, 0)  # the payload's next byte, or CRC_EXTRA
        found.append(effect)
    return found


_FLAG_EFFECTS: Final = _flag_effects()


def is_signed(raw: bytes) -> bool:
    """Return whether a frame has a signature; whose is another question."""
    return raw[0] == MARKER_V2 and raw[FLAGS_AT] & SIGNED_FLAG != 0


def signed(raw: bytes, key: bytes, link_id: int, timestamp: int) -> bytes:
    """Return a frame of MAVLink 2 that has no signature with one.

    Args:
        raw: the frame.
        key: 32 bytes.
        link_id: of the sender's link, 0 to 255.
        timestamp: 10 µs since 2015, 48 bits.
    """
    covered = _with_flag(raw, SIGNED_FLAG) + bytes((link_id,)) + timestamp.to_bytes(TIMESTAMP_BYTES, "little")
    return covered + _hash(key, covered)


def unsigned(raw: bytes) -> bytes:
    """Return a frame without its signature, as records have it, so that no one collects signatures there."""
    return _with_flag(raw[: len(raw) - SIGNATURE], 0) if is_signed(raw) else raw


def is_authentic(raw: bytes, key: bytes) -> bool:
    """Return whether a signed frame's signature was made with a key."""
    covered = len(raw) - HASH_BYTES
    return hmac.compare_digest(_hash(key, raw[:covered]), raw[covered:])


def timestamp_of(raw: bytes) -> int:
    """Return a signed frame's timestamp, 10 µs since 2015."""
    begin = len(raw) - HASH_BYTES - TIMESTAMP_BYTES
    return int.from_bytes(raw[begin : begin + TIMESTAMP_BYTES], "little")


def link_id_of(raw: bytes) -> int:
    """Return the id of the sender's link in a signed frame."""
    return raw[len(raw) - SIGNATURE]


def without_key(raw: bytes) -> bytes:
    """Return a frame as it may be recorded: SETUP_SIGNING with zeros for its key, and without a signature."""
    if raw[0] != MARKER_V2 or int.from_bytes(raw[7:HEADER_V2], "little") != SETUP_SIGNING:
        return raw
    plain = unsigned(raw)
    end = HEADER_V2 + plain[1]
    payload = plain[HEADER_V2 : min(KEY_AT, end)] + bytes(max(0, min(KEY_BYTES, end - KEY_AT)))
    begun = plain[:HEADER_V2] + payload + plain[HEADER_V2 + len(payload) : end]
    check: i64 = checksum(begun, len(begun), crc_extras()[SETUP_SIGNING])
    return begun + bytes((check & 0xFF, check >> BYTE))


def _with_flag(raw: bytes, flag: int) -> bytes:
    """Return a frame without signature bytes whose flag says that it has some, or not, and its checksum that too."""
    end: i64 = HEADER_V2 + raw[1]
    check: i64 = raw[end] | raw[end + 1] << BYTE
    check ^= _FLAG_EFFECTS[raw[1]]
    head = bytes((raw[0], raw[1], flag))
    return head + raw[FLAGS_AT + 1 : end] + bytes((check & 0xFF, check >> BYTE))


def _hash(key: bytes, covered: bytes) -> bytes:
    return hashlib.sha256(key + covered).digest()[:HASH_BYTES]

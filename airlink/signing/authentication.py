"""What one key has signed and seen, and its verdict on a frame.

All links with the same key share it, as ArduPilot's channels do: a frame that was recorded on one link is old on every
other. No clock has to be right. A timestamp is at least one more than the last one that was sent, and than any
that was received with a valid signature, so both ends go by whichever clock is ahead.

Source: MAVLink guide, "Message Signing", "Timestamp Handling"; `mavlink_signature_check` of its C library.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final

from airlink.clock import MICROSECONDS, NANOSECONDS, Instant
from airlink.signing.key import SigningKey
from airlink.signing.signature import MAX_TIMESTAMP, is_authentic, is_signed, link_id_of, signed, timestamp_of

EPOCH_US: Final = 1_420_070_400 * MICROSECONDS
"""2015-01-01 00:00 UTC, microseconds since 1970."""
TICK_US: Final = 10
A_MINUTE: Final = 60 * MICROSECONDS // TICK_US
"""By how much a stream that is received for the first time may be behind, in the unit of timestamps."""
SILENT_NS: Final = 2 * NANOSECONDS
"""After so long without a new frame of a stream its sender may be behind, rather than copied."""
Stream = tuple[int, int, int]
"""System, component, and the id of the sender's link: one sequence of growing timestamps."""


class Verdict(Enum):
    """What a signature says about a frame, in words. Only authentic frames are taken, and unsigned ones on request."""

    AUTHENTIC = "signed with our key, and new"
    WRONG_KEY = "signed with another key, or altered"
    REPLAYED = "signed, but not newer than the last one"
    STALE = "signed, but more than a minute behind"
    ELSEWHERE = "on a link that isn't signed with its key"
    UNSIGNED = "not signed"


class Authentication:
    """The state of one key."""

    def __init__(
        self,
        key: SigningKey,
        utc_at_0_us: int,
        timestamp: int = 0,
        streams: Mapping[Stream, int] | None = None,
    ) -> None:
        """Begin, or go on.

        Args:
            key: 32 bytes.
            utc_at_0_us: UTC at instant 0, microseconds since 1970.
            timestamp: the newest that was sent or received before, 10 µs since 2015.
            streams: the newest timestamp of each, as received before.
        """
        self._key, self._at_0_us = key.octets, utc_at_0_us - EPOCH_US
        self.timestamp = timestamp
        """The newest that was sent or received."""
        self.streams: dict[Stream, int] = dict(streams or {})
        """The newest that was received of each stream."""
        self._received_at = dict[Stream, Instant]()
        """When that was."""

    def sign(self, raw: bytes, link_id: int, now: Instant) -> bytes:
        """Return a frame of MAVLink 2 without signature with ours."""
        self.timestamp = min(max(self.timestamp + 1, self._clock(now)), MAX_TIMESTAMP)
        return signed(raw, self._key, link_id, self.timestamp)

    def verify(self, raw: bytes, now: Instant) -> Verdict:
        """Return the verdict on a frame with a valid checksum, and remember it if it is authentic.

        A frame that isn't authentic changes nothing: not even the timestamp that it claims is looked at before its
        signature is known to be right.
        """
        if not is_signed(raw):
            return Verdict.UNSIGNED
        if not is_authentic(raw, self._key):
            return Verdict.WRONG_KEY
        stream, timestamp = (raw[5], raw[6], link_id_of(raw)), timestamp_of(raw)
        last = self.streams.get(stream)
        if last is None or timestamp <= last:
            if timestamp + A_MINUTE < self.at(now):
                return Verdict.STALE
            if last is not None:
                return Verdict.REPLAYED
        self.streams[stream], self._received_at[stream] = timestamp, now
        self.timestamp = max(self.timestamp, timestamp)
        return Verdict.AUTHENTIC

    def at(self, now: Instant) -> int:
        """Return the newest timestamp: by the clock, or what was sent or received, if that is ahead."""
        return max(self.timestamp, self._clock(now))

    def copied(self) -> Authentication:
        """Return the same state for a second reader of the same frames."""
        return Authentication(SigningKey(self._key), self._at_0_us + EPOCH_US, self.timestamp, self.streams)

    def is_silent(self, raw: bytes, now: Instant) -> bool:
        """Return whether no new frame of a frame's stream has come for a while, or ever since we began."""
        at = self._received_at.get((raw[5], raw[6], link_id_of(raw)))
        return at is None or now - at > SILENT_NS

    def restart(self, timestamp: int) -> None:
        """Forget the streams, and go on from a timestamp, as after a restart."""
        self.streams.clear()
        self._received_at.clear()
        self.timestamp = timestamp

    def _clock(self, now: Instant) -> int:
        """Return the timestamp by the machine's clock."""
        return max(0, (self._at_0_us + now // 1000) // TICK_US)

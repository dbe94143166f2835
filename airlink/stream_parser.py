"""A stream of bytes from one remote to messages, whatever lies between its frames.

Source: MAVLink guide, "Packet Serialization".
"""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Literal

from mypy_extensions import i64

from airlink.checksum import BYTE, Checksums, checksum
from airlink.frame import HEADER_V1, HEADER_V2, SIGNED_FLAG, Frame, frame_length, message_id_of
from airlink.frame_starts import EXTENDED, frame_starts
from airlink.mavlink import base_lengths, crc_extras
from airlink.messages import kind_of
from airlink.messages.payload import MARKER_V2

_find_marker: Final = re.compile(rb"[\xfd\xfe]").search
_EXTRAS: Final = crc_extras()
_LENGTHS: Final = base_lengths()


MAX_REFUSED: Final = 12
"""Candidates in a datagram from a network that may be no frames; after as many its rest is skipped."""


@dataclass
class ParserCounts:
    """Statistics of a parser."""

    frames: int = 0
    garbage_bytes: int = 0
    """Bytes outside valid frames, including those of rejected frames."""
    bad_checksums: int = 0
    unknown_messages: int = 0
    incompatible: int = 0
    signed: int = 0
    """Of the valid frames, those with a signature."""
    unread_bytes: int = 0
    """Bytes of strangers that were dropped before they were parsed."""

    @property
    def bad(self) -> int:
        """Frames that were dropped, whatever the cause."""
        return self.bad_checksums + self.unknown_messages + self.incompatible

    def __add__(self, other: ParserCounts) -> ParserCounts:
        """Return the sums of both."""
        return ParserCounts(
            self.frames + other.frames,
            self.garbage_bytes + other.garbage_bytes,
            self.bad_checksums + other.bad_checksums,
            self.unknown_messages + other.unknown_messages,
            self.incompatible + other.incompatible,
            self.signed + other.signed,
            self.unread_bytes + other.unread_bytes,
        )


class StreamParser:
    """Finds frames in one remote's bytes, however these are split into datagrams; garbage is skipped and counted.

    A valid frame is accepted as soon as it is complete, even if the bytes before it look like the start of a longer
    one. So the frames found don't depend on how the bytes were split.
    """

    def __init__(self, max_refused: int = 0) -> None:
        """Start with no bytes; `max_refused`: after so many refused candidates, what is given at once is skipped.

        0 is no limit: every frame is found, in a time that grows with the bytes.
        """
        self._max_refused = max_refused
        self.counts = ParserCounts()
        self._pending = b""
        self._refused_to = 0
        """Up to where, in the unparsed bytes, those of a refused candidate reach: others in it aren't counted."""

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames that `data` completes. Never raises, whatever the bytes."""
        frames, frame = list[Frame](), self.first(data)
        while frame is not None:
            frames.append(frame)
            following, frame.following = frame.following, None
            frame = following
        return frames

    def first(self, data: bytes) -> Frame | None:
        """Return the first of the frames that `data` completes, linked to the others; None if there is none."""
        size = len(data)
        if size > 0 and len(self._pending) == 0 and frame_length(data, 0) == size:  # as nearly every datagram is
            frame = self._accept(data, counted=False)
            if frame is not None:
                self.counts.frames += 1
                self._refused_to = 0
                return frame
        frames = self._search(self._pending + data)
        for one, other in pairwise(frames):
            one.following = other
        return frames[0] if frames else None

    def _search(self, data: bytes) -> list[Frame]:
        """Return the frames in the unparsed bytes; keep the bytes that may still become one."""
        frames: list[Frame] = []
        offset, end, sound, refused = 0, len(data), 0, 0
        kept = end  # the earliest start of a candidate that isn't complete
        # Of a dozen candidates each by itself is cheaper.
        candidates, checksums = Candidates(data, self._refused_to), None if self._max_refused else Checksums(data)
        while (offset := candidates.next(offset)) < end:
            following = offset + frame_length(data, offset)
            counted = offset >= candidates.refused_to and kept == end
            if following <= end:
                frame = self._accept(data[offset:following], counted=counted, checksums=checksums, offset=offset)
                if frame is not None:
                    frames.append(frame)
                    sound += following - offset
                    offset, kept = following, end
                    continue
                candidates.refuse(following)
                refused += 1
                if refused == self._max_refused:
                    candidates.refused_to, kept = 0, end
                    break
            elif candidates.is_likely(offset):
                kept = min(kept, offset)
            else:
                self._refuse(data[offset : offset + HEADER_V2], counted=counted)
                candidates.refuse(following)
            offset += 1
        self._pending = data[kept:]
        self._refused_to = max(0, candidates.refused_to - kept)
        self.counts.frames += len(frames)
        self.counts.garbage_bytes += kept - sound
        return frames

    def _refuse(self, header: bytes, *, counted: bool) -> None:
        """Count a candidate that its header excludes, before it is complete."""
        known = message_id_of(header) in _EXTRAS
        self.counts.bad_checksums += counted and known
        self.counts.unknown_messages += counted and not known

    def _accept(
        self, raw: bytes, *, counted: bool, checksums: Checksums | None = None, offset: int = 0
    ) -> Frame | None:
        """Return the frame of a candidate's bytes, None if it's rejected.

        Args:
            raw: from the marker to the last byte.
            counted: whether a rejection counts: not for a candidate that begins inside another one.
            checksums: those of all candidates where they may overlap, else None.
            offset: where it begins in the bytes of `checksums`.
        """
        at: i64 = 2  # index of its sequence number, which its sender's ids follow
        begin: i64 = HEADER_V1
        flags: i64 = 0
        message_id = message_id_of(raw)
        version: Literal[1, 2] = 1
        if raw[0] == MARKER_V2:
            at, begin, flags, version = 4, HEADER_V2, raw[2], 2
        kind = kind_of(message_id)
        extra: i64
        if kind is not None:
            extra = kind.crc_extra
        elif message_id in _EXTRAS:
            extra = _EXTRAS[message_id]
        else:
            self.counts.unknown_messages += counted
            return None
        length: i64 = raw[1]
        if version == 1 and not 0 <= length - _LENGTHS[message_id] < EXTENDED:  # truncated, as MAVLink 1 never is
            self.counts.bad_checksums += counted
            return None
        end = begin + length
        found: i64 = raw[end + 1]
        found = found << BYTE | raw[end]
        covered = checksum(raw, end, extra) if checksums is None else checksums.of(raw, end, extra, offset)
        if covered != found:
            self.counts.bad_checksums += counted
        elif flags & ~SIGNED_FLAG:
            self.counts.incompatible += counted
        else:
            self.counts.signed += flags
            message = None if kind is None else kind.example.read(raw, begin, end)
            return Frame(raw[at + 1], raw[at + 2], raw[at], message_id, version, message, raw)
        return None


class Candidates:
    """Where frames may begin in some bytes: at every marker, but inside a refused candidate only by the header."""

    def __init__(self, data: bytes, refused_to: int) -> None:
        """Take the bytes; those before `refused_to` are inside an earlier candidate."""
        self.refused_to = refused_to
        self._data, self._end = data, len(data)
        self._likely: list[int] | None = None
        self._outer_of = self._outer = -1
        """The first marker outside of refused candidates, and the end of these for which it was found."""

    def next(self, offset: int) -> int:
        """Return the first candidate's position from `offset` on, the length of the bytes if there is none."""
        if offset >= self.refused_to:
            return self._marker(offset)
        if self._outer_of != self.refused_to:
            self._outer_of, self._outer = self.refused_to, self._marker(self.refused_to)
        likely = self._likely_ones()
        at = bisect_left(likely, offset)
        return min(self._outer, likely[at]) if at < len(likely) else self._outer

    def refuse(self, following: int) -> None:
        """Record that a candidate which ends before `following` is no frame."""
        self.refused_to = max(self.refused_to, following)

    def is_likely(self, offset: int) -> bool:
        """Return whether a candidate's header, as far as it is there, is a known message's."""
        likely = self._likely_ones()
        at = bisect_left(likely, offset)
        return at < len(likely) and likely[at] == offset

    def _marker(self, offset: int) -> int:
        marker = _find_marker(self._data, offset)
        return self._end if marker is None else marker.start()

    def _likely_ones(self) -> list[int]:
        if self._likely is None:
            self._likely = frame_starts(self._data)
        return self._likely

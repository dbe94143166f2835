"""MAVLink 1 and 2 frames: typed messages to bytes, and a stream of bytes from one remote to messages.

Source: MAVLink guide, "Packet Serialization" and "MAVLink 2".
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import OrderedDict
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Literal

from librt.strings import BytesWriter, read_i32_le
from mypy_extensions import i64, mypyc_attr, u8

from airlink.checksum import BYTE, Checksums, checksum
from airlink.clock import Instant
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame_starts import EXTENDED, frame_starts
from airlink.mavlink import base_lengths, crc_extras
from airlink.messages import Message, kind_of
from airlink.messages.payload import MARKER_V2

MARKER_V1: Final = 0xFE
HEADER_V1: Final = 6
HEADER_V2: Final = 10
CHECKSUM: Final = 2
SIGNATURE: Final = 13
SIGNED_FLAG: Final = 0x01

_find_marker: Final = re.compile(rb"[\xfd\xfe]").search
_EXTRAS: Final = crc_extras()
_LENGTHS: Final = base_lengths()


@mypyc_attr(acyclic=True, free_list_len=1)
class Frame:
    """A frame with a valid checksum."""

    __slots__ = ("component", "following", "message", "message_id", "raw", "sequence", "system", "version")

    def __init__(
        self,
        system: int,
        component: int,
        sequence: int,
        message_id: int,
        version: Literal[1, 2],
        message: Message | None,
        raw: bytes,
    ) -> None:
        """Take its header, its message (None if that isn't one of `airlink.messages`) and all its bytes."""
        self.system = system
        self.component = component
        self.sequence = sequence
        self.message_id = message_id
        self.version: Literal[1, 2] = version
        self.message = message
        self.raw = raw
        self.following: Frame | None = None
        """The next frame that was completed with it."""


class FrameWriter:
    """Turns one component's messages into frames and numbers them."""

    def __init__(self, system: int, component: int) -> None:
        """Send as `component` of `system`."""
        self._system: u8 = system
        self._component: u8 = component
        self._sequence: u8 = 0
        self._frame = BytesWriter()

    def encode(self, message: Message, version: Literal[1, 2] = 2) -> bytes:
        """Return the frame of `message`, with the next sequence number."""
        kind, frame, sequence = message.kind(), self._frame, self._sequence
        self._sequence = (sequence + 1) & 0xFF
        frame.truncate(0)
        begin: i64 = HEADER_V2
        if version == 2:
            frame.write(kind.header)
            frame[4] = sequence
            frame[5] = self._system
            frame[6] = self._component
        else:
            begin = HEADER_V1
            frame.write(bytes((MARKER_V1, 0, sequence, self._system, self._component, kind.message_id)))
        message.write(frame)
        end: i64 = len(frame)
        if version == 2:
            while end > begin + 1 and frame[end - 1] == 0:
                end -= 1
        else:
            end = begin + kind.base_length
        frame.truncate(end)
        frame[1] = u8(end - begin)
        check = checksum(frame.getvalue(), end, kind.crc_extra)
        frame.append(u8(check & 0xFF))
        frame.append(u8(check >> BYTE))
        return frame.getvalue()


def reframed(frame: Frame, message: Message) -> bytes:
    """Return another message in place of a frame's, from the same component with the same number, unsigned."""
    writer = FrameWriter(frame.system, frame.component)
    writer._sequence = u8(frame.sequence)
    return writer.encode(message, frame.version)


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


MAX_REFUSED: Final = 12
"""Candidates in a datagram from a network that may be no frames; after as many its rest is skipped."""


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


def frame_length(data: bytes, offset: i64) -> i64:
    """Return the length of the frame that starts at `offset`, 0 if none can."""
    marker, size = data[offset], len(data)
    length: i64 = 0
    if offset + 1 < size:
        length = data[offset + 1]
    if marker == MARKER_V2:
        signed = offset + 2 < size and data[offset + 2] & SIGNED_FLAG
        return HEADER_V2 + length + CHECKSUM + (SIGNATURE if signed else 0)
    if marker == MARKER_V1:
        return HEADER_V1 + length + CHECKSUM
    return 0


def message_id_of(header: bytes) -> int:
    """Return the message id in a whole header."""
    return read_i32_le(header, 6) >> 8 & 0xFFFFFF if header[0] == MARKER_V2 else header[5]


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


def first_system(data: bytes) -> int | None:
    """Return the system id, unverified, of the frame that a datagram starts with; None if it starts with none."""
    if len(data) >= HEADER_V2 and data[0] == MARKER_V2:
        return data[5]
    if len(data) >= HEADER_V1 and data[0] == MARKER_V1:
        return data[3]
    return None


MAX_REMOTES: Final = 1024
"""Largest number of addresses with parsers. The longest silent one is dropped first, so strangers can't fill memory."""
MANY_REMOTES: Final = MAX_REMOTES // 2
"""With more addresses, the order in which they were last received is kept."""


class Receiver:
    """Parses the datagrams of every remote, and counts dropped frames."""

    def __init__(self) -> None:
        """Start with no remote known."""
        self._parsers: OrderedDict[Address, dict[int, StreamParser]] = OrderedDict()
        """By address and by the socket that it sends to."""
        self._forgotten = ParserCounts()
        self._last_socket, self._last_peer = -1, Address("", 0)
        self._last = StreamParser()
        """Parser of the remote received last: several datagrams in a row come from it."""

    def first(self, datagram: Datagram, now: Instant) -> Frame | None:  # noqa: ARG002 - links with a key go by it
        """Return the first of the frames that a datagram completes, linked to the others; None if there is none."""
        if datagram.peer is not self._last_peer or datagram.socket != self._last_socket:
            self._last = self._parser(datagram.socket, datagram.peer)
            self._last_socket, self._last_peer = datagram.socket, datagram.peer
        return self._last.first(datagram.data)

    def _parser(self, socket: int, peer: Address) -> StreamParser:
        of_peer = self._parsers.get(peer)
        if of_peer is None:
            of_peer = self._parsers[peer] = {}
            if len(self._parsers) > MAX_REMOTES:
                for forgotten in self._parsers.popitem(last=False)[1].values():
                    self._forgotten += forgotten.counts
        elif len(self._parsers) > MANY_REMOTES:
            self._parsers.move_to_end(peer)
        parser = of_peer.get(socket)
        if parser is None:
            parser = of_peer[socket] = StreamParser(MAX_REFUSED)
        return parser

    def counts(self, socket: int, peer: Address | None) -> ParserCounts:
        """Return a remote's statistics, zeros if it was never received from."""
        of_peer = None if peer is None else self._parsers.get(peer)
        parser = None if of_peer is None else of_peer.get(socket)
        return ParserCounts() if parser is None else parser.counts

    def total(self) -> ParserCounts:
        """Return the statistics of all remotes together."""
        parsers = (parser for of_peer in self._parsers.values() for parser in of_peer.values())
        return sum((parser.counts for parser in parsers), self._forgotten)

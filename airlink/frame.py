"""MAVLink 1 and 2 frames: typed messages to bytes, and a stream of bytes from one remote to messages.

Source: MAVLink guide, "Packet Serialization" and "MAVLink 2".
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Literal

from fastcrc import crc16
from librt.strings import BytesWriter

from airlink.mavlink import crc_extras
from airlink.messages import KINDS, Message

MARKER_V1: Final = 0xFE
MARKER_V2: Final = 0xFD
HEADER_V1: Final = 6
HEADER_V2: Final = 10
CHECKSUM: Final = 2
SIGNATURE: Final = 13
SIGNED_FLAG: Final = 0x01

_find_marker: Final = re.compile(rb"[\xfd\xfe]").search
_BEGIN_V1: Final = bytes([MARKER_V1, 0])
_BEGIN_V2: Final = bytes([MARKER_V2, 0, 0, 0])
"""Of a header: the payload's length, not known yet, and no flags."""
_EXTRA_BYTE: Final = {message_id: bytes([extra]) for message_id, extra in crc_extras().items()}
_checksum: Final = crc16.mcrf4xx


class Frame:
    """A frame whose checksum held."""

    __slots__ = ("component", "message", "message_id", "raw", "sequence", "system", "version")

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
        """Take its header, its message (None when that isn't one of `airlink.messages`) and all its bytes."""
        self.system = system
        self.component = component
        self.sequence = sequence
        self.message_id = message_id
        self.version: Literal[1, 2] = version
        self.message = message
        self.raw = raw


class FrameWriter:
    """Turns one component's messages into frames and numbers them."""

    def __init__(self, system: int, component: int) -> None:
        """Speak as `component` of `system`."""
        self._sender = bytes([system, component])
        self._sequence = 0

    def encode(self, message: Message, version: Literal[1, 2] = 2) -> bytes:
        """Return the frame of `message`, with the next sequence number."""
        kind = message.kind()
        sequence = self._sequence
        self._sequence = (sequence + 1) & 0xFF
        frame = BytesWriter()
        frame.write(_BEGIN_V2 if version == 2 else _BEGIN_V1)
        frame.append(sequence)
        frame.write(self._sender)
        frame.write(kind.id_bytes if version == 2 else kind.id_bytes[:1])
        begin = len(frame)
        message.write(frame)
        end = len(frame) if version == 2 else begin + kind.base_length
        while version == 2 and end > begin + 1 and frame[end - 1] == 0:
            end -= 1
        frame.truncate(end)
        frame[1] = end - begin
        frame.append(kind.crc_extra)
        checksum: int = _checksum(frame.getvalue()[1:])
        frame[end] = checksum & 0xFF
        frame.append(checksum >> 8)
        return frame.getvalue()


@dataclass
class ParserCounts:
    """What a parser has seen."""

    frames: int = 0
    garbage_bytes: int = 0
    """Bytes of no sound frame, those of refused frames included."""
    bad_checksums: int = 0
    unknown_messages: int = 0
    incompatible: int = 0

    @property
    def bad(self) -> int:
        """Frames that were dropped, whatever the cause."""
        return self.bad_checksums + self.unknown_messages + self.incompatible

    def __add__(self, other: ParserCounts) -> ParserCounts:
        """Return what both have seen."""
        return ParserCounts(
            self.frames + other.frames,
            self.garbage_bytes + other.garbage_bytes,
            self.bad_checksums + other.bad_checksums,
            self.unknown_messages + other.unknown_messages,
            self.incompatible + other.incompatible,
        )


class StreamParser:
    """Finds frames in what one remote sends, wherever datagrams begin; garbage is skipped and counted.

    A sound frame is taken as soon as it's complete, even where the bytes before it look like the start of
    a longer one. So the frames found don't depend on how the bytes were cut.
    """

    def __init__(self) -> None:
        """Start with nothing heard."""
        self.counts = ParserCounts()
        self._pending = b""

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames that `data` completes. Never raises, whatever the bytes."""
        if data and not self._pending and frame_length(data, 0) == len(data):  # as nearly every datagram is
            frame = self._accept(data, counted=False)
            if frame is not None:
                self.counts.frames += 1
                return [frame]
        data = self._pending + data
        frames: list[Frame] = []
        offset, end = 0, len(data)
        kept = end  # the earliest start of what may yet become a frame
        refused_to = sound = 0
        while (marker := _find_marker(data, offset)) is not None:
            offset = marker.start()
            following = offset + frame_length(data, offset)
            if following > end:
                kept = min(kept, offset)
            else:
                frame = self._accept(data[offset:following], counted=offset >= refused_to and kept == end)
                if frame is not None:
                    frames.append(frame)
                    sound += following - offset
                    offset, kept = following, end
                    continue
                refused_to = max(refused_to, following)
            offset += 1
        self._pending = data[kept:]
        self.counts.frames += len(frames)
        self.counts.garbage_bytes += kept - sound
        return frames

    def _accept(self, raw: bytes, *, counted: bool) -> Frame | None:
        """Return the frame, None when it's refused; `counted` unless that lies inside another candidate."""
        if raw[0] == MARKER_V2:
            length, flags, sequence, system, component = raw[1], raw[2], raw[4], raw[5], raw[6]
            header, message_id = HEADER_V2, raw[7] | raw[8] << 8 | raw[9] << 16
        else:
            length, flags, sequence, system, component = raw[1], 0, raw[2], raw[3], raw[4]
            header, message_id = HEADER_V1, raw[5]
        kind = KINDS.get(message_id)
        extra = _EXTRA_BYTE.get(message_id) if kind is None else kind.extra
        end = header + length
        if extra is None:
            self.counts.unknown_messages += counted
            return None
        checksum: int = _checksum(raw[1:end] + extra)
        if checksum != raw[end] | raw[end + 1] << 8:
            self.counts.bad_checksums += counted
        elif flags & ~SIGNED_FLAG:
            self.counts.incompatible += counted
        else:
            message = None if kind is None else kind.read(raw[header:end])
            return Frame(system, component, sequence, message_id, 2 if header == HEADER_V2 else 1, message, raw)
        return None


def frame_length(data: bytes, offset: int) -> int:
    """Return the length of the frame that starts at `offset`, 0 when none can."""
    marker = data[offset]
    if marker == MARKER_V2:
        if offset + 2 >= len(data):
            return HEADER_V2 + CHECKSUM
        signature = SIGNATURE if data[offset + 2] & SIGNED_FLAG else 0
        return HEADER_V2 + data[offset + 1] + CHECKSUM + signature
    if marker == MARKER_V1:
        if offset + 1 >= len(data):
            return HEADER_V1 + CHECKSUM
        return HEADER_V1 + data[offset + 1] + CHECKSUM
    return 0


def first_system(data: bytes) -> int | None:
    """Return the system id of the frame that a datagram starts with, unverified; None when none starts it."""
    if len(data) >= HEADER_V2 and data[0] == MARKER_V2:
        return data[5]
    if len(data) >= HEADER_V1 and data[0] == MARKER_V1:
        return data[3]
    return None

"""MAVLink 1 and 2 frames: typed messages to bytes, and what a header says.

Source: MAVLink guide, "Packet Serialization" and "MAVLink 2".
"""

from __future__ import annotations

from typing import Final, Literal

from librt.strings import BytesWriter, read_i32_le
from mypy_extensions import i64, mypyc_attr, u8

from airlink.checksum import BYTE, checksum
from airlink.messages import Message
from airlink.messages.payload import MARKER_V2

MARKER_V1: Final = 0xFE
HEADER_V1: Final = 6
HEADER_V2: Final = 10
CHECKSUM: Final = 2
SIGNATURE: Final = 13
SIGNED_FLAG: Final = 0x01


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


def first_system(data: bytes) -> int | None:
    """Return the system id, unverified, of the frame that a datagram starts with; None if it starts with none."""
    if len(data) >= HEADER_V2 and data[0] == MARKER_V2:
        return data[5]
    if len(data) >= HEADER_V1 and data[0] == MARKER_V1:
        return data[3]
    return None

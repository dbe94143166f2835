"""The base of all messages, and conversion of numbers to and from payload bytes. Only messages convert units.

A value outside its field's range is sent as the nearest that fits; NaN in an integer field is sent as unknown.
Source: MAVLink guide, "Serialization".
"""

from __future__ import annotations

import math
from typing import Any, Final, Self

from librt.strings import (
    BytesWriter,
    read_f32_le,
    read_i16_le,
    read_i32_le,
    read_i64_le,
    write_f32_le,
    write_i16_le,
    write_i32_le,
    write_i64_le,
)
from mypy_extensions import i64, mypyc_attr

from airlink.clock import EVEN, rounded

DEG: Final = math.pi / 180
CDEG: Final = math.pi / 180e2
DEGE7: Final = math.pi / 180e7
MILLI: Final = 1e-3
CENTI: Final = 1e-2
"""One unit of a field in SI units."""
PER_DEG: Final = 1 / DEG
PER_CDEG: Final = 1 / CDEG
PER_DEGE7: Final = 1 / DEGE7
PER_MILLI: Final = 1 / MILLI
PER_CENTI: Final = 1 / CENTI
I8_MIN: Final = -128.0
I8_MAX: Final = 127.0
I16_MIN: Final = -32768.0
I16_MAX: Final = 32767.0
U16_MAX: Final = 65535.0
I32_MIN: Final = -2147483648.0
I32_MAX: Final = 2147483647.0
U32_MAX: Final = 4294967295.0
UNKNOWN_U16: Final = 0xFFFF
"""The value that means "unknown" in a 16-bit field with a unit."""
TAGGED_MAX: Final = 2**62 - 1
"""Largest integer that compiled code doesn't store as an object."""
MARKER_V2: Final = 0xFD
"""First byte of a frame of MAVLink 2."""
_ZEROS: Final = bytes(255)
FLOAT32_MAX: Final = 3.4028234663852886e38


class Kind:
    """Properties of one kind of message."""

    def __init__(
        self,
        name: str,
        message_id: int,
        crc_extra: int,
        lengths: tuple[int, int],
        fields: tuple[str, ...],
        example: Message,
    ) -> None:
        """Take MAVLink's name, the lengths of a payload without and with extension fields, and our fields' names.

        `example` is any message of the kind; its `read` parses others.
        """
        self.name = name
        self.message_id = message_id
        self.crc_extra = crc_extra
        """CRC_EXTRA, which the checksum covers besides the frame."""
        self.base_length, self.length = lengths
        self.fields = fields
        self.example = example
        self.index = 0
        """Index in `KINDS`."""
        self.header = bytes((MARKER_V2, 0, 0, 0, 0, 0, 0, *message_id.to_bytes(3, "little")))
        """Header of its frames, with zeros for the payload's length, the sequence number and the sender."""


@mypyc_attr(acyclic=True)
class Message:
    """A MAVLink message in SI units; immutable."""

    def kind(self) -> Kind:
        """Return its kind."""
        raise NotImplementedError

    def write(self, payload: BytesWriter) -> None:
        """Append the whole payload, extension fields included, not truncated."""
        raise NotImplementedError

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        """Parse another message of its kind, from a frame whose payload goes from `begin` to before `end`.

        Missing bytes count as zeros; surplus ones (newer extensions) are ignored.
        """
        raise NotImplementedError

    def boot_s(self) -> float:
        """Return the sender's time since boot, NaN if the message has none."""
        return math.nan

    def addressee(self) -> int:
        """Return the target system, 0 for all."""
        return 0

    def values(self) -> dict[str, Any]:
        """Return the fields by name."""
        return {name: getattr(self, name) for name in self.kind().fields}

    def but(self, **changes: Any) -> Self:
        """Return the same message with some fields changed."""
        return type(self)(**self.values() | changes)

    def __eq__(self, other: object) -> bool:
        """Return whether both are of one kind and have the same values; NaN equals NaN."""
        if not isinstance(other, Message) or type(self) is not type(other):
            return False
        return all(_same(getattr(self, name), getattr(other, name)) for name in self.kind().fields)

    def __hash__(self) -> int:
        """Return a hash of all values."""
        return hash((self.kind().name, *self.values().values()))

    def __repr__(self) -> str:
        """Return all values with their names."""
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self.values().items())})"


def _same(one: object, other: object) -> bool:
    return one == other or (one != one and other != other)  # noqa: PLR0124 - NaN


def _cut(frame: bytes, at: i64, end: i64) -> int:
    """Return the little-endian number at a position where MAVLink 2 has truncated trailing zero bytes."""
    value: i64 = 0
    while end > at:
        end -= 1
        value = value << 8 | frame[end]
    return value


def get_u8(frame: bytes, at: i64, end: i64) -> int:
    """Return the unsigned number of 8 bits at a position of a payload that ends before `end`."""
    return frame[at] if at < end else 0


def get_i8(frame: bytes, at: i64, end: i64) -> int:
    """Return the signed number of 8 bits."""
    value = get_u8(frame, at, end)
    return value - 0x100 if value >= 0x80 else value


def get_u16(frame: bytes, at: i64, end: i64) -> int:
    """Return the unsigned number of 16 bits."""
    return get_i16(frame, at, end) & 0xFFFF


def get_i16(frame: bytes, at: i64, end: i64) -> int:
    """Return the signed number of 16 bits."""
    if at + 2 > end:
        return _cut(frame, at, end)
    return read_i16_le(frame, at)


def get_u32(frame: bytes, at: i64, end: i64) -> int:
    """Return the unsigned number of 32 bits."""
    return get_i32(frame, at, end) & 0xFFFF_FFFF


def get_i32(frame: bytes, at: i64, end: i64) -> int:
    """Return the signed number of 32 bits."""
    if at + 4 > end:
        return _cut(frame, at, end)
    return read_i32_le(frame, at)


def get_u64(frame: bytes, at: i64, end: i64) -> int:
    """Return the unsigned number of 64 bits."""
    value = get_i64(frame, at, end)
    return value + 0x1_0000_0000_0000_0000 if value < 0 else value


def get_i64(frame: bytes, at: i64, end: i64) -> int:
    """Return the signed number of 64 bits."""
    if at + 8 > end:
        return _cut(frame, at, end)
    return read_i64_le(frame, at)


def get_f32(frame: bytes, at: i64, end: i64) -> float:
    """Return the float of 32 bits."""
    if at + 4 <= end:
        return read_f32_le(frame, at)
    return read_f32_le(frame[at:end] + _ZEROS, 0) if at < end else 0.0


def known(value: int) -> float:
    """Return a 16-bit field with a unit, NaN for unknown."""
    return math.nan if value == UNKNOWN_U16 else float(value)


def get_text(frame: bytes, at: i64, end: i64, length: i64) -> str:
    """Return the text at an index, up to its first zero; empty if all its bytes were zeros and truncated."""
    if at >= end:  # compiled, a slice that ends before it begins is an error
        return ""
    return frame[at : min(at + length, end)].split(b"\0", 1)[0].decode("utf-8", "replace")


def get_octets(frame: bytes, at: i64, end: i64, length: i64) -> tuple[int, ...]:
    """Return the bytes from an index on."""
    return tuple([get_u8(frame, at + index, end) for index in range(length)])


def get_f32s(frame: bytes, at: i64, end: i64, length: i64) -> tuple[float, ...]:
    """Return the floats of 32 bits from an index on."""
    return tuple([get_f32(frame, at + 4 * index, end) for index in range(length)])


def get_knowns(frame: bytes, at: i64, end: i64, length: i64, unit: float) -> tuple[float, ...]:
    """Return the 16-bit fields with a unit from an index on, NaN for unknown."""
    return tuple([known(get_u16(frame, at + 2 * index, end)) * unit for index in range(length)])


def nearest(value: float, low: float, high: float, unknown: int = 0) -> int:
    """Return the nearest whole number in a range, ties to even; `unknown` for NaN."""
    if low <= value <= high:
        return rounded(value)
    return unknown if math.isnan(value) else int(low if value < low else high)


def put_u8(payload: BytesWriter, value: int) -> None:
    """Append an unsigned number of 8 bits."""
    payload.append(value if 0 <= value <= 0xFF else (0 if value < 0 else 0xFF))


def put_i8(payload: BytesWriter, value: int) -> None:
    """Append a signed number of 8 bits."""
    payload.append((value if -0x80 <= value <= 0x7F else (-0x80 if value < 0 else 0x7F)) & 0xFF)


def put_u16(payload: BytesWriter, value: int) -> None:
    """Append an unsigned number of 16 bits."""
    if value < 0x8000:
        write_i16_le(payload, value if value >= 0 else 0)
    else:
        write_i16_le(payload, value - 0x1_0000 if value <= 0xFFFF else -1)


def put_i16(payload: BytesWriter, value: int) -> None:
    """Append a signed number of 16 bits."""
    write_i16_le(payload, value if -0x8000 <= value <= 0x7FFF else (-0x8000 if value < 0 else 0x7FFF))


def put_u32(payload: BytesWriter, value: int) -> None:
    """Append an unsigned number of 32 bits."""
    if value < 0x8000_0000:
        write_i32_le(payload, value if value >= 0 else 0)
    else:
        write_i32_le(payload, value - 0x1_0000_0000 if value <= 0xFFFF_FFFF else -1)


def put_i32(payload: BytesWriter, value: int) -> None:
    """Append a signed number of 32 bits."""
    inside = -0x8000_0000 <= value <= 0x7FFF_FFFF
    write_i32_le(payload, value if inside else (-0x8000_0000 if value < 0 else 0x7FFF_FFFF))


def put_u64(payload: BytesWriter, value: int) -> None:
    """Append an unsigned number of 64 bits."""
    if value <= TAGGED_MAX:
        write_i64_le(payload, value if value >= 0 else 0)
    elif value < 0x8000_0000_0000_0000:
        write_i64_le(payload, value)
    else:
        write_i64_le(payload, value - 0x1_0000_0000_0000_0000 if value <= 0xFFFF_FFFF_FFFF_FFFF else -1)


def put_i64(payload: BytesWriter, value: int) -> None:
    """Append a signed number of 64 bits."""
    if -TAGGED_MAX <= value <= TAGGED_MAX:
        write_i64_le(payload, value)
    else:
        inside = -0x8000_0000_0000_0000 <= value <= 0x7FFF_FFFF_FFFF_FFFF
        write_i64_le(payload, value if inside else (-0x8000_0000_0000_0000 if value < 0 else 0x7FFF_FFFF_FFFF_FFFF))


def put_near_i8(payload: BytesWriter, value: float) -> None:
    """Append the nearest whole number of 8 bits."""
    put_i8(payload, nearest(value, I8_MIN, I8_MAX))


def put_near_i16(payload: BytesWriter, value: float) -> None:
    """Append the nearest whole number of 16 bits."""
    whole = int(value + EVEN - EVEN) if I16_MIN <= value <= I16_MAX else nearest(value, I16_MIN, I16_MAX)
    write_i16_le(payload, whole)


def put_near_u16(payload: BytesWriter, value: float) -> None:
    """Append the nearest unsigned whole number of 16 bits, NaN as unknown."""
    whole = int(value + EVEN - EVEN) if 0.0 <= value <= U16_MAX else nearest(value, 0.0, U16_MAX, UNKNOWN_U16)
    write_i16_le(payload, whole if whole < 0x8000 else whole - 0x1_0000)


def put_near_i32(payload: BytesWriter, value: float) -> None:
    """Append the nearest whole number of 32 bits."""
    whole = int(value + EVEN - EVEN) if I32_MIN <= value <= I32_MAX else nearest(value, I32_MIN, I32_MAX)
    write_i32_le(payload, whole)


def put_near_u32(payload: BytesWriter, value: float) -> None:
    """Append the nearest unsigned whole number of 32 bits."""
    whole = int(value + EVEN - EVEN) if 0.0 <= value <= U32_MAX else nearest(value, 0.0, U32_MAX)
    write_i32_le(payload, whole if whole < 0x8000_0000 else whole - 0x1_0000_0000)


def put_f32(payload: BytesWriter, value: float) -> None:
    """Append a float of 32 bits."""
    if (value > FLOAT32_MAX or value < -FLOAT32_MAX) and not math.isinf(value):
        value = math.copysign(FLOAT32_MAX, value)
    write_f32_le(payload, value)


def put_text(payload: BytesWriter, value: str, length: int) -> None:
    """Append a text, cut off or filled up with zeros."""
    cut = value.encode("utf-8", "replace")[:length]
    payload.write(cut)
    put_zeros(payload, length - len(cut))


def put_octets(payload: BytesWriter, values: tuple[int, ...], length: int) -> None:
    """Append bytes, cut off or filled up with zeros."""
    cut = values[:length]
    for value in cut:
        put_u8(payload, value)
    put_zeros(payload, length - len(cut))


def put_f32s(payload: BytesWriter, values: tuple[float, ...], length: int) -> None:
    """Append floats of 32 bits, cut off or filled up with zeros."""
    cut = values[:length]
    for value in cut:
        put_f32(payload, value)
    put_zeros(payload, 4 * (length - len(cut)))


def put_knowns(payload: BytesWriter, values: tuple[float, ...], length: int, per_unit: float) -> None:
    """Append 16-bit fields with a unit, cut off or filled up with zeros."""
    cut = values[:length]
    for value in cut:
        if math.isnan(value):
            write_i16_le(payload, -1)
        else:
            put_near_u16(payload, value * per_unit)
    put_zeros(payload, 2 * (length - len(cut)))


def put_zeros(payload: BytesWriter, count: int) -> None:
    """Append zeros, for fields that aren't used here."""
    payload.write(_ZEROS[:count])

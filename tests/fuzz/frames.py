"""Frames at byte level: any payload of any message, with a valid or an invalid frame."""

from __future__ import annotations

import itertools
import math
import struct
from typing import Any, NamedTuple

from fastcrc import crc16

from airlink.mavlink import crc_extras
from airlink.messages import KINDS
from tests.airlink.layouts import Layout, layout

EXTRAS = crc_extras()
LAYOUTS: tuple[Layout, ...] = tuple(layout(kind.name) for kind in KINDS.values())
"""Every message that either end has a class for; new ones are included automatically."""
SIGNED = 0x01
LINK_STAMP_AND_SIGNATURE = bytes(13)

_INTEGER_BITS = {"8": 8, "1": 16, "3": 32, "6": 64}
_FLOATS = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1.0, -1.0, 360.0, 1e-45, 1e30, -1e30, 3.4028234663852886e38)


class Header(NamedTuple):
    """Sender and format of a frame."""

    system: int
    component: int = 1
    sequence: int = 0
    version: int = 2
    signed: bool = False


def framed(message_id: int, payload: bytes, header: Header) -> bytes:
    """Return the frame of any payload, with a valid checksum; the payload isn't truncated."""
    if header.version == 2:
        flags = SIGNED if header.signed else 0
        body = struct.pack("<BBBBBB", len(payload), flags, 0, header.sequence, header.system, header.component)
        body += message_id.to_bytes(3, "little") + payload
    else:
        body = struct.pack("<BBBBB", len(payload), header.sequence, header.system, header.component, message_id & 0xFF)
        body += payload
    checksum = crc16.mcrf4xx(body + bytes([EXTRAS.get(message_id, 0)]))
    signature = LINK_STAMP_AND_SIGNATURE if header.signed and header.version == 2 else b""
    return (b"\xfd" if header.version == 2 else b"\xfe") + body + struct.pack("<H", checksum) + signature


def extremes(kind: str) -> tuple[Any, ...]:
    """Return a field's extreme values by its wire type: ends of its range and around 0; NaN and infinities."""
    if kind in {"float", "double"}:
        return _FLOATS
    if kind == "char":
        return (b"\0", b"\xff", b"\x1b[2J\x07", b"A")
    bits = next(bits for digit, bits in _INTEGER_BITS.items() if digit in kind)
    if kind.startswith("uint"):
        return (0, 1, 2 ** (bits - 1), 2**bits - 2, 2**bits - 1)
    return (-(2 ** (bits - 1)), 1 - 2 ** (bits - 1), -1, 0, 1, 2 ** (bits - 1) - 1)


def packed(layout: Layout, values: dict[str, Any]) -> bytes:
    """Return a payload of raw values by the XML's names; an array's value is used for all its elements."""
    order = sorted(range(len(layout.fields)), key=layout.wire_order.__getitem__)
    row: list[Any] = []
    for place in order:
        kind, length = layout.types[place], layout.array_lengths[place]
        value = values.get(layout.fields[place], b"" if kind == "char" else 0)
        row.extend([value] * length if length and kind != "char" else [value])
    return layout.packer.pack(*row)


def extreme_payloads(layout: Layout, usual: dict[str, Any]) -> list[bytes]:
    """Return payloads in which one field at a time takes its extremes, and some in which all do."""
    kinds = dict(zip(layout.fields, layout.types, strict=True))
    single = [packed(layout, usual | {field: value}) for field, kind in kinds.items() for value in extremes(kind)]
    together = itertools.islice(zip(*(itertools.cycle(extremes(kind)) for kind in kinds.values()), strict=False), 12)
    return single + [packed(layout, dict(zip(kinds, values, strict=True))) for values in together]

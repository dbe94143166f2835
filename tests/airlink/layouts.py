"""Layouts of messages' payloads, from which classes are generated and payloads of any bytes are made.

They are read from a table which `tests/airlink/test_mavlink.py` writes from pymavlink's generated module.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path

from airlink import mavlink

LAYOUTS = Path(__file__).with_name("layouts.json")
"""Each message's id, CRC_EXTRA, packing (as `struct` has it), length without extension fields, and its fields in the
XML's order: name, type, array length (0: no array), index as packed, unit.
"""
_MESSAGES: dict[str, tuple[int, int, str, int, list[tuple[str, str, int, int, str]]]] = json.loads(LAYOUTS.read_bytes())


@dataclass(frozen=True)
class Layout:
    """How the fields of one message are laid out in its payload (MAVLink guide, "Packet Serialization").

    `fields`, `types`, `units` and `array_lengths` are in the XML's order; `wire_order` gives the position of each field
    among the fields as packed.
    """

    name: str
    message_id: int
    crc_extra: int
    packer: struct.Struct
    base_length: int
    """Bytes of the payload without extension fields: all that MAVLink 1 carries."""
    fields: tuple[str, ...]
    types: tuple[str, ...]
    units: tuple[str, ...]
    array_lengths: tuple[int, ...]
    wire_order: tuple[int, ...]


LATER = {
    "CURRENT_MODE": Layout(
        "CURRENT_MODE",
        *mavlink.LATER["CURRENT_MODE"][:2],
        packer=struct.Struct("<IIB"),
        base_length=mavlink.LATER["CURRENT_MODE"][2],
        fields=("standard_mode", "custom_mode", "intended_custom_mode"),
        types=("uint8_t", "uint32_t", "uint32_t"),
        units=("", "", ""),
        array_lengths=(0, 0, 0),
        wire_order=(2, 0, 1),
    ),
    "TIMESYNC": Layout(
        "TIMESYNC",
        message_id=111,
        crc_extra=34,
        packer=struct.Struct("<qqBB"),
        base_length=16,
        fields=("tc1", "ts1", "target_system", "target_component"),
        types=("int64_t", "int64_t", "uint8_t", "uint8_t"),
        units=("ns", "ns", "", ""),
        array_lengths=(0, 0, 0, 0),
        wire_order=(0, 1, 2, 3),
    ),
}
"""Messages, or extension fields, of MAVLink's common set that the dialect doesn't have yet."""


def layout(name: str) -> Layout:
    """Return the layout of the message called `name`, as in GLOBAL_POSITION_INT."""
    if name in LATER:
        return LATER[name]
    message_id, crc_extra, packing, base_length, fields = _MESSAGES[name]
    names, types, array_lengths, wire_order, units = zip(*fields, strict=True)
    return Layout(
        name=name,
        message_id=message_id,
        crc_extra=crc_extra,
        packer=struct.Struct(packing),
        base_length=base_length,
        fields=names,
        types=types,
        units=units,
        array_lengths=array_lengths,
        wire_order=wire_order,
    )

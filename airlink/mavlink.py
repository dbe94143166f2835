"""The MAVLink dialect ardupilotmega: its constants, and its message layouts.

They are read from a table: pymavlink's generated module, which has them too, takes ten times as long to import.
`tests/airlink/test_mavlink.py` writes the table from it and compares them; only logs are read by pymavlink itself.
"""

from __future__ import annotations

import importlib
import json
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TABLE = Path(__file__).with_name("ardupilotmega.json")
"""The dialect: each enum's names and values; each message's id, CRC_EXTRA, packing (as `struct` has it), length without
extension fields, and its fields in the XML's order: name, type, array length (0: no array), place as packed, unit.
"""
_table: dict[str, dict[str, Any]] = json.loads(TABLE.read_bytes())
_ENUMS: dict[str, dict[str, int]] = _table["enums"]
_MESSAGES: dict[str, tuple[int, int, str, int, list[tuple[str, str, int, int, str]]]] = _table["messages"]
_CONSTANTS = {name: value for values in _ENUMS.values() for name, value in values.items()}


def __getattr__(name: str) -> int:
    """Return one of the dialect's constants: MAV_CMD_*, MAV_RESULT_*, MAVLINK_MSG_ID_*, …."""
    message = name.removeprefix("MAVLINK_MSG_ID_")
    value = _MESSAGES[message][0] if message != name and message in _MESSAGES else _CONSTANTS.get(name)
    if value is None:
        raise AttributeError(name)
    globals()[name] = value  # found without this function from now on
    return value


def name_of(enum: str, value: int) -> str:
    """Return the name of an enum's value without the enum's prefix: for MAV_RESULT and 2, "DENIED"."""
    return next((name.removeprefix(f"{enum}_") for name, its in _ENUMS[enum].items() if its == value), str(value))


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


MAVLINK_MSG_ID_CURRENT_MODE = 436
LATER = {
    "CURRENT_MODE": Layout(
        "CURRENT_MODE",
        MAVLINK_MSG_ID_CURRENT_MODE,
        crc_extra=193,
        packer=struct.Struct("<IIB"),
        base_length=9,
        fields=("standard_mode", "custom_mode", "intended_custom_mode"),
        types=("uint8_t", "uint32_t", "uint32_t"),
        units=("", "", ""),
        array_lengths=(0, 0, 0),
        wire_order=(2, 0, 1),
    )
}
"""Messages of MAVLink's common set that the dialect doesn't have yet."""


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


def crc_extras() -> dict[int, int]:
    """Return CRC_EXTRA of every message, by message id."""
    extras = {message_id: crc_extra for message_id, crc_extra, *_ in _MESSAGES.values()}
    return extras | {each.message_id: each.crc_extra for each in LATER.values()}


def dataflash_messages(path: str, kinds: Sequence[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the messages of some kinds in an ArduPilot dataflash log (.bin), each as its kind and its fields.

    Raises:
        OSError: the file can't be read.
        ValueError: it isn't such a log.
    """
    reader_type: Any = importlib.import_module("pymavlink.DFReader").DFReader_binary
    reader: Any = reader_type.__new__(reader_type)
    try:
        reader.__init__(path)
        while (message := reader.recv_match(type=list(kinds))) is not None:
            yield str(message.get_type()), dict(message.to_dict())
    except (IndexError, struct.error, TypeError) as error:
        raise ValueError("not a dataflash log") from error
    finally:
        for opened in ("data_map", "filehandle"):
            if hasattr(reader, opened):
                getattr(reader, opened).close()

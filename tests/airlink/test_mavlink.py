"""The dialect's table against pymavlink's generated module, from which it was written."""

from __future__ import annotations

import importlib
import json
from typing import Any

from fastcrc import crc16

from airlink.mavlink import TABLE
from tests.airlink.layouts import LAYOUTS

dialect: Any = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
WRITE = "python -m tests.airlink.test_mavlink"
LAST = "ENUM_END"


def test_what_the_table_says_the_dialect_says_too() -> None:
    """A newer pymavlink may have more: names, messages, and extension fields at a message's end."""
    ours, theirs = json.loads(TABLE.read_bytes()), json.loads(table())
    for enum, values in ours["enums"].items():
        assert values.items() <= theirs["enums"][enum].items(), f"{enum} is stale; write the table again by: {WRITE}"
    for name, said in ours["messages"].items():
        assert said == theirs["messages"][name], f"{name} is stale: {WRITE}"


def test_the_layouts_are_the_dialects():
    now = json.loads(layouts())
    for name, (*said, _, base, fields) in json.loads(LAYOUTS.read_bytes()).items():
        *says, _, base_now, fields_now = now[name]
        assert (said, base, fields) == (says, base_now, fields_now[: len(fields)]), f"{name} is stale: {WRITE}"


def table() -> str:
    """Return constants by enum, and messages by name, as `TABLE` says."""
    enums = {
        enum: {str(entry.name): value for value, entry in entries.items() if not entry.name.endswith(LAST)}
        for enum, entries in sorted(dialect.enums.items())
    }
    messages = {
        source.msgname: [source.id, source.crc_extra, base_length(source)]
        for _, source in sorted(dialect.mavlink_map.items())
    }
    parts = (f'"{name}": {{\n{lines(part)}\n}}' for name, part in (("enums", enums), ("messages", messages)))
    return "{\n" + ",\n".join(parts) + "\n}\n"


def layouts() -> str:
    """Return messages by name, as `LAYOUTS` says."""
    return f"{{\n{lines({each.msgname: message(each) for _, each in sorted(dialect.mavlink_map.items())})}\n}}\n"


def lines(part: dict[str, Any]) -> str:
    return ",\n".join(f"{json.dumps(name)}: {json.dumps(row, separators=(',', ':'))}" for name, row in part.items())


def message(source: Any) -> list[Any]:
    ordered, units = source.ordered_fieldnames, source.fieldunits_by_name
    order = [ordered.index(field) for field in source.fieldnames]
    lengths = [source.array_lengths[index] for index in order]
    fields = zip(source.fieldnames, source.fieldtypes, lengths, order, strict=True)
    rows = [[*row, units.get(row[0], "")] for row in fields]
    return [source.id, source.crc_extra, source.unpacker.format, base_length(source), rows]


def base_length(source: Any) -> int:
    """Return the payload's length before the extension fields.

    The dialect doesn't say where those begin, but CRC_EXTRA covers the base fields alone: the number of
    fields that reproduces it is their count.
    """
    types = dict(zip(source.fieldnames, source.fieldtypes, strict=True))
    checksum = crc16.mcrf4xx(f"{source.msgname} ".encode())
    length = 0
    for field, array_length in zip(source.ordered_fieldnames, source.array_lengths, strict=True):
        checksum = crc16.mcrf4xx(f"{types[field]} {field} ".encode(), checksum)
        if array_length:
            checksum = crc16.mcrf4xx(bytes([array_length]), checksum)
        length += SIZES[types[field]] * max(array_length, 1)
        if (checksum & 0xFF) ^ (checksum >> 8) == source.crc_extra:
            return length
    return int(source.unpacker.size)


SIZES = {
    **dict.fromkeys(("char", "int8_t", "uint8_t", "uint8_t_mavlink_version"), 1),
    **dict.fromkeys(("int16_t", "uint16_t"), 2),
    **dict.fromkeys(("int32_t", "uint32_t", "float"), 4),
    **dict.fromkeys(("int64_t", "uint64_t", "double"), 8),
}

if __name__ == "__main__":
    TABLE.write_text(table(), encoding="utf-8")
    LAYOUTS.write_text(layouts(), encoding="utf-8")

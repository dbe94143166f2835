"""The ULog format of PX4's logs: topics as tables, and parameters.

Source: PX4's documentation, "ULog File Format". Definitions and data are one sequence of messages: a header of two
bytes size and one byte type, then the text or the packed fields. Topics that nest others aren't read.
"""

from __future__ import annotations

import re
import struct
from collections import defaultdict
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from flight_model.arrays import Array

MAGIC: Final = b"ULog\x01\x12\x35"
HEADER_BYTES: Final = 16
FLAG_BITS: Final = struct.Struct("<8s8sQQQ")
APPENDED: Final = 1
"""Bit of the first incompatible flag: parts were appended after the log's end, at the offsets that follow."""
TYPES: Final = {
    "int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4",
    "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "u1", "char": "u1",
}  # fmt: skip
FIELD: Final = re.compile(r"(\w+)(?:\[(\d+)\])? (\w+)")
PADDING: Final = "_padding"
NO_LOG: Final = "no ULog file"


class ULogFile(NamedTuple):
    """What was read of a log."""

    topics: dict[str, dict[str, Array]]
    """The first instance of each topic: its columns, (N,) each, elements of arrays as `name[0]`, with `at_s`."""
    parameters: dict[str, float]
    names: frozenset[str]
    """Names of all topics that were logged."""


def read_ulog_file(path: Path, wanted: Collection[str]) -> ULogFile:
    """Read the topics that are `wanted`.

    Raises:
        OSError: the file can't be read.
        ValueError: it isn't a ULog file.
    """
    data = path.read_bytes()
    if len(data) < HEADER_BYTES or not data.startswith(MAGIC):
        raise ValueError(NO_LOG)
    formats, parameters = dict[str, str](), dict[str, float]()
    subscribed, names = dict[int, str](), set[str]()
    rows = defaultdict[str, list[bytes]](list)
    for kind, body in _messages(data):
        match kind:
            case "F":
                name, _, fields = body.decode("ascii", "replace").partition(":")
                formats[name] = fields
            case "P":
                parameters |= _parameter(body)
            case "A" if len(body) > 3:
                name = body[3:].decode("ascii", "replace")
                names.add(name)
                if body[0] == 0 and name in wanted:
                    subscribed[struct.unpack_from("<H", body, 1)[0]] = name
            case "D" if len(body) > 2 and (number := struct.unpack_from("<H", body)[0]) in subscribed:
                rows[subscribed[number]].append(body[2:])
            case _:
                pass
    topics = {name: table for name, each in rows.items() if (table := _table(formats.get(name, ""), each))}
    return ULogFile(topics, parameters, frozenset(names))


def _messages(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield the type and the body of each message; a part that is cut ends there."""
    for begin, end in _parts(data):
        at = begin
        while at + 3 <= end:
            size, kind = struct.unpack_from("<HB", data, at)
            if at + 3 + size > end:
                break
            yield chr(kind), data[at + 3 : at + 3 + size]
            at += 3 + size


def _parts(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield begin and end of the log, and of the parts that were appended to it."""
    borders = [HEADER_BYTES]
    if len(data) > HEADER_BYTES + 3 and data[HEADER_BYTES + 2] == ord("B"):
        if len(data) < HEADER_BYTES + 3 + FLAG_BITS.size:
            return
        _, incompatible, *offsets = FLAG_BITS.unpack_from(data, HEADER_BYTES + 3)
        if incompatible[0] & ~APPENDED or any(incompatible[1:]):
            raise ValueError("a ULog file of a later format")
        borders += sorted(offset for offset in offsets if borders[-1] < offset < len(data))
    yield from zip(borders, [*borders[1:], len(data)], strict=True)


def _parameter(body: bytes) -> dict[str, float]:
    length = body[0] if body else 0
    kind, _, name = body[1 : 1 + length].decode("ascii", "replace").partition(" ")
    value = body[1 + length :]
    if kind not in ("int32_t", "float") or len(value) != 4:
        return {}
    return {name: float(struct.unpack("<i" if kind == "int32_t" else "<f", value)[0])}


def _table(fields: str, rows: list[bytes]) -> dict[str, Array]:
    """Return a topic's columns; {} if its format nests another. Padding at a row's end isn't logged."""
    columns = list[tuple[str, str]]()
    for text in filter(None, fields.split(";")):
        found = FIELD.fullmatch(text)
        if found is None or found[1] not in TYPES:
            return {}
        kind, count, name = TYPES[found[1]], found[2], found[3]
        columns += [(f"{name}[{index}]", kind) for index in range(int(count))] if count else [(name, kind)]
    while columns and columns[-1][0].startswith(PADDING):
        columns.pop()
    layout = np.dtype(columns)
    whole = [row[: layout.itemsize] for row in rows if len(row) >= layout.itemsize]
    if "timestamp" not in (layout.names or ()) or not whole:
        return {}
    packed = np.frombuffer(b"".join(whole), dtype=layout)
    table: dict[str, Array] = {name: packed[name].astype(np.float64) for name, _ in columns}
    return table | {"at_s": table["timestamp"] * 1e-6}

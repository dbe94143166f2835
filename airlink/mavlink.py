"""The MAVLink dialect ardupilotmega: its constants, and its messages' ids and checksums.

They are read from a table, since importing pymavlink's generated module takes ten times as long.
`tests/airlink/test_mavlink.py` writes the table from that module and compares them. Only logs are read by pymavlink.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any

TABLE = Path(__file__).with_name("ardupilotmega.json")
"""The dialect: each enum's names and values; each message's id, CRC_EXTRA, and length without extension fields."""
STANDARD_ERROR = 2
NO_LOG = "not a dataflash log"
AT_ONCE = 4096
"""Number of messages that are read from such a log at once."""
_table: dict[str, dict[str, Any]] = json.loads(TABLE.read_bytes())
_ENUMS: dict[str, dict[str, int]] = _table["enums"]
_MESSAGES: dict[str, tuple[int, int, int]] = _table["messages"]
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


def flags_of(enum: str, bits: int) -> list[str]:
    """Return the names of those flags of a bitmask enum that are set in `bits`."""
    return [name for name, flag in _ENUMS[enum].items() if bits & flag]


MAVLINK_MSG_ID_CURRENT_MODE = 436
LATER = {"CURRENT_MODE": (MAVLINK_MSG_ID_CURRENT_MODE, 193, 9)}
"""Messages of MAVLink's common set that the dialect lacks: id, CRC_EXTRA and length without extension fields."""


def crc_extras() -> dict[int, int]:
    """Return CRC_EXTRA of every message, by message id."""
    return {message_id: extra for message_id, extra, _ in (*_MESSAGES.values(), *LATER.values())}


def base_lengths() -> dict[int, int]:
    """Return every message's payload length without extension fields, which MAVLink 1 lacks, by message id."""
    return {message_id: length for message_id, _, length in (*_MESSAGES.values(), *LATER.values())}


def dataflash_messages(path: str, kinds: Sequence[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the messages of some kinds in an ArduPilot dataflash log (.bin), each as its kind and its fields.

    Pymavlink's own output, a line for each byte that it skips, is discarded.

    Raises:
        OSError: the file can't be read.
        ValueError: it isn't such a log.
    """
    reader_type: Any = importlib.import_module("pymavlink.DFReader").DFReader_binary
    reader: Any = reader_type.__new__(reader_type)
    try:
        with _BareErrors():
            _silently(reader.__init__, path)
        while found := _silently(_next_messages, reader, list(kinds)):
            yield from found
    except (IndexError, struct.error, TypeError) as error:
        raise ValueError(NO_LOG) from error
    finally:
        for opened in ("data_map", "filehandle"):
            if hasattr(reader, opened):
                with suppress(BufferError):  # a map still in use by a failed reader, which closes with it
                    getattr(reader, opened).close()


def _next_messages(reader: Any, kinds: list[str]) -> list[tuple[str, dict[str, Any]]]:
    """Return a log's next messages of some kinds, at most `AT_ONCE`: to discard output for each is slow."""
    found = list[tuple[str, dict[str, Any]]]()
    while len(found) < AT_ONCE and (message := reader.recv_match(type=kinds)) is not None:
        found.append((str(message.get_type()), dict(message.to_dict())))
    return found


def magnetic_field_gauss(lat_deg: float, lon_deg: float) -> tuple[float, float, float]:
    """Return the Earth's magnetic field north, east and down, Gauss, by the table that autopilots have too."""
    field: Any = importlib.import_module("pymavlink.mavextra").get_mag_field_ef
    declination_deg, inclination_deg, gauss = field(lat_deg, lon_deg)
    declination, inclination = math.radians(declination_deg), math.radians(inclination_deg)
    level = gauss * math.cos(inclination)
    return level * math.cos(declination), level * math.sin(declination), gauss * math.sin(inclination)


class _BareErrors:
    """Turns bare `Exception`s, which pymavlink raises for formats that it doesn't know, into ValueErrors."""

    def __enter__(self) -> None:
        """Do nothing."""

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        """Raise a ValueError instead of a bare Exception."""
        if kind is Exception:
            raise ValueError(NO_LOG) from error


def _silently(call: Callable[..., Any], *given: Any, **named: Any) -> Any:
    """Call a function with standard output and error discarded, including what C code writes to file descriptor 2."""
    with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        try:
            before = os.dup(STANDARD_ERROR)
        except OSError:  # it is closed
            return call(*given, **named)
        os.dup2(nowhere.fileno(), STANDARD_ERROR)
        try:
            return call(*given, **named)
        finally:
            os.dup2(before, STANDARD_ERROR)
            os.close(before)

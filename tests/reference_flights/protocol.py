"""What each side of a flight over UDP sent, and in which order, but not when or how often."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega

from tests.reference_flights.records import TLOG, stamped_frames

TELLING = ("command", "result", "param_id", "name", "type", "text", "mission_type", "seq")
"""Fields that distinguish messages of a type, independent of the time."""
INTERVALS = (ardupilotmega.MAV_CMD_SET_MESSAGE_INTERVAL, ardupilotmega.MAV_CMD_REQUEST_MESSAGE)
"""Commands whose first parameter is a message's number."""

Stream = tuple[int, int, str]
"""Sender, target system (0: all) and type of message."""
Protocol = dict[Stream, list[str]]


def difference(base: Path, head: Path) -> str | None:
    """Return the first difference between the messages in two run directories; None if there's none."""
    before, now = protocol(base / TLOG), protocol(head / TLOG)
    for stream in sorted(before.keys() | now.keys()):
        if before.get(stream) != now.get(stream):
            sender, target, kind = stream
            return f"{kind} of system {sender} to {target}: {_list(before.get(stream))}, now {_list(now.get(stream))}"
    return None


def protocol(tlog: Path) -> Protocol:
    """Return what every system sent to each other by type of message, each content at its first occurrence."""
    said: Protocol = {}
    for stream, text in _texts(tlog):
        texts = said.setdefault(stream, [])
        if text not in texts:
            texts.append(text)
    return said


def _texts(tlog: Path) -> Iterator[tuple[Stream, str]]:
    parser = ardupilotmega.MAVLink(None)
    for _, frame in stamped_frames(tlog):
        message: Any = parser.decode(bytearray(frame))
        fields = {name: each for name, each in message.to_dict().items() if name in TELLING}
        if fields.get("command") in INTERVALS and message.get_type() != "COMMAND_ACK":
            fields["message"] = int(message.param1)
        stream = message.get_srcSystem(), getattr(message, "target_system", 0), message.get_type()
        yield stream, " ".join(f"{name} {each}" for name, each in fields.items())


def _list(said: list[str] | None) -> str:
    return "nothing" if said is None else "; ".join(said) or "said"

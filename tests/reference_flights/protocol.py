"""What each side of a flight over UDP said, and in which order; not when, nor how often."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega

from tests.reference_flights.records import TLOG, stamped_frames

TELLING = ("target_system", "command", "result", "param_id", "name", "type", "text", "mission_type", "seq")
"""Fields that tell one message of a type from another, whenever it's sent."""
INTERVALS = (ardupilotmega.MAV_CMD_SET_MESSAGE_INTERVAL, ardupilotmega.MAV_CMD_REQUEST_MESSAGE)
"""Commands whose first parameter is a message's number."""

Protocol = dict[tuple[int, str], list[str]]


def difference(base: Path, head: Path) -> str | None:
    """Return the first difference between what was said in two run directories; None if there's none."""
    before, now = protocol(base / TLOG), protocol(head / TLOG)
    for sender in sorted(before.keys() | now.keys()):
        if before.get(sender) != now.get(sender):
            system, kind = sender
            return f"{kind} of system {system}: {_list(before.get(sender))}, now {_list(now.get(sender))}"
    return None


def protocol(tlog: Path) -> Protocol:
    """Return what every system said of each type of message, each thing where it was said first."""
    said: Protocol = {}
    for system, kind, text in _said(tlog):
        texts = said.setdefault((system, kind), [])
        if text not in texts:
            texts.append(text)
    return said


def _said(tlog: Path) -> Iterator[tuple[int, str, str]]:
    parser = ardupilotmega.MAVLink(None)
    for _, frame in stamped_frames(tlog):
        message: Any = parser.decode(bytearray(frame))
        fields = {name: each for name, each in message.to_dict().items() if name in TELLING}
        if fields.get("command") in INTERVALS and message.get_type() != "COMMAND_ACK":
            fields["message"] = int(message.param1)
        yield message.get_srcSystem(), message.get_type(), " ".join(f"{name} {each}" for name, each in fields.items())


def _list(said: list[str] | None) -> str:
    return "nothing" if said is None else "; ".join(said) or "said"

"""The first frame in which two telemetry logs differ, by message and field."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import suppress
from itertools import zip_longest
from pathlib import Path
from typing import Final

from airlink.frame import Frame
from airlink.stream_parser import StreamParser
from formation_scenario.bounded_read import require_file
from gcs_formation.diff.difference import Difference
from gcs_formation.record.run_directory import EVENTS
from gcs_formation.record.tlog import read_tlog

MICRO: Final = 1e-6
_Stamped = tuple[int, bytes]


def tlog_differences(one: Path, other: Path) -> Iterator[Difference]:
    """Yield the first frame that differs: its stamp, its field, or that one log is shorter.

    Times are since the first frame, or since the run's start where the events beside the log say when that was.

    Raises:
        OSError: a log can't be read.
    """
    for each in (one, other):
        require_file(each)
    if one.read_bytes() == other.read_bytes():
        return
    begun = [_begun_us(each) for each in (one, other)]
    for number, (a, b) in enumerate(zip_longest(read_tlog(one), read_tlog(other)), 1):
        if a != b:
            t_s = min(MICRO * (each[0] - begin) for each, begin in zip((a, b), begun, strict=True) if each is not None)
            yield _first(one.name, number, t_s, a, b)
            return
    sizes = [each.stat().st_size for each in (one, other)]
    yield Difference(one.name, "bytes after the last whole frame", None, *sizes)


def _begun_us(tlog: Path) -> int:
    with suppress(OSError, ValueError, KeyError, TypeError):
        events = tlog.with_name(EVENTS).read_text(encoding="utf-8").splitlines()
        return int(json.loads(events[0])["epoch_us"])
    return next((stamp for stamp, _ in read_tlog(tlog)), 0)


def _first(part: str, number: int, t_s: float, one: _Stamped | None, other: _Stamped | None) -> Difference:
    if one is None or other is None:
        ends = ["no more frames" if each is None else _name(each[1]) for each in (one, other)]
        return Difference(part, f"frame {number}", t_s, *ends)
    frames = [_parsed(each[1]) for each in (one, other)]
    a, b = frames
    if one[1] == other[1]:
        return Difference(part, f"frame {number}, {_name(one[1])}: stamp, us", t_s, one[0], other[0])
    if (
        a is None
        or b is None
        or a.message is None
        or b.message is None
        or (a.system, a.message_id) != (b.system, b.message_id)
    ):
        return Difference(part, f"frame {number}", t_s, _name(one[1]), _name(other[1]))
    location = f"frame {number}, {_name(one[1])}"
    for field in a.message.kind().fields:
        values = getattr(a.message, field), getattr(b.message, field)
        if values[0] != values[1]:
            return Difference(part, f"{location}: {field}", t_s, *values)
    if a.sequence != b.sequence:
        return Difference(part, f"{location}: sequence number", t_s, a.sequence, b.sequence)
    return Difference(part, location, t_s, one[1].hex(), other[1].hex())


def _parsed(raw: bytes) -> Frame | None:
    return StreamParser().first(raw)


def _name(raw: bytes) -> str:
    """Return what a frame is and who sent it."""
    frame = _parsed(raw)
    if frame is None:
        return f"{len(raw)} bytes"
    name = f"message {frame.message_id}" if frame.message is None else frame.message.kind().name
    return f"{name} of {frame.system}/{frame.component}"

"""Differences between two records of a flight: byte for byte, value for value."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

TLOG = "flight.tlog"
TIMESERIES = "timeseries.parquet"
EVENTS = "events.jsonl"
SUMMARY = "summary.json"
WALL_CLOCK = ("version", "wall_s", "real_time_factor", "control.compute_ms", "stability.worst_loop_delay_s")
"""What in the summary depends on the machine and the revision; the worst loop delay includes computing time."""
STAMP_BYTES = 8
"""Before each frame of a tlog: microseconds since 1970, big-endian."""
MARKER_V2 = 0xFD


def difference(base: Path, head: Path) -> str | None:
    """Return the first difference between two run directories, with its file and place; None if there's none."""
    for name, differs in ((TLOG, _tlogs), (TIMESERIES, _series), (EVENTS, _events), (SUMMARY, _summaries)):
        found, expected = (head / name).is_file(), (base / name).is_file()
        if found != expected:
            return f"{name}: {'only in the later' if found else 'missing in the later'}"
        differing = differs(base / name, head / name) if found else None
        if differing is not None:
            return f"{name}: {differing}"
    return None


def _tlogs(base: Path, head: Path) -> str | None:
    if base.read_bytes() == head.read_bytes():
        return None
    for number, (before, now) in enumerate(zip_longest(stamped_frames(base), stamped_frames(head)), 1):
        if before != now:
            return f"record {number}: {_frame_text(before)}, now {_frame_text(now)}"
    return "bytes after the last frame"


def stamped_frames(tlog: Path) -> Iterator[tuple[int, bytes]]:
    """Yield each frame of a tlog with its stamp, µs since 1970.

    The lengths are those of the MAVLink guide, "Packet Serialization": 12 bytes about a payload of version 2 and
    13 more where it is signed, 8 about one of version 1.
    """
    log, at = tlog.read_bytes(), 0
    while at + STAMP_BYTES + 3 <= len(log):
        frame = log[at + STAMP_BYTES :][: 12 + 255 + 13]
        length = frame[1] + (12 + 13 * (frame[2] & 1) if frame[0] == MARKER_V2 else 8)
        yield int.from_bytes(log[at : at + STAMP_BYTES]), frame[:length]
        at += STAMP_BYTES + length


def _frame_text(record: tuple[int, bytes] | None) -> str:
    if record is None:
        return "none"
    stamp_us, frame = record
    if frame[0] != MARKER_V2:
        return f"{stamp_us} µs {frame.hex()}"
    message_id = int.from_bytes(frame[7:10], "little")
    return f"{stamp_us} µs message {message_id} of system {frame[5]}: {frame.hex()}"


def _series(base: Path, head: Path) -> str | None:
    before, now = pq.read_table(base), pq.read_table(head)
    if before.schema != now.schema:
        columns = set(map(str, before.schema)) ^ set(map(str, now.schema))
        return f"columns differ: {', '.join(sorted(columns)) or 'in their order'}"
    if before.num_rows != now.num_rows:
        return f"{before.num_rows} rows, now {now.num_rows}"
    changed = [(row, name) for name in before.column_names if (row := _first(before[name], now[name])) is not None]
    if not changed:
        return None
    row, name = min(changed)
    place = ", ".join(f"{key} {before[key][row]}" for key in ("t_s", "vehicle") if key in before.column_names)
    return f"row {row} ({place}), {name}: {before[name][row]}, now {now[name][row]}; {len(changed)} columns differ"


def _first(before: pa.ChunkedArray, now: pa.ChunkedArray) -> int | None:
    """Return the first row in which two columns differ; NaN equals NaN, and null equals null."""
    a, b = before.to_numpy(), now.to_numpy()
    same = (a == b) | ((a != a) & (b != b))  # noqa: PLR0124 - NaN alone differs from itself, in columns of any type
    return None if same.all() else int(np.argmin(same))


def _events(base: Path, head: Path) -> str | None:
    lines = zip_longest(*(path.read_text(encoding="utf-8").splitlines() for path in (base, head)), fillvalue="none")
    for number, (before, now) in enumerate(lines, 1):
        if before != now:
            return f"line {number}: {before}, now {now}"
    return None


def _summaries(base: Path, head: Path) -> str | None:
    before, now = (dict(_figures(json.loads(path.read_text(encoding="utf-8")))) for path in (base, head))
    for key in [*before, *(key for key in now if key not in before)]:
        if before.get(key, "none") != now.get(key, "none"):
            return f"{key}: {before.get(key, 'none')}, now {now.get(key, 'none')}"
    return None


def _figures(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every figure of a summary under its dotted key, without those of the wall clock."""
    if key in WALL_CLOCK:
        return
    if not isinstance(value, dict | list) or not value:
        yield key, value
        return
    for name, each in value.items() if isinstance(value, dict) else enumerate(value):
        yield from _figures(each, f"{key}.{name}" if key else str(name))

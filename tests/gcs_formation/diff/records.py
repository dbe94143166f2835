"""A small record of a run, written with other programs' libraries."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from pymavlink.dialects.v20 import ardupilotmega

STAMP_US = 1_577_836_800_000_000
KEYS = "schema: 1\nseed: 3\nlaw: {type: pid}\n"
SUMMARY: dict[str, Any] = {
    "version": "0.1.0",
    "wall_s": 1.5,
    "control": {"ticks": 2, "compute_ms": {"p50": 0.2}},
    "expect": [{"value": 0.25}],
}
SERIES: dict[str, Any] = {
    "network": [1, 1, 1, 1],
    "vehicle": [1, 2, 1, 2],
    "t_s": [0.0, 0.0, 0.1, 0.1],
    "heading_rad": [3.1, 0.0, 3.1, 0.0],
    "delay_s": [float("nan"), 0.25, 0.5, 0.25],
    "phase": ["flying", "flying", "flying", "flying"],
}


def heartbeat(system: int, mode: int = 0) -> bytes:
    link = ardupilotmega.MAVLink(None, srcSystem=system)
    return bytes(link.heartbeat_encode(1, 3, 0, mode, 0).pack(link))


def command(number: int, parameter: float = 0.0) -> bytes:
    link = ardupilotmega.MAVLink(None, srcSystem=255)
    return bytes(link.command_long_encode(2, 1, number, 0, parameter, 0, 0, 0, 0, 0, 0).pack(link))


def write_tlog(directory: Path, *frames: bytes, every_us: int = 0) -> Path:
    directory.mkdir(exist_ok=True)
    stamped = (struct.pack(">Q", STAMP_US + index * every_us) + frame for index, frame in enumerate(frames))
    (directory / "flight.tlog").write_bytes(b"".join(stamped))
    return directory


def write_series(directory: Path, **columns: list[Any]) -> None:
    pq.write_table(pa.table(SERIES | columns), directory / "timeseries.parquet")


def write_record(directory: Path) -> Path:
    write_tlog(directory, heartbeat(1), heartbeat(2), every_us=50_000)
    write_series(directory)
    (directory / "run.yaml").write_text(KEYS)
    (directory / "events.jsonl").write_text('{"t_s": 0.0}\n{"t_s": 0.1}\n')
    (directory / "summary.json").write_text(json.dumps(SUMMARY))
    return directory

"""The comparison of records detects each kind of difference, and names its place."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from tests.reference_flights import protocol
from tests.reference_flights.records import EVENTS, SUMMARY, TIMESERIES, TLOG, difference

STAMP_US = 1_577_836_800_000_000
SUMMARIES = {"wall_s": 1.5, "control": {"ticks": 2, "compute_ms": {"p50": 0.2}}, "expect": [{"value": 0.25}]}
SERIES = {"t_s": [0.0, 0.1], "vehicle": [1, 1], "delay_s": [float("nan"), 0.5], "phase": ["flying", None]}


def heartbeat(system: int) -> bytes:
    link = ardupilotmega.MAVLink(None, srcSystem=system)
    return link.heartbeat_encode(1, 3, 0, 0, 0).pack(link)


def command(number: int, parameter: float = 0.0) -> bytes:
    link = ardupilotmega.MAVLink(None, srcSystem=255)
    return link.command_long_encode(2, 1, number, 0, parameter, 0, 0, 0, 0, 0, 0).pack(link)


def write_tlog(directory: Path, *frames: bytes) -> Path:
    directory.mkdir(exist_ok=True)
    (directory / TLOG).write_bytes(b"".join(struct.pack(">Q", STAMP_US) + frame for frame in frames))
    return directory


def record(directory: Path) -> Path:
    write_tlog(directory, heartbeat(1), heartbeat(2))
    pq.write_table(pa.table(SERIES), directory / TIMESERIES)
    (directory / EVENTS).write_text('{"t_s": 0.0}\n{"t_s": 0.1}\n')
    (directory / SUMMARY).write_text(json.dumps(SUMMARIES))
    return directory


def one_value_changed(directory: Path) -> None:
    pq.write_table(pa.table(SERIES | {"delay_s": [float("nan"), 0.5 + 1e-16 * 2]}), directory / TIMESERIES)


def a_number_for_nan(directory: Path) -> None:
    pq.write_table(pa.table(SERIES | {"delay_s": [0.0, 0.5]}), directory / TIMESERIES)


def a_null_filled(directory: Path) -> None:
    pq.write_table(pa.table(SERIES | {"phase": ["flying", "flying"]}), directory / TIMESERIES)


def a_row_less(directory: Path) -> None:
    pq.write_table(pa.table(SERIES).slice(0, 1), directory / TIMESERIES)


def another_type(directory: Path) -> None:
    pq.write_table(pa.table(SERIES | {"vehicle": pa.array([1, 1], pa.int32())}), directory / TIMESERIES)


def a_bit_of_the_tlog(directory: Path) -> None:
    write_tlog(directory, heartbeat(1), heartbeat(3))


def a_frame_more(directory: Path) -> None:
    write_tlog(directory, heartbeat(1), heartbeat(2), heartbeat(2))


def an_event_more(directory: Path) -> None:
    (directory / EVENTS).write_text('{"t_s": 0.0}\n{"t_s": 0.1}\n{"t_s": 0.2}\n')


def a_figure(directory: Path) -> None:
    (directory / SUMMARY).write_text(json.dumps(SUMMARIES | {"expect": [{"value": 0.26}]}))


def a_figure_less(directory: Path) -> None:
    (directory / SUMMARY).write_text(json.dumps(SUMMARIES | {"control": {}}))


def a_file_less(directory: Path) -> None:
    (directory / EVENTS).unlink()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (one_value_changed, "timeseries.parquet: row 1 (t_s 0.1, vehicle 1), delay_s: 0.5, now 0.5000000000000002"),
        (a_number_for_nan, "timeseries.parquet: row 0 (t_s 0.0, vehicle 1), delay_s: nan, now 0.0"),
        (a_null_filled, "timeseries.parquet: row 1 (t_s 0.1, vehicle 1), phase: None, now flying"),
        (a_row_less, "timeseries.parquet: 2 rows, now 1"),
        (another_type, "timeseries.parquet: columns differ"),
        (a_bit_of_the_tlog, f"flight.tlog: record 2: {STAMP_US} µs message 0 of system 2"),
        (a_frame_more, "flight.tlog: record 3: none, now"),
        (an_event_more, 'events.jsonl: line 3: none, now {"t_s": 0.2}'),
        (a_figure, "summary.json: expect.0.value: 0.25, now 0.26"),
        (a_figure_less, "summary.json: control.ticks: 2, now none"),
        (a_file_less, "events.jsonl: missing in the later"),
    ],
)
def test_a_difference_is_found_where_it_is(change: Callable[[Path], None], told: str, tmp_path: Path) -> None:
    base, head = record(tmp_path / "base"), record(tmp_path / "head")
    change(head)
    assert (difference(base, head) or "").startswith(told)


def test_records_that_differ_by_the_wall_clock_alone_are_the_same(tmp_path: Path) -> None:
    base, head = record(tmp_path / "base"), record(tmp_path / "head")
    later = {"wall_s": 2.5, "control": {"ticks": 2, "compute_ms": {"p50": 0.3}}}
    (head / SUMMARY).write_text(json.dumps(SUMMARIES | later))
    assert difference(base, head) is None


def test_a_protocol_is_what_is_said_in_its_order_however_often(tmp_path: Path) -> None:
    base = write_tlog(tmp_path / "base", heartbeat(1), command(511, 30.0), command(511, 33.0), command(400))
    often = write_tlog(tmp_path / "often", command(511, 30.0), command(511, 33.0), *[heartbeat(1)] * 3, command(400))
    assert protocol.difference(base, often) is None
    turned = write_tlog(tmp_path / "turned", heartbeat(1), command(511, 33.0), command(511, 30.0), command(400))
    assert (protocol.difference(base, turned) or "").startswith("COMMAND_LONG of system 255 to 2: ")
    silent = write_tlog(tmp_path / "silent", command(511, 30.0), command(511, 33.0), command(400))
    assert protocol.difference(base, silent) == "HEARTBEAT of system 1 to 0: type 1, now nothing"

"""Reads recorded delays, whatever they are recorded in."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

from formation_scenario.bounded_read import read_bounded
from formation_scenario.fields import FileError
from formation_scenario.impairment_types import MAX_MS
from formation_scenario.traces import ping, table
from formation_scenario.traces.keys import Trace
from formation_scenario.traces.recorded import RecordedDelays, Sample, recorded

MAX_BYTES: Final = 16_000_000
ALLOWED: Final = (
    f"the output of ping, a table with named columns, or a number on each line: delays from 0 to {MAX_MS:.0f} ms"
)


def read_trace(trace: Trace) -> RecordedDelays:
    """Return the delays in a file, one-way.

    Raises:
        FileError: the file can't be read or isn't what the keys say; the message says what was found, and where.
    """
    lines, file = _lines(Path(trace.file)), trace.file
    if ping.is_ping(lines):
        samples = ping.read_ping(lines, trace.period_s)
        if not samples:
            raise FileError(f"found {file}, the output of a ping that nothing answered")
        return recorded(file, samples, round_trip=trace.kind != "one_way", period_s=None)
    if not table.is_table(lines):
        if trace.column is not None or trace.time is not None:
            raise FileError(f"found {file}, which isn't a table with named columns")
        samples = _numbers(file, lines, 1e3 * table.UNITS_S[trace.unit or "ms"])
        return recorded(file, samples, round_trip=trace.kind == "rtt", period_s=trace.period_s)
    if trace.time is None and trace.period_s is None:
        raise FileError(f"found {file}, a table, and neither `time`, the column of its times, nor `period_s`")
    column, samples = table.read_table(file, lines, trace.column, trace.unit, trace.time, trace.time_unit)
    round_trip = "rtt" in column.lower() if trace.kind is None else trace.kind == "rtt"
    return recorded(file, samples, round_trip=round_trip, period_s=trace.period_s)


def _lines(path: Path) -> list[str]:
    try:
        return read_bounded(path, MAX_BYTES).decode("utf-8-sig").splitlines()
    except OSError as error:
        raise FileError(f"found {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise FileError(f"found {path}, which isn't text in UTF-8") from error


def _numbers(file: str, lines: list[str], scale_ms: float) -> list[Sample]:
    """Return a number a line; empty lines and text after # are ignored, and a word such as `lost` is a loss."""
    found = list[Sample]()
    for number, line in enumerate(lines, start=1):
        entry = line.partition("#")[0].strip()
        if entry:
            found.append(Sample(number, math.nan, scale_ms * table.delay(file, number, entry)))
    if not found:
        raise FileError(f"found {file} without a number in it")
    return found

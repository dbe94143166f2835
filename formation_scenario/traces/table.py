"""Tables with named columns, separated by commas, semicolons or tabs."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Final

from formation_scenario.fields import FileError, did_you_mean
from formation_scenario.traces.recorded import Sample

UNITS_S: Final = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}
LOST: Final = {"", "-", "*", "nan", "inf", "null", "none", "na", "n/a", "lost", "timeout"}
"""What stands for a sample that was lost; in a table -1 does, too."""
NO_DELAY: Final = -1.0
DELIMITERS: Final = ",;\t"


def is_table(lines: Sequence[str]) -> bool:
    """Return whether the first line with text has words in it, the names of columns."""
    first = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    words = _cells(first.partition("#")[0])
    return any(_is_name(word) for word in words)


def read_table(
    name: str, lines: Sequence[str], column: str | None, unit: str | None, time: str | None, time_unit: str | None
) -> tuple[str, list[Sample]]:
    """Return the name of the column of delays, and the samples; without a column `time` these have no time.

    Raises:
        FileError: no such column, none chosen of several, no unit, or a cell that is neither a number nor a loss.
    """
    rows = [(n, _cells(line)) for n, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    head = [each.strip() for each in rows[0][1]]
    chosen = column if column is not None else _only(name, head, time)
    index, scale_s = _index(name, head, chosen), UNITS_S[_unit(name, chosen, unit, "unit")]
    when = None if time is None else _index(name, head, time)
    clock_s = 1.0 if time is None else UNITS_S[_unit(name, time, time_unit, None)]
    found = list[Sample]()
    for line, cells in rows[1:]:
        if when is not None and not _cell(cells, when):
            continue  # of another column's samples
        at_s = math.nan if when is None else _time_s(name, line, _cell(cells, when), clock_s)
        delay_of_cell = delay(name, line, _cell(cells, index))
        found.append(Sample(line, at_s, math.nan if delay_of_cell == NO_DELAY else 1e3 * scale_s * delay_of_cell))
    if not found:
        raise FileError(f"found {name} without a line below its columns' names")
    return chosen, found


def _cells(line: str) -> list[str]:
    delimiter = max(DELIMITERS, key=line.count)
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])


def _cell(cells: list[str], index: int) -> str:
    return cells[index].strip() if index < len(cells) else ""


def _only(name: str, head: list[str], time: str | None) -> str:
    named = [each for each in head if each != time and _suffix(each) is not None]
    likely = [each for each in named if any(word in each.lower() for word in ("rtt", "delay", "latency"))]
    columns = likely or named or [each for each in head if each != time]
    if len(columns) != 1:
        raise FileError(f"found {name} with the columns {', '.join(head)}, and none of them chosen by `column`")
    return columns[0]


def _index(name: str, head: list[str], column: str) -> int:
    if column not in head:
        columns = f"its columns are {', '.join(head)}"
        raise FileError(f"found {name} without a column '{column}'{did_you_mean(column, head)}: {columns}")
    return head.index(column)


def _suffix(column: str) -> str | None:
    """Return the unit at the end of a column's name: rtt_ms, "rtt (ms)", "rtt [ms]", "rtt ms"."""
    word = column.lower().replace("µs", "us").rstrip(")] ").replace("(", "_").replace("[", "_").replace(" ", "_")
    unit = word.rpartition("_")[2]
    return unit if unit in UNITS_S else None


def _unit(name: str, column: str, given: str | None, key: str | None) -> str:
    found = given or _suffix(column)
    if found is None and key is not None:
        raise FileError(f"found the column '{column}' of {name}, whose name has no unit, and no `{key}`")
    return found or "s"


def delay(name: str, line: int, cell: str) -> float:
    """Return a delay, NaN if it stands for a loss.

    Raises:
        FileError: it is neither a number nor a loss.
    """
    if cell.lower() in LOST:
        return math.nan
    if not _is_number(cell):
        raise FileError(f"found '{cell[:40]}' at {name}:{line}")
    return float(cell)


def _time_s(name: str, line: int, cell: str, scale_s: float) -> float:
    if _is_number(cell) and math.isfinite(float(cell)):
        return scale_s * float(cell)
    try:
        found = datetime.fromisoformat(cell)
    except ValueError:
        raise FileError(f"found the time '{cell[:40]}' at {name}:{line}") from None
    return (found if found.tzinfo is not None else found.replace(tzinfo=UTC)).timestamp()


def _is_name(word: str) -> bool:
    return any(each.isalpha() for each in word) and not _is_number(word) and word.strip().lower() not in LOST


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in word

"""Two runs beside one another: what differs first, and where.

Causes come before effects: versions and extensions, keys of the scenario, then what happened in the order of time
(frames, events, ticks), then the figures. With a tolerance, numbers count as different beyond it alone, and bytes don't
count: a change that isn't meant to alter flights is held by `diff`, one that may alter them a little by
`diff --tolerance`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from formation_scenario.bounded_read import require_file
from formation_scenario.source import Loader
from gcs_formation.diff.difference import Difference, Tolerance, flattened
from gcs_formation.diff.frames import tlog_differences
from gcs_formation.diff.ticks import series_differences
from gcs_formation.errors import RecordError
from gcs_formation.record.run_directory import EVENTS, SCENARIO, SUMMARY, TIMESERIES, TLOG

__all__ = ["Difference", "differences"]

FLOWN_BY = ("version", "features", "extensions")
"""Keys of a summary that say what flew it."""
OF_THE_SCENARIO = ("name", "seed")
"""Keys of a summary that repeat the scenario's."""
OF_THE_MACHINE = (
    "wall_s",
    "real_time_factor",
    "control.compute_ms",
    "control.period_ms",
    "control.late_ticks",
    "stability.worst_loop_delay_s",
)
"""Figures that depend on how fast a machine is; the worst loop delay includes computing time."""


def differences(one: Path, other: Path, tolerance: float | None = None) -> Iterator[Difference]:
    """Yield the differences of two run directories, causes first.

    Args:
        one: the first run's directory.
        other: the second run's.
        tolerance: greatest difference of two numbers that counts as none, in each number's own unit; None: bytes
            and the order of events count too.

    Raises:
        RecordError: a directory that has no record of a run, or one that can't be read.
    """
    for directory in (one, other):
        if not (directory / SCENARIO).is_file():
            raise RecordError(f"found no {SCENARIO} in {directory}; allowed: the directory of a run")
    allowed = Tolerance(tolerance)
    summaries = _summary(one), _summary(other)
    for key in FLOWN_BY:
        yield from _values("", {key: summaries[0].get(key)}, {key: summaries[1].get(key)}, Tolerance(None))
    yield from _values(SCENARIO, _scenario(one), _scenario(other), Tolerance(None))
    happened = [*_events(one, other)] if tolerance is None else []
    if tolerance is None:
        happened += _of_files(one, other, TLOG, tlog_differences)
    happened += _of_files(one, other, TIMESERIES, lambda a, b: series_differences(a, b, allowed))
    yield from sorted(happened, key=lambda each: float("inf") if each.t_s is None else each.t_s)
    for each in _values(SUMMARY, *summaries, allowed):
        if not each.location.startswith((*FLOWN_BY, *OF_THE_SCENARIO, *OF_THE_MACHINE)):
            yield each


def _of_files(one: Path, other: Path, name: str, compare: Any) -> Iterator[Difference]:  # noqa: ANN401 - two readers
    """Yield the differences of a file that both runs have, or say that one lacks it."""
    found = [(each / name).is_file() for each in (one, other)]
    if found[0] != found[1]:
        yield Difference(name, "", None, *("there" if each else "missing" for each in found))
    if not all(found):
        return
    try:
        yield from compare(one / name, other / name)
    except (OSError, ValueError) as error:
        raise RecordError(f"cannot read {name} of {one} and {other}: {error}") from error


def _summary(directory: Path) -> dict[str, Any]:
    """Return a run's summary, empty where the run didn't come to its end."""
    try:
        require_file(directory / SUMMARY)
        text = (directory / SUMMARY).read_text(encoding="utf-8")
        found = json.loads(text)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise RecordError(f"cannot read {directory / SUMMARY}: {error}") from error
    return found if isinstance(found, dict) else {}


def _scenario(directory: Path) -> dict[str, Any]:
    try:
        require_file(directory / SCENARIO)
        found = yaml.load((directory / SCENARIO).read_text(encoding="utf-8"), Loader)
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise RecordError(f"cannot read {directory / SCENARIO}: {error}") from error
    return found if isinstance(found, dict) else {}


def _values(part: str, one: dict[str, Any], other: dict[str, Any], allowed: Tolerance) -> Iterator[Difference]:
    """Yield what differs between two nested mappings, by dotted key."""
    first, second = flattened(one), flattened(other)
    for key in dict.fromkeys([*first, *second]):
        a, b = first.get(key, "missing"), second.get(key, "missing")
        if not allowed.same(a, b):
            yield Difference(part, key, None, a, b)


def _events(one: Path, other: Path) -> Iterator[Difference]:
    """Yield the first event that differs, and how many events the runs have if that differs."""
    lines = [_lines(each / EVENTS) for each in (one, other)]
    for number, (a, b) in enumerate(zip(*lines, strict=False), 1):
        if a != b:
            yield Difference(EVENTS, f"line {number}", min(_t_s(a), _t_s(b)), a, b)
            return
    if len(lines[0]) != len(lines[1]):
        more = max(lines, key=len)[min(map(len, lines))]
        yield Difference(EVENTS, "lines", _t_s(more), len(lines[0]), len(lines[1]))


def _lines(path: Path) -> list[str]:
    try:
        require_file(path)
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []


def _t_s(line: str) -> float:
    try:
        return float(json.loads(line)["t_s"])
    except (ValueError, KeyError, TypeError):
        return 0.0

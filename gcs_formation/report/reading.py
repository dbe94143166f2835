"""Reads a run back from its directory."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pyarrow as pa

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario, ScenarioError, load_scenario
from formation_scenario.bounded_read import require_file
from formation_scenario.registry import Files, Registry, load_extensions
from gcs_formation.errors import RecordError
from gcs_formation.record.flight import Columns, RecordedFlight
from gcs_formation.record.json_shape import (
    Shape,
    mismatch,
)
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.run_directory import EVENTS, SCENARIO, SPOOL, SUMMARY, TIMESERIES, event_shape
from gcs_formation.record.summary import SCHEMA
from gcs_formation.record.timeseries import ERROR, GROUND, MEASURED
from gcs_formation.report.run_data import Events, RunData, run_data
from gcs_formation.report.summary_shape import SUMMARY_SHAPE
from gcs_formation.report.unfinished import unfinished

NUMBERS = "biuf"
"""Numpy's kinds of numbers and flags."""
EXPECTED = ("network", "vehicle", "phase", *MEASURED, *ERROR, *GROUND)
"""Columns that every time series must have."""


def load_run(directory: Path, plugins: Files | Registry = ()) -> RunData:
    """Return the run recorded in a directory, whose scenario may name what `plugins` register.

    Raises:
        RecordError: it isn't the directory of a run, nothing was flown, or a file of it can't be read.
    """
    finished = _is_finished(directory)
    try:
        scenario, refused = _scenario(directory / SCENARIO, load_extensions(plugins))
        if not finished:
            run = unfinished(directory, scenario)
            return replace(run, missing=(*run.missing, *refused))
        summary = _summary(directory / SUMMARY)
        events = _events(directory / EVENTS)
        columns = _columns(directory / TIMESERIES)
    except (OSError, ValueError, pa.ArrowException, ScenarioError) as error:
        raise RecordError(f"cannot read the run in {directory}: {error}") from error
    missing = sorted(set(EXPECTED) - set(columns))
    if missing:
        found = f"found no column {missing[0]} in {directory / TIMESERIES}"
        raise RecordError(f"{found}; expected: a record of this version; fly it again: {directory / SCENARIO}")
    whole = RecordedFlight(_vehicles(directory / TIMESERIES, scenario, columns))
    return run_data(scenario, summary, events, whole, refused)


def _scenario(path: Path, registry: Registry) -> tuple[Scenario, tuple[str, ...]]:
    """Return the scenario, and in words what this version would refuse in it."""
    try:
        return load_scenario(path, plugins=registry), ()
    except ScenarioError as error:
        flown = load_scenario(path, flown=True, plugins=registry)
        return flown, tuple(f"a scenario that this version would fly: {each}" for each in error.problems)


def _is_finished(directory: Path) -> bool:
    """Return whether a run wrote all its files; an unfinished one must have a spool, or RecordError is raised."""
    if not directory.is_dir():
        raise RecordError(f"found no directory {directory}; expected: the directory of a run")
    if not (directory / SCENARIO).is_file():
        raise RecordError(f"found no {SCENARIO} in {directory}; expected: the directory of a run")
    if (directory / TIMESERIES).is_file() and (directory / SUMMARY).is_file():
        return True
    if not (directory / SPOOL).is_file():
        missing = [name for name in (TIMESERIES, SUMMARY) if not (directory / name).is_file()]
        raise RecordError(f"found no {' and no '.join(missing)} in {directory}, and no {SPOOL} of an unfinished run")
    return False


def _summary(path: Path) -> Mapping[str, Any]:
    summary: Any = _parsed(_text(path), path)
    found: Any = cast("dict[str, Any]", summary).get("schema") if isinstance(summary, dict) else None
    if found != SCHEMA:
        raise ValueError(f"found schema {found} in {path.name}; expected: {SCHEMA}")
    return _fitting(summary, SUMMARY_SHAPE, path.name)


def _fitting(found: Any, shape: Shape, where: str) -> Mapping[str, Any]:  # noqa: ANN401 - whatever the JSON holds
    text = mismatch(found, shape, where)
    if text is not None:
        raise ValueError(text)
    return found


def _events(path: Path) -> Events:
    lines = _text(path).splitlines() if path.is_file() else ()
    parsed = ((number, _parsed(line, path, number)) for number, line in enumerate(lines, 1) if line.strip())
    return tuple(_fitting(found, event_shape(found), f"{path.name}, line {number}") for number, found in parsed)


def _text(path: Path) -> str:
    try:
        require_file(path)
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        found = f"found byte 0x{error.object[error.start]:02x} at offset {error.start} of {path.name}"
        raise ValueError(f"{found}; expected: text in UTF-8, {path.name} as the run wrote it") from error


def _columns(path: Path) -> dict[str, Array]:
    try:
        columns = read_parquet(path)
    except (ValueError, OSError, pa.ArrowException) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        why = " ".join(str(error).split()).rstrip(".")
        found = f"found something else than whole Parquet in {path.name} ({why})"
        raise ValueError(f"{found}; expected: {path.name} as the run wrote it") from error
    for name, values in columns.items():
        if values.dtype.kind not in NUMBERS:
            found = f"found a column {name} of something else than numbers in {path.name}"
            raise ValueError(f"{found}; expected: {path.name} as the run wrote it")
    return columns


def _parsed(text: str, path: Path, line: int = 0) -> Any:  # noqa: ANN401 - whatever the JSON holds
    try:
        return json.loads(text)
    except ValueError as error:
        found = f"found text that isn't whole JSON in {path.name}{f', line {line}' if line else ''}"
        raise ValueError(f"{found} ({error}); expected: {path.name} as the run wrote it") from error


def _vehicles(path: Path, scenario: Scenario, columns: Mapping[str, Array]) -> dict[VehicleId, Columns]:
    """Return each vehicle's columns. The file has one row for each vehicle at every tick, always in the same order."""
    count, rows = len(scenario.vehicles), columns["t_s"].size
    if rows == 0:
        raise RecordError(f"found no control tick in {path}: nothing was flown")
    if rows % count:
        raise RecordError(f"found {rows} rows in {path}; expected: a multiple of {count}, one for each vehicle")
    grid = {name: values.reshape(-1, count) for name, values in columns.items()}
    ids = zip(grid["network"][0].tolist(), grid["vehicle"][0].tolist(), strict=True)
    column = {VehicleId(*identity): i for i, identity in enumerate(ids)}
    expected = [vehicle.vehicle_id for vehicle in scenario.vehicles]
    if set(column) != set(expected):
        raise RecordError(f"found vehicles {_names(column)} in {path}; expected: {_names(expected)}")
    return {v: {name: values[:, column[v]] for name, values in grid.items()} for v in expected}


def _names(vehicles: Iterable[VehicleId]) -> str:
    return ", ".join(map(str, vehicles))

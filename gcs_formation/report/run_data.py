"""A finished run, read back from its directory."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario, ScenarioError, load_scenario
from gcs_formation.errors import RecordError
from gcs_formation.record.flight import Columns, Flight
from gcs_formation.record.run_directory import EVENTS, SCENARIO, SPOOL, SUMMARY, TIMESERIES
from gcs_formation.record.summary import SCHEMA
from gcs_formation.record.timeseries import ERROR, GROUND, MEASURED, TRUTH, flying, read_parquet

WORST_WITHOUT_ERRORS = -1.0
EXPECTED = ("network", "vehicle", "phase", *MEASURED, *ERROR, *GROUND)
"""Columns of every time series."""


@dataclass(frozen=True)
class RunData:
    """A run as its figures need it. `whole` has every tick; `flown`, those from the path's start to its end."""

    scenario: Scenario
    summary: Mapping[str, Any]
    events: tuple[Mapping[str, Any], ...]
    whole: Flight
    flown: Flight
    clock_s: Array
    """(T,) times of all ticks on the run's clock."""
    zero_s: float
    """The clock's time at mission time 0; of the first tick where the path was never begun."""
    begun: bool
    """Whether the leader ever started along its path. If not, `flown` is everything."""
    missing: tuple[str, ...] = ()
    """What the record of an unfinished run lacks, in words."""

    @property
    def whole_time_s(self) -> Array:
        """(T,) mission times of all ticks, negative before the path."""
        return self.clock_s - self.zero_s

    @property
    def time_s(self) -> Array:
        """(K,) mission times of the flown ticks."""
        return next(iter(self.flown.vehicles.values()))["t_s"] - self.zero_s

    @property
    def leader(self) -> VehicleId | None:
        """The vehicle that leads first, None when a virtual leader does."""
        return self.scenario.leader.vehicle_id if self.scenario.leader else None

    @property
    def followers(self) -> tuple[VehicleId, ...]:
        """The vehicles that follow, in the scenario's order, and last the leader where that has followed another."""
        led = (self.leader,) if self.leader is not None and self.flown.has_followed(self.leader) else ()
        return (*(vehicle.vehicle_id for vehicle in self.scenario.followers), *led)

    def worst_first(self) -> list[VehicleId]:
        """Return the followers by falling root mean square of their flown errors."""
        return sorted(self.followers, key=lambda vehicle: -_rms(self.flown.error(vehicle)))


def load_run(directory: Path) -> RunData:
    """Return the run recorded in a directory.

    Raises:
        RecordError: it isn't the directory of a run, nothing was flown, or a file of it can't be read.
    """
    finished = _is_finished(directory)
    try:
        scenario = load_scenario(directory / SCENARIO)
        if not finished:
            return _unfinished(directory, scenario)
        summary = _summary(directory / SUMMARY)
        events = _events(directory / EVENTS)
        columns = read_parquet(directory / TIMESERIES)
    except (OSError, ValueError, pa.ArrowException, ScenarioError) as error:
        raise RecordError(f"cannot read the run in {directory}: {error}") from error
    return _run_data(directory, scenario, summary, events, columns)


def _is_finished(directory: Path) -> bool:
    """Return whether a run wrote all that it had to; what one without a summary recorded is in its spool."""
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


def _unfinished(directory: Path, scenario: Scenario) -> RunData:
    from gcs_formation.app.recover import recover  # noqa: PLC0415 - few reports need what flies

    found = recover(directory, scenario)
    run = _run_data(directory, scenario, found.summary, found.events, found.columns)
    return replace(run, missing=found.missing)


def _summary(path: Path) -> Mapping[str, Any]:
    summary: Any = json.loads(path.read_text(encoding="utf-8"))
    found: Any = cast("dict[str, Any]", summary).get("schema") if isinstance(summary, dict) else None
    if found != SCHEMA:
        raise ValueError(f"found schema {found} in {path.name}; expected: {SCHEMA}")
    return cast("dict[str, Any]", summary)


def _events(path: Path) -> tuple[Mapping[str, Any], ...]:
    if not path.is_file():
        return ()
    return tuple(json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip())


def _run_data(
    directory: Path,
    scenario: Scenario,
    summary: Mapping[str, Any],
    events: tuple[Mapping[str, Any], ...],
    columns: Mapping[str, Array],
) -> RunData:
    missing = sorted(set(EXPECTED) - set(columns))
    if missing:
        found = f"found no column {missing[0]} in {directory / TIMESERIES}"
        raise RecordError(f"{found}; expected: a record of this version; fly it again: {directory / SCENARIO}")
    vehicles = _vehicles(directory / TIMESERIES, scenario, columns)
    any_vehicle = next(iter(vehicles.values()))
    mission_s, clock_s = any_vehicle["mission_time_s"], any_vehicle["t_s"]
    known = np.flatnonzero(flying(any_vehicle) & np.isfinite(mission_s))
    first, end = (int(known[0]), int(known[-1]) + 1) if known.size else (0, mission_s.size)
    truth = TRUTH[0] in columns
    flown = {v: {name: values[first:end] for name, values in own.items()} for v, own in vehicles.items()}
    return RunData(
        scenario=scenario,
        summary=summary,
        events=events,
        whole=Flight(vehicles, truth),
        flown=Flight(flown, truth),
        clock_s=clock_s,
        zero_s=float(clock_s[first] - (mission_s[first] if known.size else 0.0)),
        begun=bool(known.size),
    )


def _vehicles(path: Path, scenario: Scenario, columns: Mapping[str, Array]) -> dict[VehicleId, Columns]:
    """Return each vehicle's columns: at every tick the file has a row for each, always in the same order."""
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


def _rms(error_m: Array) -> float:
    known = error_m[np.isfinite(error_m).all(axis=1)]
    return float(np.sqrt(np.mean(known**2))) if known.size else WORST_WITHOUT_ERRORS

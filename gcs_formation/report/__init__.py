"""Reads a run back from its directory: a finished one, or an unfinished one without a summary."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa

from airlink.endpoint import VehicleId
from airlink.stream_parser import ParserCounts
from flight_model.arrays import Array
from flight_model.slot import CHANNELS
from formation_scenario import Scenario, ScenarioError, load_scenario
from formation_scenario.bounded_read import require_file
from formation_scenario.extensions import Files, Registry, load_extensions
from formation_scenario.gains import redesigned
from gcs_formation.control.laws import law_kind
from gcs_formation.errors import RecordError
from gcs_formation.record.expectations import RunOutcome
from gcs_formation.record.figures_of_merit import if_finite
from gcs_formation.record.flight import Columns, RecordedFlight, judged, split, tables
from gcs_formation.record.json_shape import (
    INTEGER,
    NUMBER,
    NUMBER_OR_NULL,
    TEXT,
    TEXT_OR_NULL,
    TRUTH_OR_NULL,
    Each,
    Maybe,
    Shape,
    mismatch,
)
from gcs_formation.record.link_verdicts import LinkFigures
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.path_distance import FIGURES
from gcs_formation.record.run_directory import EVENTS, SCENARIO, SPOOL, SUMMARY, TIMESERIES, event_shape
from gcs_formation.record.summary import SCHEMA, summarise
from gcs_formation.record.timeseries import ERROR, GROUND, MEASURED, Spool, flying
from gcs_formation.stability import scenario_delay_margin

Events = tuple[Mapping[str, Any], ...]
LINK_DELAYS = ("delay_s", "up_s", "down_s")
UNKNOWN_IN_LINKS = (
    "injected_delay_ms",
    "injected_up_ms",
    "injected_down_ms",
    "injected_loss",
    "injected_loss_up",
    "measured_loss",
    "frames_in",
    "frames_out",
    "frames_bad",
    "frames_implausible",
    "frames_duplicate",
    "frames_late",
)
UNKNOWN_IN_CONTROL = ("late_ticks", "lateness")
UNKNOWN = (*UNKNOWN_IN_LINKS, *UNKNOWN_IN_CONTROL, "compute_ms", "wall_s", "real_time_factor", "worst_loop_delay_s")
"""Figures that only the process that flew could know."""
NOT_RECORDED = {"value": None, "held": None, "judged": False, "judged_share": 0.0, "reason": "not in the record"}
WORST_WITHOUT_ERRORS = -1.0
NUMBERS = "biuf"
"""Numpy's kinds of numbers and flags."""
EXPECTED = ("network", "vehicle", "phase", *MEASURED, *ERROR, *GROUND)
"""Columns that every time series must have."""
AXIS: Shape = dict.fromkeys(("rms", "max", "steady_max"), NUMBER_OR_NULL)
OFF_PATH: Shape = dict.fromkeys(("rms", "max"), NUMBER_OR_NULL)
SUMMARY_SHAPE: Shape = {
    **dict.fromkeys(("name", "clock"), TEXT),
    **{"seed": INTEGER, "duration_s": NUMBER, "real_time_factor": NUMBER_OR_NULL},
    "followers": Each(
        {
            **dict.fromkeys(ERROR, AXIS),
            **dict.fromkeys(("settled_at_s", "left_at_s"), NUMBER_OR_NULL),
            **dict.fromkeys(("in_slot_share", "followed_share"), Maybe(NUMBER_OR_NULL)),
            "effort": dict.fromkeys(CHANNELS, dict.fromkeys(("variation_per_s", "step_p95"), NUMBER_OR_NULL)),
        }
    ),
    "links": Each(
        {
            **dict.fromkeys(("injected_delay_ms", "injected_up_ms", "injected_down_ms"), NUMBER_OR_NULL),
            **dict.fromkeys(("measured_up_ms", "measured_down_ms"), NUMBER_OR_NULL),
            "measured_delay_ms": dict.fromkeys(("p50", "p99"), NUMBER_OR_NULL),
            **dict.fromkeys(("frames_in", "frames_out", "frames_bad"), NUMBER_OR_NULL),
            **dict.fromkeys(("injected_loss_up", "injected_loss", "measured_loss"), Maybe(NUMBER_OR_NULL)),
        }
    ),
    "control": {
        "rate_hz": NUMBER,
        **dict.fromkeys(("ticks", "late_ticks"), INTEGER),
        "period_ms": dict.fromkeys(("p50", "p99", "max"), NUMBER_OR_NULL),
        "compute_ms": dict.fromkeys(("p50", "p99"), NUMBER_OR_NULL),
        "lateness": Maybe(TEXT_OR_NULL),
    },
    "safety": {
        **{"violations": INTEGER, "fence_m": Maybe(NUMBER_OR_NULL)},
        **dict.fromkeys(("min_separation_m", "min_clearance_m"), NUMBER_OR_NULL),
    },
    "path": Maybe(dict.fromkeys(("leader", "centre"), dict.fromkeys(FIGURES, OFF_PATH))),
    "stability": dict.fromkeys(("delay_margin_s", "worst_loop_delay_s"), NUMBER_OR_NULL),
    "expect": Each(
        {
            **{"metric": TEXT, "value": NUMBER_OR_NULL, "held": TRUTH_OR_NULL, "reason": Maybe(TEXT)},
            "judged_share": Maybe(NUMBER),
            **dict.fromkeys(("from_s", "to_s", "below", "above"), Maybe(NUMBER)),
        }
    ),
    **dict.fromkeys(("undone", "unsafe"), Maybe(Each(TEXT))),
}
"""What a report reads from summary.json (docs/summary.schema.json)."""


@dataclass(frozen=True)
class RunData:
    """A run as its figures need it. `whole` has every tick, `flown` those from the path's start to its end."""

    scenario: Scenario
    summary: Mapping[str, Any]
    events: Events
    whole: RecordedFlight
    flown: RecordedFlight
    zero_s: float
    """The clock's time at mission time 0; at the first tick if the path was never begun."""
    begun: bool
    """Whether the leader ever started along its path. If not, `flown` is everything."""
    missing: tuple[str, ...] = ()
    """What the record of an unfinished run, or of an earlier version, lacks; in words."""

    @property
    def whole_time_s(self) -> Array:
        """(T,) mission times of all ticks, negative before the path."""
        return self.whole.common["t_s"] - self.zero_s

    @property
    def time_s(self) -> Array:
        """(K,) mission times of the flown ticks."""
        return self.flown.common["t_s"] - self.zero_s

    @property
    def scenario_in_force(self) -> Scenario:
        """The scenario with the gains in force at the end: gains by design are redesigned for slow links."""
        return _in_force(self.scenario, self.events)

    @property
    def leader(self) -> VehicleId | None:
        """The vehicle that leads first, None when a virtual leader does."""
        return self.scenario.leader.vehicle_id if self.scenario.leader else None

    @property
    def followers(self) -> tuple[VehicleId, ...]:
        """The followers in the scenario's order; last the leader, if it followed another vehicle for a while."""
        led = (self.leader,) if self.leader is not None and self.flown.has_followed(self.leader) else ()
        return (*(vehicle.vehicle_id for vehicle in self.scenario.followers), *led)

    def worst_first(self) -> list[VehicleId]:
        """Return the followers by decreasing root mean square of their flown errors."""

        def rms(vehicle: VehicleId) -> float:
            known = self.flown.error(vehicle)
            known = known[np.isfinite(known).all(axis=1)]
            return float(np.sqrt(np.mean(known**2))) if known.size else WORST_WITHOUT_ERRORS

        return sorted(self.followers, key=rms, reverse=True)


def load_run(directory: Path, plugins: Files | Registry = ()) -> RunData:
    """Return the run recorded in a directory, whose scenario may name what `plugins` register.

    Raises:
        RecordError: it isn't the directory of a run, nothing was flown, or a file of it can't be read.
    """
    finished = _is_finished(directory)
    try:
        scenario, refused = _scenario(directory / SCENARIO, load_extensions(plugins))
        if not finished:
            run = _unfinished(directory, scenario)
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
    return _run_data(scenario, summary, events, whole, refused)


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


def _run_data(
    scenario: Scenario, summary: Mapping[str, Any], events: Events, whole: RecordedFlight, missing: tuple[str, ...]
) -> RunData:
    mission_s, clock_s = whole.mission_time_s, whole.common["t_s"]
    known = np.flatnonzero(flying(whole.common) & np.isfinite(mission_s))
    first, end = (int(known[0]), int(known[-1]) + 1) if known.size else (0, mission_s.size)
    flown = {v: {name: values[first:end] for name, values in own.items()} for v, own in whole.vehicles.items()}
    zero_s = float(clock_s[first] - (mission_s[first] if known.size else 0.0))
    return RunData(scenario, summary, events, whole, RecordedFlight(flown), zero_s, bool(known.size), missing)


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


def _unfinished(directory: Path, scenario: Scenario) -> RunData:
    """Return what an unfinished run recorded: its spool, its events, and the ground truth if there is any."""
    from gcs_formation.app.run import recorded_truth  # noqa: PLC0415 - few reports need what flies
    from gcs_formation.record.unfinished import recorded_events  # noqa: PLC0415

    events, cut_off = recorded_events(directory)
    columns, truth = Spool(directory / SPOOL).read(), recorded_truth(directory)
    if truth is not None:
        known = columns["t_s"] <= truth.last_s
        columns = {name: values[known] for name, values in columns.items()}
    if not columns["t_s"].size:
        phases = [str(event.get("text")) for event in events if event.get("kind") == "phase"]
        last = f"the last phase of the run was {phases[-1] if phases else 'connecting'}"
        raise RecordError(f"found no control tick in {directory}: {last}, and nothing was flown")
    unknown_s = np.full((columns["t_s"].size // len(scenario.vehicles), 2), np.nan)
    injected_s = {each.vehicle_id: unknown_s for each in scenario.vehicles}
    (whole,) = tables([columns], scenario, None if truth is None else truth.between, injected_s)
    flight = judged(split(whole, scenario), scenario, None if truth is None else truth.between, events)
    summary = _without_unknown(summarise(_outcome(_in_force(scenario, events), flight)).to_dict())
    words = _missing(scenario, flight, events, cut_off=cut_off)
    return _run_data(scenario, summary, events, flight, words)


def _in_force(scenario: Scenario, events: Sequence[Mapping[str, Any]]) -> Scenario:
    delays_s = [event["design_delay_s"] for event in events if event.get("kind") == "design"]
    return redesigned(scenario, delays_s[-1]) if delays_s else scenario


def _outcome(scenario: Scenario, flight: RecordedFlight) -> RunOutcome:
    t_s = flight.common["t_s"]
    none = 0.0 if law_kind(scenario).has_margins else math.nan
    return RunOutcome(
        scenario=scenario,
        clock="unknown",
        flight=flight,
        links={
            identity: LinkFigures(
                delays_s=np.column_stack([own[name] for name in LINK_DELAYS]),
                delay_times_s=own["mission_time_s"],
                measured_loss=0.0,
                frames_in=0,
                frames_out=0,
                frames_bad=0,
            )
            for identity, own in flight.vehicles.items()
        },
        ticks_s=np.array((t_s, t_s, np.full(t_s.shape, np.nan))),
        delay_margin_s=if_finite(scenario_delay_margin(scenario)),
        worst_loop_delay_s=None,
        margin_used=max(float(np.fmax.reduce(own["margin_used"], initial=none)) for own in flight.vehicles.values()),
        received=ParserCounts(),
        frames_refused=0,
        simulated_s=float(t_s[-1]),
        wall_s=0.0,
        cut_short=True,
    )


def _without_unknown(summary: dict[str, Any]) -> dict[str, Any]:
    """Return the summary without the figures that only the process that flew could know."""
    return summary | {
        "version": None,
        "wall_s": None,
        "links": {name: link | dict.fromkeys(UNKNOWN_IN_LINKS) for name, link in summary["links"].items()},
        "received": dict.fromkeys(summary["received"]),
        "control": summary["control"] | dict.fromkeys(UNKNOWN_IN_CONTROL),
        "expect": [
            entry | (NOT_RECORDED if entry["metric"].partition(".")[0] in UNKNOWN else {})
            for entry in summary["expect"]
        ],
    }


def _missing(scenario: Scenario, flight: RecordedFlight, events: Events, *, cut_off: bool) -> tuple[str, ...]:
    failures = [str(event.get("text")) for event in events if event.get("kind") == "failure"]
    why = f"the run failed: {failures[-1]}" if failures else "the run was killed, or it has not ended yet"
    mission_s = float(flight.mission_time_s[-1])
    reached = f"t = {mission_s:.1f} s, of {scenario.duration_s:g} s"
    end = reached if np.isfinite(mission_s) else "a moment of the assembly: t = 0 wasn't reached"
    return (
        f"{SUMMARY}: {why}; what follows is from the record up to then",
        f"whatever came after {end}",
        "what was injected into the links, losses and counts of frames, late ticks, computing times",
        *(() if flight.truth else ("ground truth: errors are from telemetry, as the law saw them",)),
        *(("the end of the last event",) if cut_off else ()),
    )

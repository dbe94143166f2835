"""One flight of a study: a pure function of scenario, seed and version, but for the time that it takes.

And what must be so in every flight, whatever happens to vehicles and links, read off the flight's own record.
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import numpy as np

from airlink import mavlink as m
from airlink.cli import Status
from airlink.clock import Stopwatch
from airlink.frame import StreamParser
from airlink.messages.command import CommandInt
from flight_model.arrays import Array, Mask
from formation_scenario import Scenario, ScenarioError, load_scenario
from formation_scenario import Vehicle as PlannedVehicle
from formation_scenario.expectation import FOLLOWER_METRICS, LINK_METRICS, Expectation
from formation_scenario.load import settings
from gcs_formation.app.operator import Interrupts, RunOptions
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import run
from gcs_formation.errors import RecordError, RecordingError, RunAbortedError
from gcs_formation.link.connection import STALE_AFTER_S
from gcs_formation.record import timeseries
from gcs_formation.record.expectations import figure_of, figure_of_run
from gcs_formation.record.run_directory import EVENTS, SUMMARY, TIMESERIES, TLOG, read_tlog
from gcs_formation.record.summary import Summary
from gcs_formation.record.timeseries import ERROR, TRUTH, flying, read_parquet
from gcs_formation.studies import INVARIANTS, Record, Study
from gcs_formation.studies.plan import Planned
from gcs_formation.studies.random_scenarios import SEVERITIES, draw

VERSION: Final = version("gcs-formation")
REPEATED_EVERY = 10
"""Of flights held against the invariants, one seed in so many is flown again and compared byte for byte."""
LEAST_IS_WORST = ("min_separation_m", "min_clearance_m", "in_slot_share", "delay_margin_s", "left_at_s")
REGAINED_M = 1.0
REGAINED_FOR_S = 10.0
"""At the end every follower has been this near its slot for so long."""
NEAR_END_M = 30.0
"""How near the path's end its leader has come when it is flown."""
ROUNDING = 1e-3
"""Single precision on the wire."""


@dataclass(frozen=True)
class Task:
    """A flight with all that it takes to fly it."""

    planned: Planned
    study: Study
    base: Mapping[Any, Any] | Scenario
    """The scenario, or its keys."""
    directory: str | None = None
    """Where what the study's `record` asks for is kept; None where nothing is."""

    def scenario(self) -> Scenario:
        """Return the flight's scenario.

        Raises:
            ScenarioError: it can't be flown with these parameters.
        """
        seed, study, cases = self.planned.seed, self.study, self.study.cases
        keys = dict(study.set)
        for name, value in self.planned.parameters.items():
            keys |= cases[name][value] if name in cases else {name: value}
        base = self.base if study.random is None else draw(seed, SEVERITIES[study.random])
        if isinstance(base, Scenario) and base.seed == seed and not keys:
            return base
        return load_scenario(base, settings({**keys, "seed": seed}), option="")


def fly(task: Task) -> dict[str, Any]:
    """Fly a task; return its row. Every failure of the flight is a row with its exit status and its words.

    Raises:
        RecordingError: what is to be kept of it can't be written.
    """
    used = Stopwatch()
    values: dict[str, Any] = dict.fromkeys(task.study.measured)
    try:
        summary, wrong = _flown(task)
        values = {metric: _measured(metric, task, summary, wrong) for metric in task.study.measured}
        said = [*wrong, *(str(each) for each in summary.verdicts if each.held is False), *summary.breaches]
        exit_status, words = int(not summary.held or bool(wrong)), "\n".join(said)
    except ScenarioError as error:
        exit_status, words = Status.BAD_USAGE, str(error)
    except RecordingError:
        raise
    except (RecordError, OSError) as error:
        raise RecordingError(str(error)) from error
    except Exception as error:  # noqa: BLE001 - a fault of ours costs its flight alone; the seed finds it again
        values, exit_status = _uncompleted(task), Status.COULD_NOT_GO_ON
        words = str(error) if isinstance(error, RunAbortedError) else f"raised {error!r}"
    return _row(task, values, exit_status, words, used)


def lost(task: Task, words: str) -> dict[str, Any]:
    """Return the row of a flight whose worker died with it."""
    return _row(task, dict.fromkeys(task.study.measured), Status.COULD_NOT_GO_ON, words, None)


def _row(task: Task, values: Mapping[str, Any], exit_status: int, words: str, used: Stopwatch | None) -> dict[str, Any]:
    head = {"flight": task.planned.flight, "seed": task.planned.seed, **task.planned.parameters, **values}
    spent = {"wall_s": used.wall_s if used else None, "cpu_s": used.cpu_s if used else None}
    return {**head, "exit": int(exit_status), **spent, "version": VERSION, "words": words}


def figure(summary: Mapping[str, Any], metric: str) -> float | None:
    """Return a figure of summary.json by the name that `expect` gives it; of several vehicles the worst.

    A figure that any of them lacks, as `settled_at_s` of one that never settles, is None.
    """
    if metric in FOLLOWER_METRICS:
        each = [figure_of(follower, metric) for follower in summary["followers"].values()]
    elif metric in LINK_METRICS:
        each = [figure_of(link, metric) for link in summary["links"].values()]
    else:
        each = [figure_of_run(summary, metric)]
    return worst(metric, each)


def worst(metric: str, each: Sequence[Any]) -> float | None:
    """Return the worst of several vehicles' figures; None if any has none."""
    known = [float(value) for value in each if value is not None]
    if not known or (len(known) < len(each) and metric != "left_at_s"):
        return None
    return min(known) if metric in LEAST_IS_WORST else max(known)


def _measured(metric: str, task: Task, summary: Summary, wrong: list[str]) -> float | None:
    if metric == INVARIANTS:
        return float(len(wrong))
    if not task.study.windowed:
        return figure(summary.figures, metric)
    own = [each for each in summary.measured if each.expectation.metric == metric]
    found = [each.value for each in own if each.reached or each.lost]
    return worst(metric, [value if value is not None and math.isfinite(value) else None for value in found])


def _wanted(task: Task, scenario: Scenario) -> tuple[Expectation, ...]:
    """Return the metrics that are asked of a part of the flight."""
    if not task.study.windowed:
        return ()
    from_s, to_s = task.study.from_s or 0.0, task.study.to_s or task.study.until_s or scenario.duration_s
    named = (metric for metric in task.study.measured if metric != INVARIANTS)
    return tuple(Expectation(metric=metric, from_s=from_s, to_s=to_s) for metric in named)


def _uncompleted(task: Task) -> dict[str, Any]:
    """Return the figures of a flight that had no end: that it has one is an invariant too."""
    return {metric: 1.0 if metric == INVARIANTS else None for metric in task.study.measured}


def _flown(task: Task) -> tuple[Summary, list[str]]:
    """Return a flight's summary, and which invariants it broke where that is measured."""
    scenario, judged = task.scenario(), INVARIANTS in task.study.measured
    kept = Path(task.directory) if task.directory is not None else None
    with tempfile.TemporaryDirectory() as scratch:
        directory = kept if kept is not None and task.study.record in {"full", "series"} else Path(scratch) / "flight"
        record: Record = "full" if judged else task.study.record
        options = RunOptions(directory, "virtual", until_s=task.study.until_s, overwrite=True, record=record)
        options = replace(options, measure=_wanted(task, scenario))
        summary = run(scenario, options, Progress(), Interrupts())
        wrong = broken(read_record(directory, scenario)) if judged else []
        if judged and not wrong and scenario.seed % REPEATED_EVERY == 0:
            again = Path(scratch) / "again"
            run(scenario, replace(options, out=again), Progress(), Interrupts())
            if _digest(directory) != _digest(again):
                wrong = ["repeatable: flown again, the record differs"]
    if task.study.record == "summary" and kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
        text = json.dumps(summary.to_dict(), ensure_ascii=False, allow_nan=False)
        (kept / SUMMARY).write_text(text + "\n", encoding="utf-8")
    return summary, wrong


def _digest(directory: Path) -> str:
    return hashlib.sha256(b"".join((directory / name).read_bytes() for name in (TLOG, TIMESERIES, EVENTS))).hexdigest()


@dataclass(frozen=True)
class FlightRecord:
    """The record of a flight."""

    scenario: Scenario
    summary: Mapping[str, Any]
    events: tuple[Mapping[str, Any], ...]
    columns: Mapping[str, Array]
    """The time series."""
    sent: tuple[tuple[int, CommandInt], ...]
    """Guided commands of the ground station with the system that each was for, as read back from the log."""
    frames: int
    """Frames in the log."""

    def rows(self, vehicle: PlannedVehicle) -> Mapping[str, Array]:
        """Return a vehicle's time series."""
        mine = (self.columns["network"] == vehicle.network) & (self.columns["vehicle"] == vehicle.id)
        return {name: values[mine] for name, values in self.columns.items()}

    @property
    def flying(self) -> Mask:
        """Rows between the path's beginning and the flight's end."""
        return flying(self.columns)

    @property
    def ends_s(self) -> float:
        """Mission time of the flight's end, minus infinity where the path was never begun."""
        return float(self.columns["mission_time_s"][self.flying].max(initial=-np.inf))

    @property
    def at_path_end(self) -> bool:
        """Whether who leads is then at the end of the path: with the wind, that is before the time is over."""
        last = self.flying & (self.columns["leads"] > 0) & (self.columns["mission_time_s"] >= self.ends_s)
        apart_m = [self.columns[name][last] - self.scenario.path.waypoints_m[-1][i] for i, name in enumerate(TRUTH[:2])]
        return bool((np.linalg.norm(apart_m, axis=0) < NEAR_END_M).any())

    def lost_at_s(self, vehicle: PlannedVehicle) -> float:
        """Return when a vehicle crashed, infinity if it didn't."""
        faults = (each for each in self.scenario.faults if each.kind == "crash")
        return min((each.at_s for each in faults if vehicle in self.scenario.selected(each.vehicles)), default=np.inf)


def read_record(directory: Path, scenario: Scenario) -> FlightRecord:
    """Return what a run directory holds."""
    parser, raws = StreamParser(), [raw for _, raw in read_tlog(directory / TLOG)]
    messages = (frame.message for raw in raws for frame in parser.feed(raw))
    lines = (directory / EVENTS).read_text(encoding="utf-8").splitlines()
    return FlightRecord(
        scenario=scenario,
        summary=json.loads((directory / SUMMARY).read_text(encoding="utf-8")),
        events=tuple(json.loads(line) for line in lines),
        columns=read_parquet(directory / TIMESERIES),
        sent=tuple((each.target_system, each) for each in messages if isinstance(each, CommandInt)),
        frames=len(raws),
    )


def broken(flown: FlightRecord) -> list[str]:
    """Return what wasn't so, each in words with its figure."""
    return [text for invariant in HELD_AGAINST for text in invariant(flown)]


def separation(flown: FlightRecord) -> Iterator[str]:
    """No two vehicles that fly come nearer than `safety.separation_m`, from the first take-off to the end."""
    least_m = flown.scenario.safety.separation_m
    for one, other in combinations(flown.scenario.vehicles, 2):
        ours, theirs = flown.rows(one), flown.rows(other)
        apart_m = np.linalg.norm([ours[name] - theirs[name] for name in TRUTH[:3]], axis=0)
        flying = (ours[timeseries.AIRBORNE] > 0) & (theirs[timeseries.AIRBORNE] > 0)
        near = np.where(flying, apart_m, np.inf)
        if near.min(initial=np.inf) < least_m:
            worst = int(near.argmin())
            yield (
                f"separation: vehicles {one.vehicle_id} and {other.vehicle_id} were {near[worst]:.2f} m apart at "
                f"{ours['mission_time_s'][worst]:.1f} s ({timeseries.PHASES[int(ours['phase'][worst])]}); "
                f"allowed: {least_m:g} m or more"
            )


def envelope(flown: FlightRecord) -> Iterator[str]:
    """Every speed on the wire is within the vehicle's limits; every heading and height is a number."""
    models = {vehicle.id: vehicle.model for vehicle in flown.scenario.vehicles}
    for system, command in flown.sent:
        if not all(map(np.isfinite, (command.param1, command.param2, command.param3, command.z))):
            yield f"envelope: vehicle {system} was sent {command}, which isn't finite"
        elif command.command == m.MAV_CMD_GUIDED_CHANGE_SPEED:
            low, high = models[system].speed_min_mps, models[system].speed_max_mps
            if not low - ROUNDING <= command.param2 <= high + ROUNDING:
                yield f"envelope: vehicle {system} was sent {command.param2:.3f} m/s; allowed: {low:g} to {high:g}"
        elif command.command == m.MAV_CMD_GUIDED_CHANGE_HEADING and not 0.0 <= command.param2 <= 360.0:
            yield f"envelope: vehicle {system} was sent heading {command.param2:.3f} degrees; allowed: 0 to 360"


def finite(flown: FlightRecord) -> Iterator[str]:
    """State and setpoint of every vehicle that is commanded are numbers, and so is every true state."""
    for names, rows in (
        ((*timeseries.STATE, *timeseries.SETPOINT), flown.columns["active"]),
        (TRUTH, np.isfinite(flown.columns["t_s"])),
    ):
        for name in names:
            wrong = rows & ~np.isfinite(flown.columns[name])
            if wrong.any():
                first = int(wrong.argmax())
                where = f"vehicle {flown.columns['vehicle'][first]}, t = {flown.columns['t_s'][first]:.1f} s"
                yield f"finite: {name} isn't a number in {int(wrong.sum())} rows, first {where}"


def acknowledged(flown: FlightRecord) -> Iterator[str]:
    """The run came to its end, and every vehicle that is still there acknowledged that it loiters."""
    lost = {str(v.vehicle_id) for v in flown.scenario.vehicles if np.isfinite(flown.lost_at_s(v))}
    for event in flown.events:
        if event["kind"] == "failure" or (event["kind"] == "unacknowledged" and event.get("vehicle") not in lost):
            yield f"acknowledged: {event.get('vehicle', 'the run')}: {event['text']}"


def recorded(flown: FlightRecord) -> Iterator[str]:
    """The log has every frame that was counted, the time series a row for each tick and vehicle, without a gap."""
    links, received = flown.summary["links"].values(), flown.summary["received"]
    taken, sent = (sum(link[count] for link in links) for count in ("frames_in", "frames_out"))
    if lost := received["frames"] - taken - received["frames_refused"]:
        yield f"recorded: {lost} frames more than were taken or refused came in"
    if flown.frames != received["frames"] + sent:
        yield f"recorded: the log has {flown.frames} frames; came in and went out: {received['frames'] + sent}"
    period_s = 1.0 / flown.scenario.law.rate_hz
    for vehicle in flown.scenario.vehicles:
        steps_s = np.diff(flown.rows(vehicle)["t_s"])
        if not np.allclose(steps_s, period_s, atol=1e-6):
            yield f"recorded: vehicle {vehicle.vehicle_id} has ticks {steps_s.max():.3f} s apart, not {period_s:g}"
    if flown.ends_s < flown.scenario.duration_s - 2 * period_s and not flown.at_path_end:
        yield f"recorded: the flight ends at {flown.ends_s:.1f} s of {flown.scenario.duration_s:g}"


def regained(flown: FlightRecord) -> Iterator[str]:
    """When everything has been calm again for a while, every vehicle that doesn't lead is in its slot."""
    for vehicle in flown.scenario.vehicles:
        rows = flown.rows(vehicle)
        late = (rows["mission_time_s"] > flown.ends_s - REGAINED_FOR_S) & (rows["leads"] == 0)
        late &= flying(rows)
        if np.isfinite(flown.lost_at_s(vehicle)) or not late.any() or _held_up(flown, rows):
            continue
        worst_m = max(float(np.abs(rows[name][late]).max()) for name in ERROR)
        if not worst_m < REGAINED_M:
            yield (
                f"regained: vehicle {vehicle.vehicle_id} was {worst_m:.2f} m from its slot in the last "
                f"{REGAINED_FOR_S:g} s; allowed: {REGAINED_M:g} m"
            )


def _held_up(flown: FlightRecord, rows: Mapping[str, Array]) -> bool:
    """Whether a delay of seconds, as in Pareto's tail, reaches beyond the last change of the links into the calm."""
    calm_from_s = max((change.at_s for change in flown.scenario.links.changes), default=0.0)
    there_and_back_s = 2 * rows[timeseries.INJECTED_MEAN]
    under_way = rows["mission_time_s"] + there_and_back_s > calm_from_s
    return bool((under_way & (rows["mission_time_s"] < calm_from_s) & (there_and_back_s > STALE_AFTER_S)).any())


HELD_AGAINST = (separation, envelope, finite, acknowledged, recorded, regained)

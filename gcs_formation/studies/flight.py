"""One flight of a study: a pure function of scenario, seed and version, except for the time it takes."""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from airlink.cli import Status
from airlink.clock import Stopwatch
from airlink.installed import installed_version
from formation_scenario import Scenario, ScenarioError, load_scenario
from formation_scenario.expectation import FOLLOWER_METRICS, LINK_METRICS, METRICS, Expectation
from formation_scenario.named_files import read_path
from formation_scenario.overrides import settings
from formation_scenario.registry import Registry
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.result_text import unjudged
from gcs_formation.app.run import run
from gcs_formation.app.run_options import Record, RunOptions
from gcs_formation.errors import RecordError, RecordingError, RunAbortedError
from gcs_formation.record.expectations import figure_of, figure_of_run
from gcs_formation.record.run_directory import EVENTS, SUMMARY, TIMESERIES, TLOG
from gcs_formation.record.summary import Summary
from gcs_formation.studies import INVARIANTS, Study
from gcs_formation.studies.invariants import broken, read_record
from gcs_formation.studies.plan import Planned
from gcs_formation.studies.random_scenarios import SEVERITIES, draw
from gcs_formation.studies.records import kept_at

VERSION: Final = installed_version()
REPEATED_EVERY = 10
"""If invariants are checked, every flight whose seed is a multiple of this is repeated and compared byte for byte."""
MAX_KNOWN: Final = 16
"""Scenarios that a process keeps for further flights that differ in their seed alone."""
_KNOWN = dict[tuple[str, Registry, tuple[tuple[Path, int, int], ...]], Scenario]()
LOWER_IS_WORSE = ("min_separation_m", "min_clearance_m", "in_slot_share", "delay_margin_s", "left_at_s")


@dataclass(frozen=True)
class Task:
    """A flight with everything that is needed to fly it."""

    planned: Planned
    study: Study
    base: Mapping[Any, Any] | Scenario
    """The scenario, or its keys."""
    directory: str | None = None
    """Where the files that `record` asks for are kept: a directory, or a URL of fsspec; None for nowhere."""

    @property
    def keys(self) -> dict[str, Any]:
        """The scenario's keys that the study and the flight's parameters change, except for the seed."""
        cases, keys = self.study.cases, dict(self.study.set)
        for name, value in self.planned.parameters.items():
            keys |= cases[name][value] if name in cases else {name: value}
        return keys

    def scenario(self) -> Scenario:
        """Return the flight's scenario.

        Raises:
            ScenarioError: it can't be flown with these parameters.
        """
        seed, keys = self.planned.seed, self.keys
        base = (
            self.base if self.study.random is None else draw(seed, SEVERITIES[self.study.random], self.study.registered)
        )
        if isinstance(base, Scenario) and base.seed == seed and not keys:
            return base
        return load_scenario(base, settings({**keys, "seed": seed}), option="", plugins=self.study.registered)


def alike(task: Task) -> Scenario:
    """Return a task's scenario; those of flights that differ in their seed alone share what follows from the rest.

    Raises:
        ScenarioError: it can't be flown with these parameters.
    """
    study = task.study
    if study.random is not None or isinstance(task.base, Scenario):
        return task.scenario()
    # As they are written, 1 and 1.0 aren't equal. A process may fly another study once its files have been changed.
    written = repr((task.base, task.keys)), study.registered, tuple(map(_state_of, study.files))
    if written not in _KNOWN:
        if len(_KNOWN) == MAX_KNOWN:
            _KNOWN.clear()
        _KNOWN[written] = task.scenario()
    return _KNOWN[written].with_seed(task.planned.seed)


def _state_of(file: Path) -> tuple[Path, int, int]:
    """Return where a named file is read, when it was changed and its size; 0 where it isn't there."""
    place = read_path(file)
    found = place.stat() if place.exists() else None
    return (place, 0, 0) if found is None else (place, found.st_mtime_ns, found.st_size)


def fly(task: Task) -> dict[str, Any]:
    """Fly a task; return its row. A flight that fails has a row too, with exit status and words.

    Raises:
        RecordingError: its files can't be written.
    """
    with kept_at(task.directory) as directory:
        return _fly(task, directory)


def _fly(task: Task, kept: Path | None) -> dict[str, Any]:
    used, digest = Stopwatch(), None
    values: dict[str, Any] = dict.fromkeys(task.study.measured)
    try:
        summary, wrong = _flown(task, kept)
        values = {metric: _measured(metric, task, summary, wrong) for metric in task.study.measured}
        same = json.dumps(summary.figures["followers"]).encode()  # the same for flights whose followers flew the same
        digest = hashlib.sha256(same).hexdigest()[:16]
        # Where a random flight ends is chance: a change that it cuts short isn't a failure of its purpose.
        unplanned = summary.figures["undone"] if task.study.random else ()
        broken = [*(str(each) for each in summary.verdicts if each.held is False), *summary.breaches]
        failures = [*wrong, *(each for each in broken if each not in unplanned)]
        exit_status, words = int(bool(failures)), "\n".join([*failures, *unjudged(summary)])
    except ScenarioError as error:
        exit_status, words = Status.BAD_USAGE, str(error)
    except RecordingError:
        raise
    except (RecordError, OSError) as error:
        raise RecordingError(str(error)) from error
    except Exception as error:  # noqa: BLE001 - our fault costs only this flight; the seed reproduces it
        exit_status = Status.COULD_NOT_GO_ON
        # A flight that doesn't end breaks an invariant too.
        values = {metric: 1.0 if metric == INVARIANTS else None for metric in task.study.measured}
        words = str(error) if isinstance(error, RunAbortedError) else f"raised {error!r}"
    return {**_row(task, values, exit_status, words, used), "digest": digest}


def lost(task: Task, words: str) -> dict[str, Any]:
    """Return the row of a flight whose worker died."""
    return _row(task, dict.fromkeys(task.study.measured), Status.COULD_NOT_GO_ON, words, None)


def _row(task: Task, values: Mapping[str, Any], exit_status: int, words: str, used: Stopwatch | None) -> dict[str, Any]:
    head = {"flight": task.planned.flight, "seed": task.planned.seed, **task.planned.parameters, **values}
    spent = {"wall_s": used.wall_s if used else None, "cpu_s": used.cpu_s if used else None}
    return {**head, "exit": int(exit_status), **spent, "version": VERSION, "words": words}


def figure(summary: Mapping[str, Any], metric: str) -> float | None:
    """Return a figure of summary.json by its name in `expect`; the worst one of several vehicles.

    None if any vehicle lacks it, such as `settled_at_s` of one that never settles.
    """
    if metric in FOLLOWER_METRICS:
        each = [figure_of(follower, metric) for follower in summary["followers"].values()]
    elif metric in LINK_METRICS:
        each = [figure_of(link, metric) for link in summary["links"].values()]
    else:
        each = [figure_of_run(summary, metric)]
    return worst(metric, each)


def worst(metric: str, each: Sequence[Any]) -> float | None:
    """Return the worst of several vehicles' figures; None if any has none, except for `left_at_s`."""
    known = [float(value) for value in each if value is not None]
    if not known or (len(known) < len(each) and metric != "left_at_s"):
        return None
    return min(known) if metric in LOWER_IS_WORSE else max(known)


def _measured(metric: str, task: Task, summary: Summary, wrong: list[str]) -> float | None:
    """Return a flight's figure; None if it has none, or if somebody was lost, by no fault or outage of the scenario.

    A loss counts in `in_slot_share` itself. None as well if too little of the window was judged of every vehicle.
    """
    if metric == INVARIANTS:
        return float(len(wrong))
    own = [each for each in summary.measured if each.expectation.metric == metric]
    if metric != "in_slot_share" and any(each.lost and each.judged for each in own):
        return None
    if not task.study.windowed and metric in METRICS:
        return figure(summary.figures, metric)
    if not any(each.judged or each.lost for each in own):
        return None
    stated = [each for each in own if each.judged or each.value is not None]  # not one that led all the time
    found = [each.value for each in stated if each.reached or each.lost]
    return worst(metric, [value if value is not None and math.isfinite(value) else None for value in found])


def _wanted(task: Task, scenario: Scenario) -> tuple[Expectation, ...]:
    """Return the metrics as expectations over the part of the flight over which they are measured."""
    from_s, to_s = task.study.from_s or 0.0, task.study.to_s or task.study.until_s or scenario.duration_s
    named = (metric for metric in task.study.measured if metric != INVARIANTS)
    return tuple(Expectation(metric=metric, from_s=from_s, to_s=to_s) for metric in named)


def _flown(task: Task, kept: Path | None) -> tuple[Summary, list[str]]:
    """Return a flight's summary, and the invariants that it broke if these are measured."""
    scenario, judged = alike(task), INVARIANTS in task.study.measured
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

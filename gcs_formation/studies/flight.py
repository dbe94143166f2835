"""One flight of a study: a pure function of scenario, seed and version, but for the time that it takes."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from formation_scenario import Scenario, ScenarioError, load_scenario
from formation_scenario.expectation import FOLLOWER_METRICS, LINK_METRICS
from formation_scenario.overrides import settings
from gcs_formation.app.interrupt import Interrupts
from gcs_formation.app.options import RunOptions
from gcs_formation.app.progress import Silent
from gcs_formation.app.run import run
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.record.run_directory import SUMMARY
from gcs_formation.record.summary import Summary
from gcs_formation.studies.keys import Record
from gcs_formation.studies.plan import Planned

VERSION: Final = version("gcs-formation")
EXPECTED, BAD_SCENARIO, COULD_NOT_GO_ON = 1, 2, 3
SECTIONS = ("safety", "control", "stability")
LEAST_IS_WORST = ("min_separation_m", "min_clearance_m", "in_slot_share", "delay_margin_s", "left_at_s")


@dataclass(frozen=True)
class Task:
    """A flight with all that it takes to fly it."""

    planned: Planned
    base: Mapping[Any, Any]
    """The scenario's keys."""
    set: Mapping[str, Any]
    metrics: tuple[str, ...]
    record: Record
    directory: str | None
    """Where the record is kept; None where none is."""
    until_s: float | None = None

    def scenario(self) -> Scenario:
        """Return the flight's scenario.

        Raises:
            ScenarioError: it can't be flown with these parameters.
        """
        keys = {**self.set, **self.planned.parameters, "seed": self.planned.seed}
        return load_scenario(self.base, settings(keys), option="")


def fly(task: Task) -> dict[str, Any]:
    """Fly a task; return its row. Every failure of the flight is a row with its exit status and its words."""
    wall, cpu = time.perf_counter(), time.thread_time()
    values: dict[str, Any] = dict.fromkeys(task.metrics)
    try:
        summary = _flown(task)
        values = {metric: figure(summary.figures, metric) for metric in task.metrics}
        exit_status, words = (0, "") if summary.held else (EXPECTED, "; ".join(summary.breaches))
    except ScenarioError as error:
        exit_status, words = BAD_SCENARIO, str(error)
    except (RunAbortedError, RecordError) as error:
        exit_status, words = COULD_NOT_GO_ON, str(error)
    planned = task.planned
    spent = {"wall_s": time.perf_counter() - wall, "cpu_s": time.thread_time() - cpu}
    head = {"flight": planned.flight, "seed": planned.seed, **planned.parameters}
    return {**head, **values, "exit": exit_status, **spent, "version": VERSION, "words": words}


def lost(task: Task, words: str) -> dict[str, Any]:
    """Return the row of a flight whose worker died with it."""
    planned = task.planned
    head = {"flight": planned.flight, "seed": planned.seed, **planned.parameters, **dict.fromkeys(task.metrics)}
    return {**head, "exit": COULD_NOT_GO_ON, "wall_s": None, "cpu_s": None, "version": VERSION, "words": words}


def figure(summary: Mapping[str, Any], metric: str) -> float | None:
    """Return a figure of summary.json by the name that `expect` gives it; of several vehicles the worst.

    A figure that any of them lacks, as `settled_at_s` of one that never settles, is None.
    """
    if metric in FOLLOWER_METRICS:
        each = [_at(follower, metric) for follower in summary["followers"].values()]
    elif metric in LINK_METRICS:
        each = [_at(link, metric) for link in summary["links"].values()]
    else:
        sections = [summary, *(summary[name] for name in SECTIONS)]
        each = [next((_at(one, metric) for one in sections if metric.partition(".")[0] in one), None)]
    known = [float(value) for value in each if value is not None]
    if not known or (len(known) < len(each) and metric != "left_at_s"):
        return None
    return min(known) if metric in LEAST_IS_WORST else max(known)


def _at(figures: Mapping[str, Any], name: str) -> Any:  # noqa: ANN401 - a value of JSON
    value: Any = figures
    for key in name.split("."):
        value = value[key] if value is not None else None
    return value


def _flown(task: Task) -> Summary:
    scenario = task.scenario()
    kept = Path(task.directory) if task.directory is not None else None
    with tempfile.TemporaryDirectory() as scratch:
        whole = kept if task.record in {"full", "series"} else None
        options = RunOptions(
            whole or Path(scratch), "virtual", until_s=task.until_s, overwrite=True, record=task.record
        )
        summary = run(scenario, options, Silent(), Interrupts())
    if task.record == "summary" and kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
        text = json.dumps(summary.to_dict(), ensure_ascii=False, allow_nan=False)
        (kept / SUMMARY).write_text(text + "\n", encoding="utf-8")
    return summary

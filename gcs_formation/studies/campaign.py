"""Flies a study: plans, hands out flights, collects their rows, judges them by its expectations."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import pyarrow as pa
from scipy.stats import beta

from airlink.clock import Stopwatch
from formation_scenario import Problem, ScenarioError
from formation_scenario.source import KeyPath, Plain, Source
from gcs_formation.errors import RecordingError
from gcs_formation.studies.dataset import FLIGHTS, RESULT, TABLE_TEXT, Dataset
from gcs_formation.studies.flight import VERSION, Task
from gcs_formation.studies.keys import Study, Wanted, base_keys, load_study
from gcs_formation.studies.plan import Plan, Planned, Row, Sample, at, count_flights, drawn, keeps, replayed
from gcs_formation.studies.table import sample_table
from gcs_formation.studies.workers import Workers

SCHEMA = 1
MANY = 100_000
"""Flights beyond which a study asks whether that many are meant."""
TABLE_EVERY_S = 10.0
EXTREMES = (0.0, 0.5, 1.0 - 1e-9)


class Verdict(NamedTuple):
    """An expectation and what came of it."""

    wanted: Wanted
    flights: int
    """How many it concerns."""
    kept: int

    @property
    def share(self) -> float | None:
        """The share of the flights that kept the bound."""
        return self.kept / self.flights if self.flights else None

    @property
    def held(self) -> bool:
        """Whether enough did; not where it concerns none."""
        return self.share is not None and self.share >= self.wanted.share

    @property
    def interval(self) -> tuple[float, float]:
        """The confidence interval of the share, by Clopper and Pearson (Biometrika 26, 1934)."""
        return clopper_pearson(self.kept, self.flights, self.wanted.confidence)

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of study.json."""
        low, high = self.interval
        said = self.wanted.model_dump(exclude_none=True)
        found = {"flights": self.flights, "kept": self.kept, "found_share": self.share}
        return {**said, **found, "interval": [low, high], "held": self.held}

    def __str__(self) -> str:
        """Return the verdict in words."""
        bounds = {"below": self.wanted.below, "above": self.wanted.above}
        bound = " and ".join(f"{name} {value:g}" for name, value in bounds.items() if value is not None)
        where = "".join(f", {name} = {value}" for name, value in self.wanted.where.items())
        low, high = self.interval
        found = f"{self.kept} of {self.flights} flights{where}"
        sure = f"({self.wanted.confidence:.0%} confidence: {low:.2%} to {high:.2%})"
        state = "held" if self.held else "broken"
        return f"{self.wanted.metric} {bound}: {found} {sure}; expected: {self.wanted.share:.2%} or more: {state}"


def judge(wanted: Wanted, rows: Sequence[Row]) -> Verdict:
    """Return the verdict on the rows that an expectation concerns."""
    concerned = [row for row in rows if _matches(wanted.where, row)]
    return Verdict(wanted, len(concerned), sum(keeps(wanted, row) for row in concerned))


def clopper_pearson(kept: int, flights: int, confidence: float) -> tuple[float, float]:
    """Return the interval in which a binomial share lies with at least this confidence."""
    if flights == 0:
        return 0.0, 1.0
    outside = (1.0 - confidence) / 2.0
    low = float(beta.ppf(outside, kept, flights - kept + 1)) if kept else 0.0
    high = float(beta.ppf(1.0 - outside, kept + 1, flights - kept)) if kept < flights else 1.0
    return low, high


def _matches(where: Mapping[str, Any], row: Row) -> bool:
    return all(row.get(name) == value for name, value in where.items())


class Shown(Protocol):
    """Shows how far a study is."""

    def say(self, text: str) -> None:
        """Show a line that stays, unless it is empty."""
        ...

    def show(self, done: int, total: int, failed: int) -> None:
        """Show flights done, of how many at most, and how many couldn't be flown."""
        ...


@dataclass(frozen=True)
class Outcome:
    """What came of a study."""

    table: pa.Table
    verdicts: tuple[Verdict, ...]
    figures: Mapping[str, Any]
    """study.json."""
    told: str
    """table.md."""

    @property
    def held(self) -> bool:
        """Whether every expectation was kept."""
        return all(verdict.held for verdict in self.verdicts)


def prepare(source: Path | Mapping[str, Any]) -> tuple[Study, dict[Any, Plain]]:
    """Return a study and its scenario's keys, after trying every parameter's values by themselves.

    Raises:
        ScenarioError: the study is wrong, or no flight of it could be flown as the scenario is.
    """
    study, read = load_study(source)
    base = base_keys(study, read)
    first = next(Plan(study).begin())
    if (wrong := _problem(study, base, first, {})) is not None:
        raise _placed(wrong, study, read)
    for name, parameter in study.parameters.items():
        tried = {str(at(parameter, share)): at(parameter, share) for share in EXTREMES}
        problems = [_problem(study, base, first, {name: value}) for value in tried.values()]
        if all(problems):
            raise _placed(problems[0] or ScenarioError([]), study, read)
    return study, base


def fly_study(
    study: Study, base: Mapping[Any, Plain], out: Path, workers: Workers, shown: Shown, *, resume: bool, overwrite: bool
) -> Outcome:
    """Fly what a study lacks, and judge it.

    Raises:
        RecordError: `out` holds other files or another study, or it can't be written.
        RunAbortedError: no flight can be flown or written down any more; what was is kept.
    """
    spent = Stopwatch()
    with Dataset(out, study, base, resume=resume, overwrite=overwrite) as data:
        plan, written_s = Plan(study), spent.wall_s
        try:
            for row in flights(plan, base, out, workers, shown, data.rows):
                data.add(row)
                if spent.wall_s - written_s > TABLE_EVERY_S:
                    data.write_table()
                    written_s = spent.wall_s
        except BaseException:
            with suppress(RecordingError):
                data.write_table()
            raise
        return _conclude(plan, data, data.write_table(), spent.wall_s)


def flights(
    plan: Plan, base: Mapping[Any, Plain], out: Path | None, workers: Workers, shown: Shown, flown: Mapping[int, Row]
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a study's flights as they end, without those of `flown`; `out` keeps their records.

    Raises:
        RunAbortedError: no flight can be flown any more.
    """
    study, done = plan.study, set(flown)
    tasks = deque(_task(study, base, out, planned) for planned in replayed(plan, flown.values()))
    failed = sum(row["exit"] > 1 for row in flown.values())
    with workers:
        shown.say(workers.where)
        for row in workers.rows(tasks):
            following = plan.after(row)
            if following is not None:
                tasks.append(_task(study, base, out, following))
            done.add(int(row["flight"]))
            failed += row["exit"] > 1
            shown.show(len(done), count_flights(study), failed)
            yield row


def refly_task(planned: Planned, study: Study, base: Mapping[Any, Plain], out: Path) -> Task:
    """Return a flight of a study as a task whose whole record is kept in `out`."""
    return replace(_task(study, base, None, planned), record="full", directory=str(out))


def planned_of(study: Study, row: Row) -> Planned:
    """Return the flight that a row is of."""
    names = [*study.parameters, *([study.bisect.parameter] if study.bisect else [])]
    return Planned(int(row["flight"]), int(row["seed"]), {name: row[name] for name in names if name in row})


def _task(study: Study, base: Mapping[Any, Plain], out: Path | None, planned: Planned) -> Task:
    kept = out is not None and study.record != "none"
    directory = str(out / FLIGHTS / f"{planned.flight:06d}") if out is not None and kept else None
    window = study.from_s, study.to_s
    return Task(
        planned,
        base,
        study.set,
        study.measured,
        study.record,
        directory,
        study.until_s,
        study.random,
        study.cases,
        window,
    )


def _placed(error: ScenarioError, study: Study, read: Source) -> ScenarioError:
    """Return an error of the scenario with the places, in the study's file, of what set the keys that are wrong."""
    set_by: dict[str, KeyPath] = {name: ("set", name) for name in study.set}
    set_by |= {name: ("parameters", name) for name in study.parameters}
    for name, cases in study.cases.items():
        set_by |= {key: ("parameters", name, "cases", case) for case, keys in cases.items() for key in keys}
    if study.bisect is not None:
        set_by[study.bisect.parameter] = ("bisect", "parameter")

    def placed(problem: Problem) -> Problem:
        name = (problem.file or "").partition("=")[0]
        return replace(problem, **read.place(set_by[name])._asdict()) if name in set_by else problem

    return ScenarioError([placed(problem) for problem in error.problems])


def _problem(study: Study, base: Mapping[Any, Plain], first: Planned, tried: Sample) -> ScenarioError | None:
    sample: dict[str, Any] = {**drawn(study, 0), **first.parameters, **tried}
    try:
        _task(study, base, None, first._replace(parameters=sample)).scenario()
    except ScenarioError as error:
        return error
    return None


def _conclude(plan: Plan, data: Dataset, made: pa.Table, wall_s: float) -> Outcome:
    study, rows = plan.study, [data.rows[flight] for flight in sorted(data.rows)]
    verdicts = tuple(judge(wanted, rows) for wanted in study.expect)
    exits = {str(status): sum(row["exit"] == status for row in rows) for status in range(4)}
    figures: dict[str, Any] = {
        "schema": SCHEMA,
        "name": study.name,
        "version": VERSION,
        "flights": len(rows),
        "exits": exits,
        "wall_s": wall_s,
        "flights_wall_s": sum(row["wall_s"] or 0.0 for row in rows),
        "flights_cpu_s": sum(row["cpu_s"] or 0.0 for row in rows),
        "expect": [verdict.to_dict() for verdict in verdicts],
    }
    if study.bisect is not None:
        figures["bisect"] = [
            {"seed": first.seed, **first.parameters, study.bisect.parameter: None, **crossing._asdict()}
            for first, crossing in plan.crossings()
        ]
    told = sample_table(study, rows, plan.crossings())
    try:
        (data.path / TABLE_TEXT).write_text(told + "\n", encoding="utf-8")
        (data.path / RESULT).write_text(json.dumps(figures, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"cannot write {data.path / RESULT}: {error.strerror or error}") from error
    return Outcome(made, verdicts, figures, told)

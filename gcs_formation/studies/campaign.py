"""Flies a study: plans it, distributes its flights, collects their rows, shows progress, judges expectations."""

from __future__ import annotations

import json
import sys
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeAlias

import click
import numpy as np
import pyarrow as pa
from rich.console import Console
from rich.live import Live
from rich.text import Text

from airlink.cli import counted
from airlink.clock import Stopwatch
from formation_scenario.expectation import bounds_text
from formation_scenario.source import Plain
from gcs_formation.errors import RecordingError
from gcs_formation.studies import Study, Wanted
from gcs_formation.studies.cluster import Workers
from gcs_formation.studies.dataset import FLIGHTS, RESULT, TABLE_TEXT, Dataset
from gcs_formation.studies.flight import VERSION, Task
from gcs_formation.studies.intervals import Chance, by_cluster, clusters_of, share_interval
from gcs_formation.studies.plan import (
    Plan,
    Planned,
    Row,
    concerns,
    count_flights,
    keeps,
    replayed,
)
from gcs_formation.studies.records import require_url
from gcs_formation.studies.sample_table import sample_table

Base: TypeAlias = Mapping[Any, Plain]
"""A scenario's keys."""
TENTHS = 10
SHOWN_EVERY_S = 0.5
SCHEMA = 1
TABLE_EVERY_S = 10.0


class StudyProgress:
    """Shows flights done, their rate, the remaining time, and failures."""

    def __init__(self, *, quiet: bool, tell: Callable[[int, int], None] | None = None) -> None:
        """Show them on standard error unless `quiet`; `tell` is called with flights done, and at most to be done."""
        self._quiet, self._tell = quiet, tell
        self._live: Live | None = None
        if sys.stderr.isatty() and not quiet:
            self._live = Live(console=Console(stderr=True), transient=True, auto_refresh=False)
            self._live.start()
        self._spent, self._shown_s = Stopwatch(), 0.0
        self._first: int | None = None
        self._tenths = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def say(self, text: str) -> None:
        """Print a line, unless it is empty."""
        if text and not self._quiet:
            click.echo(text, err=True)

    def show(self, done: int, total: int, failed: int) -> None:
        """Show the progress; `total` is the largest possible number of flights."""
        if self._tell is not None:
            self._tell(done, total)
        spent_s = self._spent.wall_s
        self._first = done - 1 if self._first is None else self._first
        text = progress_text(done, total, failed, (done - self._first) / max(spent_s, 1e-6))
        if self._live is None:
            tenths = done * TENTHS // total
            self.say(text if tenths > self._tenths else "")
            self._tenths = max(tenths, self._tenths)
        elif spent_s - self._shown_s > SHOWN_EVERY_S or done == total:
            self._shown_s = spent_s
            self._live.update(Text(text, no_wrap=True, overflow="ellipsis"), refresh=True)


def progress_text(done: int, total: int, failed: int, rate_hz: float) -> str:
    """Return the progress in words."""
    left_s = (total - done) / rate_hz
    failures = f"  {failed} failed" if failed else ""
    return f"{done} of {counted(total, 'flight')}  {rate_hz:.2g}/s  {_time(left_s)} left{failures}"


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


class Verdict(NamedTuple):
    """An expectation and its result."""

    wanted: Wanted
    flights: int
    """Number of flights that it applies to."""
    kept: int
    chance: Chance
    """What is random in these flights."""
    clusters: tuple[tuple[int, int], ...]
    """How many flights of each cluster kept it, and how many it has."""

    @property
    def share(self) -> float | None:
        """The share of the flights that kept the bound."""
        return self.kept / self.flights if self.flights else None

    @property
    def held(self) -> bool:
        """Whether enough flights kept the bound; False if it applies to none."""
        return self.share is not None and self.share >= self.wanted.share

    @property
    def interval(self) -> tuple[float, float] | None:
        """Confidence interval of the share, by clusters of flights; None if the share is exact."""
        return None if self.chance.exact else share_interval(self.clusters, self.wanted.confidence)

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of study.json."""
        wanted = self.wanted.model_dump(exclude_none=True)
        found = {"flights": self.flights, "kept": self.kept, "found_share": self.share}
        clustered = {"by": self.chance.unit, "clusters": len(self.clusters), "method": self.chance.words}
        interval = {"interval": self.interval and list(self.interval), "interval_of": clustered}
        return {**wanted, **found, **interval, "held": self.held}

    def __str__(self) -> str:
        bound = bounds_text(self.wanted.below, self.wanted.above)
        where = "".join(f", {name} = {value}" for name, value in self.wanted.where.items())
        found = f"{self.kept} of {counted(self.flights, 'flight')}{where}"
        sure = f"(no interval: {self.chance.exact})"
        if self.interval is not None:
            by = counted(len(self.clusters), self.chance.unit)
            sure = "({:.0%} confidence, by {}: {:.2%} to {:.2%})".format(self.wanted.confidence, by, *self.interval)
        state = "held" if self.held else "broken"
        return f"{self.wanted.metric} {bound}: {found} {sure}; expected: {self.wanted.share:.2%} or more: {state}"


def judge(study: Study, wanted: Wanted, rows: Sequence[Row]) -> Verdict:
    """Return the verdict on the rows that an expectation applies to."""
    concerned = [row for row in rows if concerns(wanted, row)]
    kept = np.array([keeps(wanted, row) for row in concerned], dtype=np.bool_)
    clusters = tuple(by_cluster(kept, clusters_of(study, concerned)))
    return Verdict(wanted, len(concerned), int(kept.sum()), Chance.of(study, concerned), clusters)


@dataclass(frozen=True)
class StudyOutcome:
    """The result of a study."""

    table: pa.Table
    verdicts: tuple[Verdict, ...]
    figures: Mapping[str, Any]
    """Content of study.json."""
    text: str
    """Content of table.md."""

    @property
    def held(self) -> bool:
        """Whether every flight was flown, and the study's expectations held or, without any, the flights' own."""
        return not self.unflown and not self.broken and all(verdict.held for verdict in self.verdicts)

    @property
    def broken(self) -> Sequence[Row]:
        """Flights that broke their own scenario's expectations or limits; empty if the study has expectations.

        Empty for a search too, which flies beyond its bound on purpose.
        """
        return () if self.verdicts or "bisect" in self.figures else self._ended(1)

    @property
    def unflown(self) -> Sequence[Row]:
        """Flights that couldn't be flown, or not to their end."""
        return self._ended(2, 3)

    def _ended(self, *statuses: int) -> Sequence[Row]:
        """Return the flights that ended with one of these exit statuses."""
        rows: Sequence[Row] = self.table.select(["flight", "exit", "words"]).to_pylist()
        return [row for row in rows if row["exit"] in statuses]

    @property
    def uncrossed(self) -> int:
        """Number of searches whose bound was broken at the low end already, or kept even at the high end."""
        return sum(None in (entry["kept"], entry["broken"]) for entry in self.figures.get("bisect", ()))


def fly_study(
    study: Study,
    base: Base,
    out: Path,
    workers: Workers,
    shown: StudyProgress,
    *,
    resume: bool,
    overwrite: bool,
    records: str | None = None,
) -> StudyOutcome:
    """Fly the flights that are missing in `out`, and judge the study; `records` is a URL for their records.

    Raises:
        ScenarioError: `records` is no URL of a known kind.
        RecordError: `out` holds other files or another study, or it can't be written.
        RunAbortedError: no further flight can be flown or written; what was written is kept.
    """
    spent, location = Stopwatch(), str(out / FLIGHTS)
    if records is not None:
        require_url(records, study.record)
        location = records.rstrip("/")
    with Dataset(out, study, base, resume=resume, overwrite=overwrite) as data:
        plan, written_s = Plan(study), spent.wall_s
        try:
            for row in flights(plan, base, location, workers, shown, data.rows):
                data.add(row)
                if spent.wall_s - written_s > TABLE_EVERY_S:
                    data.write_table()
                    written_s = spent.wall_s
        except BaseException:
            with suppress(RecordingError):
                data.write_table()
            raise
        return _conclude(plan, data, data.write_table(), spent.wall_s, records)


def flights(
    plan: Plan, base: Base, records: str | None, workers: Workers, shown: StudyProgress, flown: Mapping[int, Row]
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a study's flights as they end, except those in `flown`.

    `records` is the directory, or the URL, below which their records are kept.

    Raises:
        RunAbortedError: no flight can be flown any more.
    """
    study, done = plan.study, set(flown)
    kept = records if study.record != "none" else None

    def task(planned: Planned) -> Task:
        return Task(planned, study, base, None if kept is None else f"{kept}/{planned.flight:06d}")

    tasks = deque(map(task, replayed(plan, flown.values())))
    failed = sum(row["exit"] > 1 for row in flown.values())
    with workers:
        shown.say(workers.where)
        for row in workers.rows(tasks):
            if (following := plan.after(row)) is not None:
                tasks.append(task(following))
            done.add(int(row["flight"]))
            failed += row["exit"] > 1
            shown.show(len(done), count_flights(study), failed)
            yield row


def _conclude(plan: Plan, data: Dataset, made: pa.Table, wall_s: float, records: str | None) -> StudyOutcome:
    study, rows = plan.study, [data.rows[flight] for flight in sorted(data.rows)]
    verdicts = tuple(judge(study, wanted, rows) for wanted in study.expect)
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
    if records is not None:
        figures["records"] = records
    if study.registered:
        figures["extensions"] = [each.to_dict() for each in study.registered]
    if study.bisect is not None:
        figures["bisect"] = [
            {"seed": first.seed, **{name: first.parameters[name] for name in study.parameters}, **crossing._asdict()}
            for first, crossing in plan.crossings()
        ]
    text = sample_table(study, rows, plan.crossings())
    try:
        (data.path / TABLE_TEXT).write_text(text + "\n", encoding="utf-8")
        (data.path / RESULT).write_text(json.dumps(figures, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"cannot write {data.path / RESULT}: {error.strerror or error}") from error
    return StudyOutcome(made, verdicts, figures, text)

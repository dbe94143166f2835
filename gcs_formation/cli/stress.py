"""`gcs-formation stress`: a study of scenarios that are drawn from their seeds, measured by what they broke."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from airlink.cli.arguments import OUT, SEED, WholeNumber
from airlink.cli.directory import refusal
from airlink.cli.interruption import raised
from airlink.cli.status import Status, fail, say
from gcs_formation.cli import usage
from gcs_formation.errors import RunAbortedError
from gcs_formation.studies.campaign import flights, refly_task
from gcs_formation.studies.flight import fly
from gcs_formation.studies.keys import INVARIANTS, Study
from gcs_formation.studies.plan import Plan
from gcs_formation.studies.progress import StudyProgress
from gcs_formation.studies.workers import Processes

Row = dict[str, Any]


@click.command(epilog=usage.STRESS)
@click.option("--count", type=WholeNumber(1), default=100, show_default=True, help="How many flights.")
@click.option("--seed", type=SEED, default=1, show_default=True, help="Seed of the first; then one more.")
@click.option("--jobs", type=WholeNumber(1), default=os.cpu_count() or 1, help="Flights at a time; default: cores.")
@click.option("--hard", is_flag=True, help="Longer trouble, faster flights, stronger wind: three times the time.")
@click.option("--out", type=OUT, help="Keep the record of the one flight here (--count 1).")
@click.option("--overwrite", is_flag=True, help="Replace an earlier run in --out.")
def stress(count: int, seed: int, jobs: int, hard: bool, out: Path | None, overwrite: bool) -> None:
    """Fly seeded random scenarios under the virtual clock and look for what must never be.

    Each seed is a short flight with random shape, path, rates, links, wind, disturbances and faults. Its record is held
    against invariants: separation, envelope, finite values, acknowledged state, complete record, formation regained;
    every tenth is flown twice and compared byte for byte. A broken one is named with its seed; exit status 1.
    """
    if out is not None:
        _refuse(out, count, overwrite=overwrite)
    plan = Plan(_study(count, seed, hard=hard))
    try:
        with raised(), StudyProgress(quiet=not sys.stderr.isatty()) as progress:
            rows = flights(plan, {}, None, Processes(min(jobs, count)), progress, {})
            wrong = _told(_alone(plan, out) if out else rows, "stress --hard" if hard else "stress")
    except RunAbortedError as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    except KeyboardInterrupt:
        sys.exit(say("interrupted", Status.INTERRUPTED))
    click.echo(f"{count} flights, seeds {seed} to {seed + count - 1}: {wrong or 'none'} broke an invariant")
    sys.exit(Status.EXPECTATION_BROKEN if wrong else Status.FINE)


def _study(count: int, seed: int, *, hard: bool) -> Study:
    keys = {"random": "hard" if hard else "usual", "seeds": {"first": seed, "count": count}, "metrics": [INVARIANTS]}
    return Study.model_validate({**keys, "name": "stress", "record": "none"})


def _alone(plan: Plan, out: Path) -> Iterable[Row]:
    """Yield the one flight, its record kept."""
    yield fly(refly_task(next(plan.begin()), plan.study, {}, out))


def _told(rows: Iterable[Row], command: str) -> int:
    """Name what each flight broke; return how many broke something.

    Raises:
        RunAbortedError: a flight couldn't be flown, through no fault of its own.
    """
    wrong = 0
    for row in rows:
        if row[INVARIANTS] is None:
            raise RunAbortedError(f"seed {row['seed']}: {row['words']}")
        wrong += row[INVARIANTS] > 0
        completed = row["exit"] <= Status.EXPECTATION_BROKEN
        for text in row["words"].splitlines() if row[INVARIANTS] else ():
            click.echo(f"seed {row['seed']}: {'' if completed else 'completed: '}{text}", err=True)
            click.echo(f"  again: gcs-formation {command} --count 1 --seed {row['seed']} --out DIR", err=True)
    return wrong


def _refuse(out: Path, count: int, *, overwrite: bool) -> None:
    """Refuse a directory that can't be written, or one for many flights."""
    if count != 1:
        fail(f"--out: found --count {count}; allowed: --count 1, whose record it keeps")
    try:
        refused = refusal(out, overwrite=overwrite)
        if refused is None:
            out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        refused = f"cannot write {out}: {error.strerror}; allowed: a directory that can be written"
    if refused is not None:
        fail(refused)

"""`gcs-formation stress`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from airlink.cli.arguments import OUT, SEED, WholeNumber
from airlink.cli.status import Status, fail
from gcs_formation.cli import usage
from gcs_formation.errors import RecordError
from gcs_formation.stress.campaign import fly_seed, fly_seeds
from gcs_formation.stress.scenarios import HARD, USUAL


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
    if out is not None and count != 1:
        fail(f"--out: found --count {count}; allowed: --count 1, whose record it keeps")
    severity, again = (HARD, "stress --hard") if hard else (USUAL, "stress")
    alone = (fly_seed(seed, each, severity, overwrite=overwrite) for each in ([out] if out else []))
    trials = alone if out else fly_seeds(seed, count, min(jobs, count), severity)
    flown, wrong = 0, 0
    try:
        for trial in trials:
            flown += 1
            wrong += bool(trial.broken)
            for text in trial.broken:
                click.echo(f"seed {trial.seed}: {text}", err=True)
                click.echo(f"  again: gcs-formation {again} --count 1 --seed {trial.seed} --out DIR", err=True)
    except RecordError as error:
        fail(str(error))
    click.echo(f"{flown} flights, seeds {seed} to {seed + count - 1}: {wrong or 'none'} broke an invariant")
    sys.exit(Status.EXPECTATION_BROKEN if wrong else Status.FINE)

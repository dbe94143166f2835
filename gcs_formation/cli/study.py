"""`gcs-formation study`."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import click

from airlink.cli.arguments import OUT, WholeNumber
from airlink.cli.interruption import raised
from airlink.cli.status import Status, fail, say
from formation_scenario import ScenarioError
from gcs_formation.cli import usage
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.studies.campaign import MANY, Outcome, fly_study, planned_of, prepare, refly_task
from gcs_formation.studies.dataset import read_journal, read_plan
from gcs_formation.studies.flight import fly
from gcs_formation.studies.keys import Study
from gcs_formation.studies.plan import count_flights
from gcs_formation.studies.progress import StudyProgress
from gcs_formation.studies.workers import Cluster, Processes


class _FlyOrStudy(click.Group):
    """A group whose first argument may be a study file instead of a command."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the arguments name; a study file is flown."""
        return super().resolve_command(ctx, args if args[0] in self.commands else ["run", *args])


@click.group(cls=_FlyOrStudy, epilog=usage.STUDY, subcommand_metavar="STUDY --out DIR | fly DIR FLIGHT")
def study() -> None:
    """Fly one scenario many times, over parameters and seeds. `study STUDY --help` lists the options."""


@study.command(hidden=True, epilog=usage.STUDY)
@click.argument("study", type=click.Path(path_type=Path))
@click.option("--out", type=OUT, required=True, help="The study's directory.")
@click.option("--workers", type=WholeNumber(1), default=os.cpu_count() or 1, help="Local processes; default: cores.")
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Fly on the cluster of this Dask scheduler instead.")
@click.option("--resume", is_flag=True, help="Fly what an interrupted study in --out lacks.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier study in --out.")
@click.option("--yes", is_flag=True, help=f"More than {MANY:,} flights are meant.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
def run(study: Path, **given: Any) -> None:
    """Fly STUDY, a YAML file (docs/studies.md); write flights.parquet and study.json to --out."""
    try:
        planned, base = prepare(study)
    except ScenarioError as error:
        fail(str(error))
    _refuse_too_many(planned, yes=given["yes"])
    sys.exit(_fly(planned, base, **given))


@study.command(name="fly", epilog=usage.STUDY)
@click.argument("directory", type=click.Path(path_type=Path))
@click.argument("flight", type=WholeNumber(0))
@click.option("--out", type=OUT, help="Run directory; default: DIRECTORY/again/FLIGHT.")
def fly_again(directory: Path, flight: int, out: Path | None) -> None:
    """Fly one FLIGHT of the study in DIRECTORY again, with its whole record."""
    try:
        plan = read_plan(directory)
        rows = {int(row["flight"]): row for row in read_journal(directory)}
    except RecordError as error:
        fail(str(error))
    if flight not in rows:
        fail(f"found no flight {flight} in {directory}; allowed: {min(rows, default=0)} to {max(rows, default=0)}")
    study = Study.model_validate(plan["study"])
    kept = out or directory / "again" / f"{flight:06d}"
    row = fly(refly_task(planned_of(study, rows[flight]), study, plan["base"], kept))
    if row["exit"] > Status.EXPECTATION_BROKEN:
        fail(row["words"], Status(row["exit"]))
    for name in study.measured:
        click.echo(f"{name}: {row[name]}")
    click.echo(f"recorded in {kept}")
    sys.exit(row["exit"])


def _refuse_too_many(planned: Study, *, yes: bool) -> None:
    count = count_flights(planned)
    if count > MANY and not yes:
        fail(f"found {count:,} flights; allowed: up to {MANY:,}, or --yes if that many are meant")


def _fly(planned: Study, base: dict[Any, Any], **given: Any) -> Status:
    workers = Cluster(given["scheduler"]) if given["scheduler"] else Processes(given["workers"])
    out, again = given["out"], "--resume goes on with it"
    progress = StudyProgress(quiet=given["quiet"])
    try:
        with raised(), progress:
            outcome = fly_study(
                planned, base, out, workers, progress, resume=given["resume"], overwrite=given["overwrite"]
            )
    except KeyboardInterrupt:
        return say(f"interrupted; what was flown is in {out}; {again}", Status.INTERRUPTED)
    except RecordError as error:
        return say(str(error), Status.BAD_USAGE)
    except RunAbortedError as error:
        return say(f"{error}; what was flown is in {out}; {again}", Status.COULD_NOT_GO_ON)
    return _conclude(outcome, out, quiet=given["quiet"])


def _conclude(outcome: Outcome, out: Path, *, quiet: bool) -> Status:
    figures = outcome.figures
    if not quiet:
        exits = figures["exits"]
        failed = exits["2"] + exits["3"]
        spent = f"{figures['wall_s']:.0f} s, {figures['flights_cpu_s']:.0f} s of processor time in flights"
        click.echo(f"{figures['flights']} flights in {spent}; {failed or 'none'} couldn't be flown")
        for verdict in outcome.verdicts:
            click.echo(str(verdict))
        click.echo(f"flights.parquet and study.json are in {out}")
    for verdict in outcome.verdicts:
        if quiet and not verdict.held:
            click.echo(str(verdict), err=True)
    return Status.FINE if outcome.held else Status.EXPECTATION_BROKEN

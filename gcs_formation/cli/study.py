"""`gcs-formation study`, `stress` and `compare`: many flights."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import click

from airlink.cli import SECONDS, SEED, Status, WholeNumber, WithDefault, counted, examples, fail, interruptible, say
from airlink.cli.output_directory import OUT, default_directory, refusal
from formation_scenario import ScenarioError
from formation_scenario.registry import load_extensions
from gcs_formation.cli import OVERRIDES, PLUGINS
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.studies import INVARIANTS, Study
from gcs_formation.studies.campaign import StudyOutcome, StudyProgress, flights, fly_study
from gcs_formation.studies.cluster import Cluster
from gcs_formation.studies.dataset import AGAIN, read_journal, read_plan, read_rows, read_study
from gcs_formation.studies.flight import fly
from gcs_formation.studies.plan import Plan, Planned
from gcs_formation.studies.preparation import MANY, prepare, refly_task
from gcs_formation.studies.workers import Processes

STUDY_EXAMPLES = examples(
    "gcs-formation study delay-by-loss.yaml --out studies/delay-by-loss",
    "gcs-formation study delay-by-loss.yaml --out studies/delay-by-loss --resume",
    "gcs-formation study delay-by-loss.yaml --out studies/cluster --scheduler tcp://10.0.0.1:8786",
    "gcs-formation study fly studies/delay-by-loss 17      that flight again, with its whole record",
)
STRESS_EXAMPLES = examples(
    "gcs-formation stress --count 100",
    "gcs-formation stress --hard --count 200",
    "gcs-formation stress --count 1 --seed 17 --out runs/seed-17",
)
COMPARE_EXAMPLES = examples(
    "gcs-formation compare paper.yaml --laws pid,fuzzy_pid,consensus --from 500 --jobs 2 --out runs/laws",
    "gcs-formation compare quickstart.yaml --laws fuzzy_pid,fuzzy_pid_uncompensated --set links.default.delay_ms=300",
)

Row = dict[str, Any]
MAX_LINES = 60
"""Longest table that is printed, in lines."""


def _address(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    if value is not None and re.fullmatch(r"(\w+://)?[^/\s]+:\d+", value) is None:
        raise click.BadParameter(f"found '{value}'; allowed: tcp://HOST:PORT", ctx, param)
    return value


@click.group(
    cls=WithDefault, default="run", epilog=STUDY_EXAMPLES, subcommand_metavar="STUDY --out DIR | fly DIR FLIGHT"
)
def study() -> None:
    """Fly one scenario many times, over parameters and seeds: STUDY is a YAML file (docs/studies.md)."""


@study.command(hidden=True, epilog=STUDY_EXAMPLES)
@click.argument("study", type=click.Path(path_type=Path))
@click.option("--out", type=OUT, required=True, help="The study's directory.")
@click.option("--workers", type=WholeNumber(1), default=os.cpu_count() or 1, help="Local processes; default: cores.")
@click.option("--scheduler", callback=_address, metavar="tcp://HOST:PORT", help="Fly on this Dask cluster instead.")
@click.option("--records", metavar="URL", help="Keep flights' records there, as s3://BUCKET/PATH, not in --out.")
@click.option("--resume", is_flag=True, help="Fly what an interrupted study in --out lacks.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier study in --out.")
@PLUGINS
@click.option("--yes", is_flag=True, help=f"Allow more than {MANY:,} flights.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
def run(study: Path, **given: Any) -> None:
    """Fly STUDY, a YAML file (docs/studies.md); write flights.parquet and study.json to --out."""
    workers = Cluster(given["scheduler"]) if given["scheduler"] else Processes(given["workers"])
    out, again, kind = (
        given["out"],
        "--resume goes on with it",
        {key: given[key] for key in ("resume", "overwrite", "records")},
    )
    try:
        planned, base = prepare(study, many=given["yes"], plugins=given["plugins"])
        with interruptible(), StudyProgress(quiet=given["quiet"]) as progress:
            outcome = fly_study(planned, base, out, workers, progress, **kind)
    except KeyboardInterrupt:
        fail(f"interrupted; what was flown is in {out}; {again}", Status.INTERRUPTED)
    except (ScenarioError, RecordError) as error:
        fail(str(error))
    except RunAbortedError as error:
        kept = f"what was flown is in {out}; {again}" if next(read_journal(out), None) else "nothing was flown"
        fail(f"{error}; {kept}", Status.COULD_NOT_GO_ON)
    sys.exit(_conclude(outcome, out, quiet=given["quiet"]))


@study.command(name="fly", epilog=STUDY_EXAMPLES)
@click.argument("directory", type=click.Path(path_type=Path))
@click.argument("flight", type=WholeNumber(0))
@click.option("--out", type=OUT, help="Run directory; default: DIRECTORY/again/FLIGHT, replaced.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier run in --out.")
@PLUGINS
def fly_again(directory: Path, flight: int, out: Path | None, overwrite: bool, plugins: tuple[str, ...]) -> None:
    """Fly one FLIGHT of the study in DIRECTORY again, with its whole record."""
    try:
        study, base = read_study(directory).with_registered(load_extensions(plugins)), read_plan(directory)["base"]
        rows = {row["flight"]: row for row in read_rows(directory, study)}
    except (RecordError, ScenarioError) as error:
        fail(str(error))
    if flight not in rows:
        fail(f"found no flight {flight} in {directory}; allowed: {min(rows, default=0)} to {max(rows, default=0)}")
    if out is not None and (refused := refusal(out, overwrite=overwrite)) is not None:
        fail(refused)
    kept, row = out or directory / AGAIN / f"{flight:06d}", rows[flight]
    planned = Planned(flight, int(row["seed"]), {name: row[name] for name in study.columns if name in row})
    try:
        row = fly(refly_task(planned, study, base, kept))
    except RunAbortedError as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    if row["exit"] > Status.EXPECTATION_BROKEN:
        fail(row["words"], Status(row["exit"]))
    for name in study.measured:
        click.echo(f"{name}: {row[name]}")
    click.echo(f"recorded in {kept}")
    sys.exit(row["exit"])


def _conclude(outcome: StudyOutcome, out: Path, *, quiet: bool) -> Status:
    for text in () if quiet else _result_lines(outcome, out):
        click.echo(text)
    for verdict in outcome.verdicts:
        if not verdict.held:
            click.echo(str(verdict), err=True)
    count = outcome.figures["flights"]
    for failed, what in (
        (outcome.unflown, "couldn't be flown to their end"),
        (outcome.broken, "broke an expectation or a safety limit of their own, and the study has no expect"),
    ):
        if failed:
            why = f"flight {failed[0]['flight']}: {failed[0]['words']}"
            click.echo(f"{len(failed)} of {counted(count, 'flight')} {what}; the first, {why}", err=True)
    if len(outcome.unflown) == count:
        return Status.COULD_NOT_GO_ON
    return Status.FINE if outcome.held else Status.EXPECTATION_BROKEN


def _result_lines(outcome: StudyOutcome, out: Path) -> Iterator[str]:
    """Yield the lines printed at a study's end: its table, its cost, its verdicts."""
    figures = outcome.figures
    if outcome.text.count("\n") < MAX_LINES:
        yield outcome.text
    spent = f"{figures['wall_s']:.0f} s, {figures['flights_cpu_s']:.0f} s of processor time in flights"
    broke = figures["exits"]["1"]
    own = f"; {broke} broke an expectation or a safety limit of the scenario" if broke else ""
    yield f"{counted(figures['flights'], 'flight')} in {spent}{own}"
    if outcome.uncrossed:
        searches = counted(len(figures["bisect"]), "search", "es")
        yield f"{outcome.uncrossed} of {searches} found no crossing: broken at the low end, or kept at the high one"
    yield from map(str, outcome.verdicts)
    yield f"flights.parquet, table.md and study.json are in {out}; figures: gcs-formation report {out}"


@click.command(epilog=STRESS_EXAMPLES)
@click.option("--count", type=WholeNumber(1), default=100, show_default=True, help="How many flights.")
@click.option("--seed", type=SEED, default=1, show_default=True, help="Seed of the first; then one more.")
@click.option("--jobs", type=WholeNumber(1), default=os.cpu_count() or 1, help="Flights at a time; default: cores.")
@click.option("--telemetry", is_flag=True, help="faults of telemetry in place of others and of outages")
@click.option("--hard", is_flag=True, help="Longer trouble, faster flights, stronger wind: three times the time.")
@click.option("--out", type=OUT, help="Keep the record of the one flight here (--count 1).")
@click.option("--overwrite", is_flag=True, help="Replace an earlier run in --out.")
@PLUGINS
def stress(
    count: int,
    seed: int,
    jobs: int,
    hard: bool,
    telemetry: bool,
    out: Path | None,
    overwrite: bool,
    plugins: tuple[str, ...],
) -> None:
    """Fly seeded random scenarios under the virtual clock and check invariants.

    Each seed is a short flight with random shape, path, rates, links, wind, disturbances and faults. Its record must
    keep the invariants: separation, envelope, finite values, acknowledged state, complete record, formation regained.
    Every tenth is flown twice and compared byte for byte. A broken invariant is named with its seed; exit status 1.
    Faults that a --plugin registers are drawn like ours, with the defaults of their keys.
    """
    if out is not None and count != 1:
        fail(f"--out: found --count {count}; allowed: --count 1, whose record it keeps")
    try:
        if out is not None and (refused := refusal(out, overwrite=overwrite)) is not None:
            fail(refused)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fail(f"cannot write {out}: {error.strerror}; allowed: a directory that can be written")
    if hard and telemetry:
        fail("--telemetry: found --hard too; allowed: one of them")
    severity, named = "usual", "".join(f" --plugin {file}" for file in plugins)
    if hard or telemetry:
        severity = "hard" if hard else "telemetry"
    plan = _stress_plan(severity, seed, count, plugins)
    try:
        with interruptible(), StudyProgress(quiet=False) as progress:
            rows: Iterable[Row] = flights(plan, {}, None, Processes(min(jobs, count)), progress, {})
            if out is not None:  # the one flight, its record kept
                rows = [fly(refly_task(next(plan.first_flights()), plan.study, {}, out))]
            wrong = _name_broken(rows, f"stress{'' if severity == 'usual' else f' --{severity}'}{named}")
    except RunAbortedError as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    except KeyboardInterrupt:
        sys.exit(say("interrupted", Status.INTERRUPTED))
    seeds = f"seed {seed}" if count == 1 else f"seeds {seed} to {seed + count - 1}"
    click.echo(f"{counted(count, 'flight')}, {seeds}: {wrong or 'none'} broke an invariant")
    sys.exit(Status.EXPECTATION_BROKEN if wrong else Status.FINE)


def _stress_plan(severity: str, seed: int, count: int, plugins: tuple[str, ...]) -> Plan:
    keys = {"name": "stress", "random": severity, "seeds": {"first": seed, "count": count}}
    study = Study.model_validate({**keys, "metrics": [INVARIANTS], "record": "none"})
    try:
        return Plan(study.with_registered(load_extensions(plugins)))
    except ScenarioError as error:
        fail(str(error))


def _name_broken(rows: Iterable[Row], command: str) -> int:
    """Print what each flight broke; return how many broke something. RunAbortedError: one couldn't be flown."""
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


@click.command(epilog=COMPARE_EXAMPLES)
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--laws", default="pid,fuzzy_pid,consensus", show_default=True, help="Names, with commas between.")
@click.option("--from", "from_s", type=SECONDS, default=0.0, metavar="SECONDS", help="Errors count from…")
@click.option("--to", "to_s", type=SECONDS, metavar="SECONDS", help="… to; default: the end.")
@click.option("--until", "until_s", type=SECONDS, metavar="SECONDS", help="End the flights at this time.")
@click.option("--seed", type=SEED, help="Instead of the scenario's.")
@OVERRIDES
@PLUGINS
@click.option("--jobs", type=WholeNumber(1), default=1, show_default=True, help="Flights at a time.")
@click.option("--out", type=OUT, help="Directory of it all; default: runs/NAME-TIME.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier comparison in --out.")
@click.option("--json", "as_json", is_flag=True, help="The figures alone on standard output, as JSON.")
def compare(scenario: Path, seed: int | None, out: Path | None, as_json: bool, **given: Any) -> None:
    """Fly SCENARIO by each of several laws, on one seed under the virtual clock, and set them side by side.

    Laws: pid, fuzzy_pid (tables as printed), fuzzy_pid_symmetric, consensus and those of --plugin, each also as
    NAME_uncompensated, without prediction over the delay. --out gets a run directory for each law, comparison.json,
    .png and .html.
    """
    from gcs_formation.studies.compare import compare_laws, comparison_text  # noqa: PLC0415 - only `compare` needs it

    overrides = (*given.pop("overrides"), *(() if seed is None else (f"seed={seed}",)))
    directory, workers = out or default_directory(f"{scenario.stem}-laws"), Processes(given.pop("jobs"))
    between_s = given.pop("from_s"), given.pop("to_s")
    try:
        registry = load_extensions(given.pop("plugins"))
        flown = compare_laws(scenario, overrides, directory, workers, between_s=between_s, registry=registry, **given)
    except (ScenarioError, RecordError) as error:
        fail(str(error))
    except RunAbortedError as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    comparison, outcomes, page, interrupted = flown
    if as_json:
        click.echo(json.dumps(comparison, indent=2))
    click.echo(f"{comparison_text(comparison)}\nwrote {page}", err=as_json)
    broken, stopped = (
        [f"{law}: {text}" for law, status, words in outcomes if status == wanted for text in words.splitlines()]
        for wanted in (Status.EXPECTATION_BROKEN, Status.COULD_NOT_GO_ON)
    )
    for text in (*broken, *stopped):
        click.echo(text, err=True)
    if interrupted:
        sys.exit(say("interrupted; the laws whose flights were over are compared", Status.INTERRUPTED))
    sys.exit(Status.COULD_NOT_GO_ON if stopped else Status.EXPECTATION_BROKEN if broken else Status.FINE)

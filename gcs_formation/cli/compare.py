"""`gcs-formation compare`: one scenario by several laws."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from airlink.cli.commands import OUT, SECONDS, SEED, WholeNumber, examples
from airlink.cli.exit_status import Status, fail, say
from airlink.cli.output_directory import default_directory
from formation_scenario import ScenarioError
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.studies.compare import Compared, CompareOptions, compare_laws
from gcs_formation.studies.workers import Processes

EXAMPLES = examples(
    "gcs-formation compare paper.yaml --laws pid,fuzzy_pid,consensus --from 500 --jobs 2 --out runs/laws",
    "gcs-formation compare quickstart.yaml --laws fuzzy_pid,fuzzy_pid_uncompensated --set links.default.delay_ms=300",
)


@click.command(epilog=EXAMPLES)
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--laws", default="pid,fuzzy_pid,consensus", show_default=True, help="Names, with commas between.")
@click.option("--from", "from_s", type=SECONDS, default=0.0, metavar="SECONDS", help="Errors count from…")
@click.option("--to", "to_s", type=SECONDS, metavar="SECONDS", help="… to; default: the end.")
@click.option("--until", "until_s", type=SECONDS, metavar="SECONDS", help="End the flights at this time.")
@click.option("--seed", type=SEED, help="Instead of the scenario's.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key (repeatable).")
@click.option("--jobs", type=WholeNumber(1), default=1, show_default=True, help="Flights at a time.")
@click.option("--out", type=OUT, help="Directory of it all; default: runs/NAME-TIME.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier comparison in --out.")
@click.option("--json", "as_json", is_flag=True, help="The figures alone on standard output, as JSON.")
def compare(
    seed: int | None, overrides: tuple[str, ...], out: Path | None, jobs: int, as_json: bool, **given: Any
) -> None:
    """Fly SCENARIO by each of several laws, on one seed under the virtual clock, and set them side by side.

    Laws: pid, fuzzy_pid (tables as printed), fuzzy_pid_symmetric and consensus, each also as NAME_uncompensated,
    without prediction over the delay. --out gets a run directory for each law, comparison.json, .png and .html.
    """
    given["overrides"] = (*overrides, *(() if seed is None else (f"seed={seed}",)))
    given["out"] = out or default_directory(f"{Path(given['scenario']).stem}-laws")
    try:
        compared = compare_laws(CompareOptions(**given), Processes(jobs))
    except (ScenarioError, RecordError) as error:
        fail(str(error))
    except RunAbortedError as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    if as_json:
        click.echo(compared.json)
    click.echo(compared.text, err=as_json)
    sys.exit(_status(compared))


def _status(compared: Compared) -> Status:
    """Say what each law broke and which could not go on; return the gravest status."""
    for text in (*compared.broken(), *compared.stopped()):
        click.echo(text, err=True)
    if compared.interrupted:
        return say("interrupted; the laws whose flights were over are compared", Status.INTERRUPTED)
    if compared.stopped():
        return Status.COULD_NOT_GO_ON
    return Status.EXPECTATION_BROKEN if compared.broken() else Status.FINE

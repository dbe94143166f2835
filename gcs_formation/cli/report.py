"""`gcs-formation report`."""

from __future__ import annotations

from pathlib import Path

import click

from airlink.cli.commands import examples, fail
from gcs_formation.errors import RecordError
from gcs_formation.report import write_report
from gcs_formation.studies.report import is_study, write_study_report

EXAMPLES = examples("gcs-formation report runs/quickstart      writes runs/quickstart/report.html")


@click.command(epilog=EXAMPLES)
@click.argument("run_dir", type=click.Path(path_type=Path))
def report(run_dir: Path) -> None:
    """Draw the figures of a run or a study, and one self-contained report.html; of a killed one, what there is."""
    try:
        if is_study(run_dir):
            page = write_study_report(run_dir)
        else:
            page = write_report(run_dir, lambda text: click.echo(f"missing: {text}", err=True))
    except RecordError as error:
        fail(str(error))
    click.echo(f"wrote {page}")

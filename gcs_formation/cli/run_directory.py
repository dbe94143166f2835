"""`gcs-formation tell` and `report`: a run's directory while it flies, and afterwards."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import click

from airlink.cli.commands import examples
from airlink.cli.exit_status import Status, fail
from formation_scenario.orders import OrderError, parse_order
from gcs_formation.app.order_socket import STATUS
from gcs_formation.app.order_socket import tell as give_order
from gcs_formation.errors import NothingRunningError, RecordError

TELL_USAGE = (
    examples(
        "gcs-formation tell runs/quickstart status",
        "gcs-formation tell runs/quickstart shape line",
        "gcs-formation tell runs/quickstart leader 2",
    )
    + """

\b
Orders:
  shape NAME [SPACING_M]   fly another shape
  spacing SPACING_M        fly the same shape wider or closer
  speed MPS                fly the path at another speed
  heading DEG              multirotors that stand: turn on the spot
  leader ID                let another vehicle lead
  loiter | rtl | land      end the flight: circle here, at home, or land there

\b
Or:
  status                   a page on phase, vehicles, errors, delays and margins

Exit status 1: refused, with the reason. 3: no flight answers there.
"""
)
REPORT_EXAMPLES = examples("gcs-formation report runs/quickstart      writes runs/quickstart/report.html")


@click.command(epilog=TELL_USAGE)
@click.argument("run_dir", type=click.Path(path_type=Path))
@click.argument("order", nargs=-1, required=True)
def tell(run_dir: Path, order: tuple[str, ...]) -> None:
    """Give the flight that records into RUN_DIR an ORDER, and print what came of it; `status`: ask how it is."""
    text = " ".join(order)
    try:
        if text == STATUS:
            text = f"{STATUS} {shutil.get_terminal_size().columns}"
        else:
            parse_order(text)
        answer = give_order(run_dir, text)
    except OrderError as error:
        fail(str(error))
    except NothingRunningError as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    click.echo(answer.text, err=not answer.accepted)
    sys.exit(Status.FINE if answer.accepted else Status.EXPECTATION_BROKEN)


@click.command(epilog=REPORT_EXAMPLES)
@click.argument("run_dir", type=click.Path(path_type=Path))
def report(run_dir: Path) -> None:
    """Draw the figures of a run or a study, and one self-contained report.html; of a killed one, what there is."""
    from gcs_formation.report.page import write_report  # noqa: PLC0415 - an order waits for no figures
    from gcs_formation.studies.report import is_study, write_study_report  # noqa: PLC0415

    try:
        if is_study(run_dir):
            page = write_study_report(run_dir)
        else:
            page = write_report(run_dir, lambda text: click.echo(f"missing: {text}", err=True))
    except RecordError as error:
        fail(str(error))
    click.echo(f"wrote {page}")

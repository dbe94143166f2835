"""`gcs-formation tell`."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import click

from airlink.cli.commands import Status, examples, fail
from formation_scenario.orders import OrderError, parse_order
from gcs_formation.app.order_socket import STATUS
from gcs_formation.app.order_socket import tell as give_order
from gcs_formation.errors import NothingRunningError

USAGE = (
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


@click.command(epilog=USAGE)
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

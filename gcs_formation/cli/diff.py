"""The command `diff`: what differs first between two runs."""

from __future__ import annotations

import json
import sys
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path

import click

from airlink.cli import Number, Status, examples, fail
from gcs_formation.cli import PLUGINS
from gcs_formation.errors import RecordError

DIFF_EXAMPLES = examples(
    "gcs-formation diff runs/monday runs/tuesday                   every byte, tick and figure",
    "gcs-formation diff runs/base runs/change --tolerance 0.01     numbers alone, to 0.01 of their unit",
    "gcs-formation diff runs/1 runs/2 --ignore 'run.yaml: seed'    two seeds: what else differs",
)


@click.command(epilog=DIFF_EXAMPLES)
@click.argument("one", type=click.Path(path_type=Path))
@click.argument("other", type=click.Path(path_type=Path))
@click.option(
    "--tolerance",
    type=Number(0.0),
    help="Numbers may differ by this much, in their own unit; bytes and events then don't count.",
)
@click.option(
    "--ignore",
    multiple=True,
    metavar="PATTERN",
    help="Leave out what a line begins with (repeatable; * and ? as in a shell), such as 'summary.json: links*'.",
)
@click.option("--lines", type=click.IntRange(min=1), default=20, show_default=True, help="Show at most so many.")
@click.option("--json", "as_json", is_flag=True, help="All differences as JSON.")
@PLUGINS
def diff(
    one: Path,
    other: Path,
    tolerance: float | None,
    ignore: tuple[str, ...],
    lines: int,
    as_json: bool,
    plugins: tuple[str, ...],
) -> None:
    """Say what differs first between the runs in ONE and OTHER, and where. Exit status 0: nothing, 1: something.

    Versions and keys come first, then what happened, by time, then figures. Figures of the machine's speed don't count.
    """
    del plugins  # what was flown with them is compared as it was recorded
    from gcs_formation.diff.runs import differences  # noqa: PLC0415 - reading records is needed by this command alone

    try:
        every = differences(one, other, tolerance)
        found = [each for each in every if not any(fnmatchcase(str(each), f"{pattern}*") for pattern in ignore)]
    except RecordError as error:
        fail(str(error))
    if as_json:
        rows = [
            {"part": each.part, "place": each.location, "t_s": each.t_s, "one": each.one, "other": each.other}
            for each in found
        ]
        click.echo(json.dumps(rows, indent=1, default=str))
    else:
        for each in islice(found, lines):
            click.echo(str(each))
        if len(found) > lines:
            click.echo(f"… and {len(found) - lines} more (--lines)")
        if not found:
            click.echo("no difference" if tolerance is None else f"no difference beyond {tolerance:g}")
    sys.exit(Status.EXPECTATION_BROKEN if found else Status.FINE)

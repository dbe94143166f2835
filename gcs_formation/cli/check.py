"""`gcs-formation check`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from gcs_formation.app.check import check_report, check_text
from gcs_formation.cli import usage
from gcs_formation.cli.status import load


@click.command(epilog=usage.CHECK)
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key (repeatable).")
@click.option("--json", "as_json", is_flag=True, help="Margins and warnings as JSON.")
def check(scenario: Path, overrides: tuple[str, ...], as_json: bool) -> None:
    """Validate SCENARIO; print it resolved, its communication graph and its delay margins. Starts nothing."""
    loaded = load(scenario, overrides)
    click.echo(json.dumps(check_report(loaded), indent=2) if as_json else check_text(loaded))

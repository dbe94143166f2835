"""`gcs-formation check`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from airlink.cli.status import fail
from formation_scenario import ScenarioError, load_scenario
from gcs_formation.app.check import check_report, check_text, refusal_report
from gcs_formation.cli import usage


@click.command(epilog=usage.CHECK)
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key (repeatable).")
@click.option("--json", "as_json", is_flag=True, help="Margins and warnings, or what is wrong, as JSON.")
def check(scenario: Path, overrides: tuple[str, ...], as_json: bool) -> None:
    """Validate SCENARIO; print it resolved, its communication graph and its delay margins. Starts nothing."""
    try:
        loaded = load_scenario(scenario, overrides)
    except ScenarioError as error:
        if as_json:
            click.echo(json.dumps(refusal_report(error), indent=2))
        fail(str(error))
    click.echo(json.dumps(check_report(loaded), indent=2) if as_json else check_text(loaded))

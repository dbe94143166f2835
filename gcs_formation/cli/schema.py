"""`gcs-formation schema`."""

from __future__ import annotations

import json

import click

from formation_scenario.reference import scenario_reference
from formation_scenario.schema import scenario_schema
from gcs_formation.cli import usage


@click.command(epilog=usage.SCHEMA)
@click.option("--markdown", is_flag=True, help="The reference of all keys instead, for people.")
def schema(markdown: bool) -> None:
    """Print the JSON schema of scenarios, for editors and validators."""
    text = scenario_reference() if markdown else json.dumps(scenario_schema(), indent=1, ensure_ascii=False) + "\n"
    click.echo(text, nl=False)

"""`gcs-formation schema`."""

from __future__ import annotations

import json

import click

from formation_scenario.reference import scenario_reference
from formation_scenario.schema import scenario_schema
from gcs_formation.cli import usage
from gcs_formation.studies.keys import study_schema


@click.command(epilog=usage.SCHEMA)
@click.option("--study", is_flag=True, help="Of study files instead.")
@click.option("--markdown", is_flag=True, help="The reference of all keys instead, for people.")
def schema(study: bool, markdown: bool) -> None:
    """Print the JSON schema of scenarios, for editors and validators."""
    if study:
        click.echo(json.dumps(study_schema(), indent=1, ensure_ascii=False))
        return
    text = scenario_reference() if markdown else json.dumps(scenario_schema(), indent=1, ensure_ascii=False) + "\n"
    click.echo(text, nl=False)

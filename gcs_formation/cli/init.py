"""`gcs-formation init`."""

from __future__ import annotations

from pathlib import Path

import click

from airlink.cli.status import fail
from gcs_formation.app.init import example_names, write_example
from gcs_formation.cli import usage
from gcs_formation.cli.scenario import load
from gcs_formation.errors import ExampleError


@click.command(epilog=usage.INIT)
@click.argument("directory", type=click.Path(path_type=Path), default=Path())
@click.option("--example", type=click.Choice(example_names()), default="quickstart", show_default=True)
def init(directory: Path, example: str) -> None:
    """Write an example scenario into DIRECTORY (default: here) to begin with. Overwrites nothing."""
    try:
        path = write_example(example, directory)
    except ExampleError as error:
        fail(str(error))
    emulated = all(vehicle.autopilot == "emulator" for vehicle in load(path, ()).vehicles)
    click.echo(
        f"wrote {path}; next:\n  gcs-formation check {path}\n  gcs-formation {'run' if emulated else 'fly'} {path}"
    )

"""The command line: `gcs-formation init | check | run | fly | tell | report | compare | stress`."""

from __future__ import annotations

from importlib import import_module
from typing import NamedTuple

import click

from gcs_formation.cli import usage


class _Entry(NamedTuple):
    module: str
    summary: str


COMMANDS = {
    "check": _Entry("check", "Validate a scenario; print its graph and its delay margins."),
    "compare": _Entry("compare", "Fly a scenario by several laws and set them side by side."),
    "fly": _Entry("flight", "Fly a scenario with vehicles that are up already."),
    "init": _Entry("init", "Write an example scenario to begin with."),
    "report": _Entry("report", "Draw the figures and the page of a finished run."),
    "run": _Entry("flight", "Fly a scenario with emulated vehicles."),
    "stress": _Entry("stress", "Fly random scenarios and look for what must never be."),
    "tell": _Entry("tell", "Give a flight under way an order."),
}
"""Where each command is, and what the list of them says of it."""


class _ImportedWhenChosen(click.Group):
    """Imports a command's module when the command is chosen: none pays for what another needs."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names."""
        return sorted([*super().list_commands(ctx), *COMMANDS])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command by its name, None for one that isn't there."""
        if cmd_name not in COMMANDS:
            return super().get_command(ctx, cmd_name)
        return getattr(import_module(f"{__name__}.{COMMANDS[cmd_name].module}"), cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list without importing what's in it."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name].summary) for name in self.list_commands(ctx)])


@click.group(cls=_ImportedWhenChosen, context_settings={"help_option_names": ["-h", "--help"]}, epilog=usage.ALL)
@click.version_option(package_name="gcs-formation")
def main() -> None:
    """Fly formations over MAVLink."""

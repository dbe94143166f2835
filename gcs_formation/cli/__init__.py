"""The command `gcs-formation` and its subcommands, each imported when it is used."""

from __future__ import annotations

import click

from airlink.cli import ImportedWhenChosen, examples, version_option

EXAMPLES = examples(
    "gcs-formation init                                           writes quickstart.yaml",
    "gcs-formation check quickstart.yaml",
    "gcs-formation run quickstart.yaml --speedup 5 --out runs/quickstart",
    "gcs-formation run quickstart.yaml --clock virtual --set links.default.delay_ms=300",
    "gcs-formation tell runs/quickstart shape line                to a flight under way",
    "gcs-formation report runs/quickstart",
    "gcs-formation view runs/quickstart                           replays it in a browser",
    "gcs-formation compare quickstart.yaml --laws pid,fuzzy_pid   on one seed, side by side",
)

COMMANDS = {
    "check": ("gcs_formation.cli.no_flight", "Validate a scenario; print its graph and its delay margins."),
    "compare": ("gcs_formation.cli.study", "Fly a scenario by several laws and set them side by side."),
    "diff": ("gcs_formation.cli.diff", "Say what differs first between two runs."),
    "fly": ("gcs_formation.cli.run_and_fly", "Fly a scenario with vehicles that are up already."),
    "identify": ("gcs_formation.cli.identify", "Find a vehicle's model from a flight; write a vehicle file."),
    "init": ("gcs_formation.cli.no_flight", "Write an example scenario to begin with."),
    "link": ("gcs_formation.cli.link", "Measure links without a flight, and say what they carry."),
    "logs": ("gcs_formation.cli.logs", "Fetch the autopilots' own logs after a flight."),
    "report": ("gcs_formation.cli.no_flight", "Draw the figures and the page of a finished run."),
    "run": ("gcs_formation.cli.run_and_fly", "Fly a scenario with emulated vehicles."),
    "schema": ("gcs_formation.cli.no_flight", "Print the JSON schema of scenarios, or the reference of their keys."),
    "signing": ("gcs_formation.cli.signing", "Keys of signed links: write one, give it to vehicles."),
    "stress": ("gcs_formation.cli.study", "Fly random scenarios and check invariants."),
    "study": ("gcs_formation.cli.study", "Fly one scenario many times, over parameters and seeds."),
    "tell": ("gcs_formation.cli.no_flight", "Give a flight under way an order."),
    "view": ("gcs_formation.cli.view", "Show a flight in a browser: a run's, or a MAVLink log's."),
}
OVERRIDES = click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key (repeatable).")
"""The option of all commands that read a scenario."""
PLUGINS = click.option(
    "--plugin",
    "plugins",
    multiple=True,
    type=click.Path(),
    metavar="FILE.py",
    help="Load laws, filters, … of one's own (repeatable).",
)
"""The option of all commands that read a scenario, a study or a run."""


@click.group(
    cls=ImportedWhenChosen, entries=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXAMPLES
)
@version_option()
def main() -> None:
    """Fly formations over MAVLink."""

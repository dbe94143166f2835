"""The command line: `sim-vehicles SCENARIO`, `sim-vehicles --count N` or `sim-vehicles sins SCENARIO`."""

from __future__ import annotations

import click

from airlink.cli import VERSION, ImportedWhenChosen, examples

EXAMPLES = examples(
    "sim-vehicles configs/quickstart.yaml        the vehicles of a scenario, at its endpoints",
    "sim-vehicles --count 4 --base-port 14551    vehicle i has system id i and sends to port 14550 + i",
    "sim-vehicles --count 20 --one-port          all of them to port 14550",
    "sim-vehicles sins configs/sins.yaml         inertial navigation: alignment, then flight",
    "sim-vehicles fly --help                     every option",
)
COMMANDS = {
    "fly": ("sim_vehicles.cli.fly", "Fly emulated vehicles: those of a scenario, or a number of them."),
    "sins": ("sim_vehicles.inertial.command", "Align and navigate by inertial sensors alone."),
}


class _FlyByDefault(ImportedWhenChosen):
    """A group whose plain call, with a scenario or with options alone, flies vehicles."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        own = {"-h", "--help", "--version"}
        if not args or args[0] not in (*self.list_commands(ctx), *own):
            args = ["fly", *args]
        return super().parse_args(ctx, args)


@click.group(
    cls=_FlyByDefault, entries=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXAMPLES
)
@click.version_option(package_name="gcs-formation", message=VERSION)
def main() -> None:
    """Emulated ArduPlanes that speak MAVLink over UDP.

    Give a scenario, or a number of vehicles; `fly` may be left out.
    """

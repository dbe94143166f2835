"""The command line: `sim-vehicles SCENARIO`, `sim-vehicles --count N` or `sim-vehicles sins SCENARIO`."""

from __future__ import annotations

import click

from airlink.cli import ImportedWhenChosen, examples, version_option

EXAMPLES = examples(
    "sim-vehicles configs/quickstart.yaml        the vehicles of a scenario, at its endpoints",
    "sim-vehicles mixed.yaml --vehicles 1,2      two of them: the others fly elsewhere",
    "sim-vehicles --count 4 --base-port 14551    vehicle i has system id i and sends to port 14550 + i",
    "sim-vehicles --count 20 --one-port          all of them to port 14550",
    "sim-vehicles sins configs/sins.yaml         inertial navigation: alignment, then flight",
    "sim-vehicles fly --help                     every option",
)
COMMANDS = {
    "fly": ("sim_vehicles.cli.fly", "Fly emulated vehicles: those of a scenario, or a number of them."),
    "sins": ("sim_vehicles.inertial.command", "Align and navigate by inertial sensors alone."),
}


@click.group(
    cls=ImportedWhenChosen,
    entries=COMMANDS,
    default="fly",
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=EXAMPLES,
)
@version_option()
def main() -> None:
    """Emulated ArduPlanes, ArduCopters and PX4s that speak MAVLink over UDP.

    Give a scenario, or a number of vehicles; `fly` may be left out.
    """

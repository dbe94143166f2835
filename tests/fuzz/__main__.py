"""Hostile bytes for both ends: `python -m tests.fuzz --datagrams 1000000`, `python -m tests.fuzz --guided station`."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from tests.fuzz.guided import Target

OURS = ["airlink", "gcs_formation", "sim_vehicles"]


@click.command()
@click.option("--datagrams", type=click.IntRange(1), default=100_000, help="In all, shared out evenly.")
@click.option("--each-turn", type=click.IntRange(1, 1000), default=200, help="Every 20 ms of flight.")
@click.option("--seed", type=click.IntRange(0), default=1)
@click.option("--guided", type=click.Choice(["parser", "station", "vehicles"]), help="Fuzz this, led by its coverage.")
@click.option("--seconds", type=click.IntRange(1), default=600, help="Guided: how long.")
@click.option(
    "--corpus", type=click.Path(path_type=Path), default=Path("runs/fuzz"), help="Guided: where inputs are kept."
)
@click.argument("inputs", nargs=-1, type=click.Path(exists=True, path_type=Path))
def main(
    datagrams: int,
    each_turn: int,
    seed: int,
    guided: Target | None,
    seconds: int,
    corpus: Path,
    inputs: tuple[Path, ...],
) -> None:
    """Throw DATAGRAMS at flights of 60 s under the virtual clock; an exception or a broken limit ends it.

    Targets are the ground station or the vehicles. Datagrams are noise, damaged frames and strangers' frames, from
    thousands of addresses ("strangers": the flight's setpoints must equal those of an undisturbed flight, to the bit),
    also from its peers' own addresses ("own"), or with frames forged in its peers' names ("forged").

    With --guided, atheris (the extra `fuzz`) searches inputs that reach new code; INPUTS are tried again.
    """
    if guided is None:
        from tests.fuzz.thrown import throw  # noqa: PLC0415 - not before it is known whether it's to be instrumented

        click.echo(throw(datagrams, each_turn, seed))
        return
    atheris: Any = importlib.import_module("atheris")
    with atheris.instrument_imports(include=OURS):
        from tests.fuzz.guided import fuzz  # noqa: PLC0415 - so that what it imports is instrumented
    fuzz(guided, seconds, corpus / guided, inputs)


if __name__ == "__main__":
    main()

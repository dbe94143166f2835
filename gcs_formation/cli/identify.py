"""`gcs-formation identify`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from airlink.cli.commands import OUT, Number, WholeNumber, examples
from airlink.cli.exit_status import Status, fail, say
from airlink.cli.output_directory import default_directory
from formation_scenario import Scenario, ScenarioError
from gcs_formation.app.fly import fly
from gcs_formation.app.operator import ClockName, Interrupts, RunOptions
from gcs_formation.app.progress import Progress, progress_on
from gcs_formation.app.run import run
from gcs_formation.cli.scenario import load
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.identify import command
from gcs_formation.identify.command import identification_scenario

EXAMPLES = examples(
    "gcs-formation identify arduplane.yaml --out skywalker.yaml   flies steps, then fits",
    "gcs-formation identify runs/flown --vehicle 2                from what was recorded",
    "gcs-formation identify 00000042.BIN --out skywalker.yaml     an ArduPilot log, or a .tlog",
)

EMULATOR = "emulator"
VEHICLE_FILE = "vehicle.yaml"
LOGS = (".tlog", ".bin")


@click.command(epilog=EXAMPLES)
@click.argument("source", type=click.Path(path_type=Path, exists=True))
@click.option("--out", type=click.Path(path_type=Path), help=f"Vehicle file; default: {VEHICLE_FILE} in the run.")
@click.option("--run-dir", type=OUT, help="Where the flight is recorded; default: runs/NAME-TIME.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier run in --run-dir.")
@click.option("--vehicle", type=WholeNumber(1), help="Of this system id alone; default: all, as of one kind.")
@click.option("--speedup", type=Number(0.01, 1000), default=1.0, help="Of simulated autopilots that fly the steps.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key (repeatable).")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
@click.option("--json", "as_json", is_flag=True, help="The result alone on standard output.")
def identify(
    source: Path,
    out: Path | None,
    run_dir: Path | None,
    vehicle: int | None,
    overrides: tuple[str, ...],
    quiet: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """Find a vehicle's model from SOURCE: a run, a .tlog or .bin; or a scenario, whose vehicles then fly steps."""
    recorded, believed = source, None
    if not source.is_dir() and source.suffix.lower() not in LOGS:
        believed = load(source, overrides)
        recorded = run_dir or default_directory(f"{believed.name}-identify")
        try:
            options = RunOptions(recorded, _clock(believed), **given)
        except ValueError as error:
            fail(str(error))
        _fly(believed, options, quiet=quiet)
    beside = recorded if recorded.is_dir() else recorded.parent
    try:
        found = command.identify(recorded, out or beside / VEHICLE_FILE, vehicle, believed)
    except (RecordError, ScenarioError) as error:
        fail(str(error))
    if as_json:
        click.echo(json.dumps(found.to_dict(), indent=2))
    elif not quiet:
        click.echo(command.report(found))


def _clock(scenario: Scenario) -> ClockName:
    return "virtual" if all(each.autopilot == EMULATOR for each in scenario.vehicles) else "real"


def _fly(believed: Scenario, options: RunOptions, *, quiet: bool) -> None:
    """Fly the steps: emulated vehicles at once, others where they are, at the scenario's endpoints."""
    shown = Progress() if quiet else progress_on(sys.stderr)
    with Interrupts() as interrupts:
        try:
            scenario = identification_scenario(believed)
            (run if options.clock == "virtual" else fly)(scenario, options, shown, interrupts)
        except (RecordError, ScenarioError) as error:
            fail(str(error))
        except RunAbortedError as error:
            status = Status.INTERRUPTED if interrupts.count else Status.COULD_NOT_GO_ON
            sys.exit(say(str(error), status))
        finally:
            shown.close()
        if interrupts.count:
            sys.exit(say(f"interrupted; what was recorded is in {options.out}", Status.INTERRUPTED))

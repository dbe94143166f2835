"""`gcs-formation identify`: finds a vehicle's model from a recording, or from steps that it has flown."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from airlink.cli import Number, WholeNumber, examples, fail
from airlink.cli.output_directory import OUT, default_directory
from formation_scenario import Scenario, ScenarioError, load_scenario
from gcs_formation.app.fly import fly as fly_scenario
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import run as run_scenario
from gcs_formation.app.run_options import RunOptions
from gcs_formation.cli import OVERRIDES, PLUGINS
from gcs_formation.cli.run_and_fly import flown_or_exit, interrupted, run_options
from gcs_formation.errors import RecordError
from gcs_formation.record.summary import Summary

IDENTIFY_EXAMPLES = examples(
    "gcs-formation identify arduplane.yaml --out skywalker.yaml   flies steps, then fits",
    "gcs-formation identify runs/flown --vehicle 2                from what was recorded",
    "gcs-formation identify 00000042.BIN --out skywalker.yaml     an ArduPilot log, a PX4 .ulg, a .tlog, a .csv",
)
VEHICLE_FILE = "vehicle.yaml"
LOGS = (".tlog", ".bin", ".ulg", ".csv")
SCENARIOS = (".yaml", ".yml")
SOURCES = "the directory of a run, a log (*.tlog, *.bin, *.ulg, *.csv), or a scenario (*.yaml)"


@click.command(epilog=IDENTIFY_EXAMPLES)
@click.argument("source", type=click.Path(path_type=Path, exists=True))
@click.option("--out", type=click.Path(path_type=Path), help=f"Vehicle file; default: {VEHICLE_FILE} in the run.")
@click.option("--run-dir", type=OUT, help="Where the flight is recorded; default: runs/NAME-TIME.")
@click.option("--overwrite", is_flag=True, help="Replace the files at --out, and an earlier run in --run-dir.")
@click.option("--vehicle", type=WholeNumber(1), help="Use this system id only; default: all, as one kind.")
@click.option("--speedup", type=Number(0.01, 1000), default=1.0, help="Simulated autopilots: X times faster.")
@OVERRIDES
@PLUGINS
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
@click.option("--json", "as_json", is_flag=True, help="The result alone on standard output.")
def identify(source: Path, vehicle: int | None, quiet: bool, as_json: bool, **given: Any) -> None:
    """Find a vehicle's model from SOURCE: a run, a log (.tlog, .bin, .ulg, .csv), or steps flown in a scenario."""
    from gcs_formation import identify as identification  # noqa: PLC0415 - only `identify` fits and draws

    out, run_dir, overrides, plugins = (given.pop(name) for name in ("out", "run_dir", "overrides", "plugins"))
    recording = source.is_dir() or source.suffix.lower() in LOGS
    accepted = None if recording else _to_be_flown(source, overrides, vehicle, plugins)
    recorded = source if accepted is None else run_dir or default_directory(f"{accepted.name}-identify")
    file = out or (source.parent if recorded.is_file() else recorded) / VEHICLE_FILE
    try:
        identification.require_writable(file, overwrite=given["overwrite"], given=out is not None)
    except RecordError as error:
        fail(str(error))
    if accepted is not None:
        _record_steps(accepted, recorded, quiet=quiet, **given)
    try:
        found = identification.identify(recorded, file, vehicle, accepted, plugins)
    except (RecordError, ScenarioError) as error:
        fail(str(error))
    if found["unfit"]:
        click.echo(found["unfit"], err=True)
    if as_json:
        click.echo(json.dumps(found, indent=2))
    elif not quiet:
        click.echo(identification.report(found))


def _to_be_flown(source: Path, overrides: tuple[str, ...], vehicle: int | None, plugins: tuple[str, ...]) -> Scenario:
    """Return the scenario whose vehicles are to fly steps, or exit with what's wrong in it; `vehicle` must be in it."""
    try:
        scenario = load_scenario(source, overrides, plugins=plugins)
    except ScenarioError as error:
        if source.suffix.lower() in SCENARIOS:
            fail(str(error))
        fail(f"found {source}, which is neither a recording nor a scenario ({error}); allowed: {SOURCES}")
    known = ", ".join(str(each.id) for each in scenario.vehicles)
    if vehicle is not None and vehicle not in {each.id for each in scenario.vehicles}:
        fail(f"--vehicle: found {vehicle}; allowed: {known}")
    return scenario


def _record_steps(scenario: Scenario, directory: Path, *, quiet: bool, **given: Any) -> None:
    """Fly the steps and record them in `directory`; `given` are fields of `RunOptions` from the command line."""
    emulated = all(each.autopilot == "emulator" for each in scenario.vehicles)
    if emulated and given["speedup"] != 1.0:
        found = f"found {given['speedup']:g} of emulated vehicles alone, which fly as fast as the processor allows"
        fail(f"--speedup: {found}; allowed: none, or with vehicles at the scenario's endpoints")
    options = run_options(directory, {"clock": "virtual" if emulated else "real", **given})
    with Interrupts() as interrupts:
        flown_or_exit(_fly_steps, scenario, options, interrupts, quiet=quiet)
        if interrupts.count:
            sys.exit(interrupted(options))


def _fly_steps(scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts) -> Summary:
    """Fly the steps: with emulators, or with vehicles at the scenario's endpoints."""
    from gcs_formation.identify.flown_steps import identification_scenario  # noqa: PLC0415 - only `identify` fits and draws

    flown = run_scenario if options.clock == "virtual" else fly_scenario
    return flown(identification_scenario(scenario), options, progress, interrupts)

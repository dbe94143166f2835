"""The command `logs`: fetches the autopilots' own logs of a run's vehicles, which are up still."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import click

from airlink.cli import Status, WholeNumber, examples, fail, say, tell
from formation_scenario import Scenario
from gcs_formation.cli import PLUGINS
from gcs_formation.cli.interrupts import Interrupts
from gcs_formation.cli.no_flight import load
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.log_fetch.fetch import Wanted
from gcs_formation.log_fetch.session import FOLDER, fetch_logs
from gcs_formation.record.run_directory import SCENARIO

LOGS_EXAMPLES = examples(
    "gcs-formation logs runs/flown                    each vehicle's newest, into runs/flown/logs",
    "gcs-formation logs runs/flown --vehicle 2 --log 41",
    "gcs-formation identify runs/flown/logs/vehicle-2-00000041.bin",
)
AGAIN: Final = "gcs-formation logs"


@click.command(epilog=LOGS_EXAMPLES)
@click.argument("run_dir", type=click.Path(path_type=Path), metavar="RUN_DIR")
@click.option("--vehicle", "vehicles", multiple=True, metavar="ID", help="Of this vehicle alone (repeatable).")
@click.option("--log", "number", type=WholeNumber(0, 65534), help="The log's number; default: each one's newest.")
@PLUGINS
@click.option("--json", "as_json", is_flag=True, help="What was fetched, on standard output.")
def logs(run_dir: Path, vehicles: tuple[str, ...], number: int | None, plugins: tuple[str, ...], as_json: bool) -> None:
    """Fetch the autopilots' own logs after the flight recorded in RUN_DIR, into its folder `logs`.

    Nothing is commanded. What was interrupted goes on where it was. Exit status 3: a log couldn't be fetched.
    """
    if not (run_dir / SCENARIO).is_file():
        fail(f"RUN_DIR: found no {SCENARIO} in {run_dir}; allowed: the directory of a run")
    scenario = load(run_dir / SCENARIO, (), plugins)
    known = [str(each.vehicle_id) for each in scenario.vehicles]
    unknown = next((each for each in vehicles if each not in known), None)
    if unknown is not None:
        fail(f"--vehicle: found {unknown}; allowed: {', '.join(known)}")
    found, interrupted = fetched(run_dir, scenario, number, vehicles)
    tell(json.dumps(found, indent=1) if as_json else "\n".join(words(run_dir, found)))
    failed = any("failure" in each for each in found)
    sys.exit(Status.INTERRUPTED if interrupted else Status.COULD_NOT_GO_ON if failed else Status.FINE)


def fetched(
    run_dir: Path, scenario: Scenario, number: int | None = None, vehicles: Sequence[str] = ()
) -> tuple[list[dict[str, Any]], bool]:
    """Return what is reported of each vehicle's log once it is fetched, and whether that was interrupted."""
    interrupts = _Interrupts()
    say(f"fetching logs into {run_dir / FOLDER}; an interrupt (Ctrl-C) ends that, and it can go on later", Status.FINE)
    try:
        with interrupts:
            return fetch_logs(run_dir, scenario, number, frozenset(vehicles), interrupts.ends), interrupts.count > 0
    except (RunAbortedError, RecordError) as error:
        fail(str(error), Status.COULD_NOT_GO_ON)


def words(run_dir: Path, found: list[dict[str, Any]]) -> list[str]:
    """Return in words what came of each vehicle."""
    return [f"vehicle {each['vehicle']}: {_what(run_dir, each)}" for each in found]


def _what(run_dir: Path, each: dict[str, Any]) -> str:
    if "failure" in each:
        part = f"; {each['bytes']} bytes are there" if each["bytes"] else ""
        return f"{each['failure']}{part}. Again: {AGAIN} {run_dir} --vehicle {each['vehicle']}"
    clock = "its clock isn't known: " + str(each.get("why"))
    if each["offset_s"] is not None:
        clock = f"its clock plus {each['offset_s']:.3f} s is the run's t_s, within {1e3 * each['within_s']:.0f} ms"
    return f"{each['file']}, {each['bytes']} bytes; {clock}"


class _Interrupts(Interrupts):
    """While entered, a termination signal ends the transfer; what has come is kept."""

    def __init__(self) -> None:
        super().__init__()
        self._shown: dict[str, int] = {}

    def ends(self, wanted: Mapping[str, Wanted]) -> bool:
        """Return whether to end; say of each log when another tenth of it has come."""
        for name, each in wanted.items():
            transfer = each.transfer
            if transfer is not None and transfer.entry is not None and transfer.entry.size:
                tenths = 10 * transfer.received // transfer.entry.size
                if tenths > self._shown.get(name, 0):
                    self._shown[name] = tenths
                    size = transfer.entry.size
                    say(f"vehicle {name}: {10 * tenths} % of {size} bytes", Status.FINE)
        return self.count > 0

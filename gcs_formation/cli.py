"""The command line: `gcs-formation init | check | run | fly | tell | report | compare | stress`."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import click
from rich.console import Console

from formation_scenario import Scenario, ScenarioError, load_scenario
from formation_scenario.orders import OrderError, parse_order
from gcs_formation.app import usage
from gcs_formation.app.check import check_report, check_text
from gcs_formation.app.directory import default_directory
from gcs_formation.app.fly import fly as fly_scenario
from gcs_formation.app.init import example_names, write_example
from gcs_formation.app.interrupt import Interrupts
from gcs_formation.app.options import ClockName, RunOptions
from gcs_formation.app.progress import ProgressLine, Silent
from gcs_formation.app.run import run as run_scenario
from gcs_formation.app.steering import tell as give_order
from gcs_formation.app.tell import summary_text
from gcs_formation.errors import ExampleError, NothingRunningError, RecordError, RunAbortedError
from gcs_formation.record.summary import Summary

if TYPE_CHECKING:
    from gcs_formation.compare.command import Compared

EXPECTATION_BROKEN = 1
BAD_USAGE = 2
COULD_NOT_GO_ON = 3
INTERRUPTED = 130

Command = TypeVar("Command", bound=Callable[..., Any])
Flown = Callable[[Scenario, RunOptions, ProgressLine | Silent, Interrupts], Summary]


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, epilog=usage.ALL)
@click.version_option(package_name="gcs-formation")
def main() -> None:
    """Fly formations over MAVLink."""


@main.command(epilog=usage.INIT)
@click.argument("directory", type=click.Path(path_type=Path), default=Path())
@click.option("--example", type=click.Choice(example_names()), default="quickstart", show_default=True)
def init(directory: Path, example: str) -> None:
    """Write an example scenario into DIRECTORY (default: here) to begin with. Overwrites nothing."""
    try:
        path = write_example(example, directory)
    except ExampleError as error:
        _fail(str(error), BAD_USAGE)
    emulated = all(vehicle.autopilot == "emulator" for vehicle in _load(path, ()).vehicles)
    click.echo(
        f"wrote {path}; next:\n  gcs-formation check {path}\n  gcs-formation {'run' if emulated else 'fly'} {path}"
    )


def _options(command: Command) -> Command:
    """Add what `run` and `fly` have in common."""
    for option in reversed(
        (
            click.argument("scenario", type=click.Path(path_type=Path)),
            click.option(
                "--speedup",
                type=click.FloatRange(0.01, 1000),
                default=1.0,
                help="Real clock: X times faster.",
            ),
            click.option("--until", type=click.FloatRange(0), metavar="SECONDS", help="End the flight at this time."),
            click.option("--seed", type=click.IntRange(0), help="Instead of the scenario's."),
            click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key (repeatable)."),
            click.option("--out", type=click.Path(path_type=Path), help="Run directory; default: runs/NAME-TIME."),
            click.option("--quiet", is_flag=True, help="Say nothing but errors."),
            click.option("--json", "as_json", is_flag=True, help="The summary alone on standard output."),
        )
    ):
        command = option(command)
    return command


@main.command(epilog=usage.RUN)
@_options
@click.option(
    "--clock",
    type=click.Choice(["real", "virtual"]),
    default="real",
    help="virtual: as fast as possible, repeatable.",
)
def run(clock: ClockName, **given: Any) -> None:
    """Fly SCENARIO with emulated vehicles: start them, take off, fly, record, judge."""
    sys.exit(_fly(run_scenario, clock, _Given(**given)))


@main.command(epilog=usage.FLY)
@_options
def fly(**given: Any) -> None:
    """Fly SCENARIO with vehicles that are up already, at the scenario's endpoints."""
    sys.exit(_fly(fly_scenario, "real", _Given(**given)))


@main.command(epilog=usage.CHECK)
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key (repeatable).")
@click.option("--json", "as_json", is_flag=True, help="Margins and warnings as JSON.")
def check(scenario: Path, overrides: tuple[str, ...], as_json: bool) -> None:
    """Validate SCENARIO; print it resolved, its communication graph and its delay margins. Starts nothing."""
    loaded = _load(scenario, overrides)
    click.echo(json.dumps(check_report(loaded), indent=2) if as_json else check_text(loaded))


@main.command(epilog=usage.TELL)
@click.argument("run_dir", type=click.Path(path_type=Path))
@click.argument("order", nargs=-1, required=True)
def tell(run_dir: Path, order: tuple[str, ...]) -> None:
    """Give the flight that records into RUN_DIR an ORDER, and print what came of it."""
    text = " ".join(order)
    try:
        parse_order(text)
        answer = give_order(run_dir, text)
    except OrderError as error:
        _fail(str(error), BAD_USAGE)
    except NothingRunningError as error:
        _fail(str(error), COULD_NOT_GO_ON)
    click.echo(answer.text, err=not answer.accepted)
    sys.exit(0 if answer.accepted else EXPECTATION_BROKEN)


@main.command(epilog=usage.REPORT)
@click.argument("run_dir", type=click.Path(path_type=Path))
def report(run_dir: Path) -> None:
    """Draw the figures of a finished run, and one self-contained report.html."""
    from gcs_formation.report import write_report  # noqa: PLC0415 - matplotlib takes a second to import

    try:
        click.echo(f"wrote {write_report(run_dir)}")
    except RecordError as error:
        _fail(str(error), BAD_USAGE)


@main.command(epilog=usage.COMPARE)
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--laws", default="pid,fuzzy_pid,consensus", show_default=True, help="Names, with commas between.")
@click.option("--from", "from_s", type=click.FloatRange(0), default=0.0, metavar="SECONDS", help="Errors count from…")
@click.option("--to", "to_s", type=click.FloatRange(0), metavar="SECONDS", help="… to; default: the end.")
@click.option("--until", "until_s", type=click.FloatRange(0), metavar="SECONDS", help="End the flights at this time.")
@click.option("--seed", type=click.IntRange(0), help="Instead of the scenario's.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key (repeatable).")
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Flights at a time.")
@click.option("--out", type=click.Path(path_type=Path), help="Directory of it all; default: runs/NAME-TIME.")
@click.option("--json", "as_json", is_flag=True, help="The figures alone on standard output, as JSON.")
def compare(seed: int | None, overrides: tuple[str, ...], out: Path | None, as_json: bool, **given: Any) -> None:
    """Fly SCENARIO by each of several laws, on one seed under the virtual clock, and set them side by side.

    Laws: pid, fuzzy_pid (tables as printed), fuzzy_pid_symmetric and consensus, each also as NAME_uncompensated,
    without prediction over the delay. --out gets a run directory for each law, comparison.json, .png and .html.
    """
    from gcs_formation.compare import command  # noqa: PLC0415 - matplotlib takes a second to import

    given["overrides"] = (*overrides, *(() if seed is None else (f"seed={seed}",)))
    given["out"] = out or default_directory(f"{Path(given['scenario']).stem}-laws")
    try:
        compared = command.compare(command.CompareOptions(**given))
    except (ScenarioError, RecordError) as error:
        _fail(str(error), BAD_USAGE)
    except RunAbortedError as error:
        _fail(str(error), COULD_NOT_GO_ON)
    if as_json:
        click.echo(compared.json)
    click.echo(compared.text, err=as_json)
    sys.exit(_compared_status(compared))


@main.command(epilog=usage.STRESS)
@click.option("--count", type=click.IntRange(1), default=100, show_default=True, help="How many flights.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of the first; then one more.")
@click.option("--jobs", type=click.IntRange(1), default=os.cpu_count() or 1, help="Flights at a time; default: cores.")
@click.option("--out", type=click.Path(path_type=Path), help="Keep the record of the one flight here (--count 1).")
def stress(count: int, seed: int, jobs: int, out: Path | None) -> None:
    """Fly seeded random scenarios under the virtual clock and look for what must never be.

    Each seed is a short flight with random shape, path, rates, links, wind, disturbances and faults. Its record is held
    against invariants: separation, envelope, finite values, acknowledged state, complete record, formation regained;
    every tenth is flown twice and compared byte for byte. A broken one is named with its seed; exit status 1.
    """
    from gcs_formation.stress.campaign import fly_seed, fly_seeds  # noqa: PLC0415 - its processes import this module

    if out is not None and count != 1:
        _fail(f"--out: found --count {count}; allowed: --count 1, whose record it keeps", BAD_USAGE)
    trials = [fly_seed(seed, out)] if out else fly_seeds(seed, count, min(jobs, count))
    flown, wrong = 0, 0
    for trial in trials:
        flown += 1
        wrong += bool(trial.broken)
        for text in trial.broken:
            click.echo(f"seed {trial.seed}: {text}", err=True)
            click.echo(f"  again: gcs-formation stress --count 1 --seed {trial.seed} --out DIR", err=True)
    click.echo(f"{flown} flights, seeds {seed} to {seed + count - 1}: {wrong or 'none'} broke an invariant")
    sys.exit(EXPECTATION_BROKEN if wrong else 0)


@dataclass(frozen=True)
class _Given:
    """What stands on the command line of `run` and `fly`."""

    scenario: Path
    speedup: float
    until: float | None
    seed: int | None
    overrides: tuple[str, ...]
    out: Path | None
    quiet: bool
    as_json: bool


def _fly(flown: Flown, clock: ClockName, given: _Given) -> int:
    seed = () if given.seed is None else (f"seed={given.seed}",)
    with Interrupts() as interrupts:
        loaded = _load(given.scenario, (*given.overrides, *seed))
        options = RunOptions(given.out or default_directory(loaded.name), clock, given.speedup, given.until)
        console = Console(stderr=True)
        shown = ProgressLine(console) if console.is_terminal and not given.quiet else Silent()
        try:
            summary = flown(loaded, options, shown, interrupts)
        except RecordError as error:
            return _say(str(error), BAD_USAGE)
        except RunAbortedError as error:
            return _interrupted(options) if interrupts.count else _say(str(error), COULD_NOT_GO_ON)
        finally:
            if isinstance(shown, ProgressLine):
                shown.close()
        return _conclude(summary, options, interrupts, given)


def _conclude(summary: Summary, options: RunOptions, interrupts: Interrupts, given: _Given) -> int:
    if given.as_json:
        click.echo(json.dumps(summary.to_dict(), indent=2))
    if not given.quiet:
        click.echo(summary_text(summary, options.out), err=given.as_json)
    if interrupts.count:
        return _interrupted(options)
    for broken in (*(str(v) for v in summary.verdicts if v.held is False), *summary.breaches):
        click.echo(broken, err=True)
    return 0 if summary.held else EXPECTATION_BROKEN


def _compared_status(compared: Compared) -> int:
    """Say what each law broke and which could not go on; return the gravest status."""
    for text in (*compared.broken(), *compared.stopped()):
        click.echo(text, err=True)
    if compared.interrupted:
        return _say("interrupted; what was recorded is complete", INTERRUPTED)
    if compared.stopped():
        return COULD_NOT_GO_ON
    return EXPECTATION_BROKEN if compared.broken() else 0


def _interrupted(options: RunOptions) -> int:
    return _say(f"interrupted; what was recorded is in {options.out}", INTERRUPTED)


def _load(scenario: Path, overrides: tuple[str, ...]) -> Scenario:
    try:
        return load_scenario(scenario, overrides)
    except ScenarioError as error:
        _fail(str(error), BAD_USAGE)


def _say(text: str, status: int) -> int:
    click.echo(text, err=True)
    return status


def _fail(text: str, status: int) -> NoReturn:
    click.echo(text, err=True)
    sys.exit(status)

"""`gcs-formation run` and `fly`: the commands that fly a scenario."""

from __future__ import annotations

import json
import math
import shlex
import shutil
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import click

from airlink.cli import SECONDS, SEED, Number, Status, examples, fail, say, tell
from airlink.cli.output_directory import OUT, default_directory
from airlink.endpoint import Endpoint, EndpointError, parse_endpoint
from airlink.forwarding import Forward
from formation_scenario import Scenario, ScenarioError
from gcs_formation.app.check_warnings import never_reached
from gcs_formation.app.dry_run import rehearsal_text
from gcs_formation.app.fly import fly as fly_scenario
from gcs_formation.app.fly import rehearse
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress, progress_on
from gcs_formation.app.result_text import NOTHING_EXPECTED, result_line, spoilt, summary_text, unjudged
from gcs_formation.app.run import run as run_scenario
from gcs_formation.app.run_options import ClockName, RunOptions
from gcs_formation.cli import OVERRIDES, PLUGINS
from gcs_formation.cli.no_flight import load
from gcs_formation.cli.view import TILES, VIEW, VIEW_ORDERS, WithView, viewing
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.record.run_directory import SCENARIO, recorded_in
from gcs_formation.record.summary import Summary

RUN_EXAMPLES = examples(
    "gcs-formation run quickstart.yaml --speedup 5 --out runs/quickstart",
    "gcs-formation run quickstart.yaml --clock virtual --until 60 --json",
    'gcs-formation run quickstart.yaml --clock virtual --set formation.shape=arrow --set "wind.velocity_mps=[3, 0, 0]"',
    "gcs-formation run arduplane.yaml --sitl arduplane=build/sitl/bin/arduplane   your own simulators",
    "gcs-formation run arduplane.yaml --sitl arduplane=arduplane --clock virtual   in step, repeatable",
)
FLY_EXAMPLES = examples(
    "sim-vehicles quickstart.yaml                              vehicles, in another terminal",
    "gcs-formation fly quickstart.yaml --out runs/flown",
    "gcs-formation fly arduplane.yaml --dry-run                says what it would send, and arms none",
    "gcs-formation fly --resume runs/flown                     takes over what flies of a run that was killed",
    "gcs-formation fly arduplane.yaml --confirm                asks before any vehicle is armed",
    "gcs-formation fly arduplane.yaml --take                   also those that somebody else flies",
    "gcs-formation fly arduplane.yaml --dry-run --set-parameters   which parameters it would set, from which value",
)


class EndpointType(click.ParamType[Endpoint]):
    """A connection string."""

    name = "endpoint"

    def convert(self, value: str | Endpoint, param: click.Parameter | None, ctx: click.Context | None) -> Endpoint:
        """Parse it."""
        try:
            return value if isinstance(value, Endpoint) else parse_endpoint(value)
        except EndpointError as error:
            self.fail(str(error), param, ctx)


FORWARD = EndpointType()
CLOCKS = click.Choice(["real", "virtual"])
Command = TypeVar("Command", bound=Callable[..., Any])
Result = TypeVar("Result")
Fly = Callable[[Scenario, RunOptions, Progress, Interrupts], Result]
"""Flies a scenario, or does a dry run of it."""


def _options(command: Command) -> Command:
    """Add the options that `run` and `fly` have in common."""
    for option in reversed(
        (
            click.option("--speedup", type=Number(0.01, 1000), default=1.0, help="Real clock: X times faster."),
            click.option("--until", "until_s", type=SECONDS, metavar="SECONDS", help="End the flight at this time."),
            click.option("--seed", type=SEED, help="Instead of the scenario's."),
            OVERRIDES,
            PLUGINS,
            click.option("--out", type=OUT, help="Run directory; default: runs/NAME-TIME."),
            click.option("--overwrite", is_flag=True, help="Replace an earlier run in --out when this one begins."),
            click.option(
                "--forward",
                "forward",
                type=FORWARD,
                multiple=True,
                metavar="ENDPOINT",
                help="A second ground station sees and commands the vehicles there; repeatable.",
            ),
            click.option(
                "--forward-only",
                "forward_only",
                type=FORWARD,
                multiple=True,
                metavar="ENDPOINT",
                help="A second ground station sees the vehicles there; what it sends isn't taken.",
            ),
            VIEW,
            VIEW_ORDERS,
            TILES,
            click.option("--quiet", is_flag=True, help="Say nothing but errors."),
            click.option("--json", "as_json", is_flag=True, help="The summary alone on standard output."),
        )
    ):
        command = option(command)
    return command


@click.command(cls=WithView, epilog=RUN_EXAMPLES)
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--clock", type=CLOCKS, default="real", help="virtual: as fast as possible, repeatable.")
@click.option(
    "--sitl",
    multiple=True,
    metavar="FAMILY=PROGRAM",
    help="Your ArduPilot or PX4 simulator for that family's vehicles, stepped with --clock virtual; repeatable.",
)
@_options
def run(sitl: tuple[str, ...], **given: Any) -> None:
    """Fly SCENARIO with emulated vehicles: start them, take off, fly, record, judge."""
    sys.exit(_done(_with_simulators(sitl, given["clock"]) if sitl else run_scenario, _conclude, **given))


def _with_simulators(sitl: tuple[str, ...], clock: ClockName) -> Fly[Summary]:
    """Return what flies a scenario with the user's simulators, or exit with what's wrong with them."""
    from gcs_formation.app.sitl.fleet import ProgramError, programs_of  # noqa: PLC0415 - only `--sitl` starts any
    from gcs_formation.app.sitl.run import with_simulators  # noqa: PLC0415

    try:
        return with_simulators(programs_of(sitl), clock)
    except ProgramError as error:
        fail(f"--sitl: {error}")


@click.command(cls=WithView, epilog=FLY_EXAMPLES)
@click.argument("scenario", type=click.Path(path_type=Path), required=False)
@click.option("--clock", type=CLOCKS, default="real", hidden=True)  # refused with the reason, not as unknown
@_options
@click.option("--dry-run", is_flag=True, help="Everything but commands: say what vehicles would be sent.")
@click.option("--confirm", is_flag=True, help="Ask here before any vehicle is armed.")
@click.option("--resume", type=OUT, metavar="RUN_DIR", help="Take over what flies of a run that was killed.")
@click.option(
    "--take", "--retake", "take", is_flag=True, help="Take over also those that fly under somebody's command."
)
@click.option(
    "--fetch-logs", is_flag=True, help="After the flight fetch the autopilots' own logs into the run directory."
)
@click.option(
    "--set-parameters",
    is_flag=True,
    help="Set parameters that the check asks for, restore them after the flight; failsafes are never touched.",
)
def fly(**given: Any) -> None:
    """Fly SCENARIO with vehicles that are up already, at the scenario's endpoints."""
    _resume(given)
    if given["clock"] == "virtual":
        fail(
            "--clock: found virtual; allowed: real, which vehicles that are up already go by; emulated ones: see `run`"
        )
    if given["confirm"] and given["dry_run"]:
        fail("--confirm: found beside --dry-run, which arms none; allowed: one of them")
    if given["confirm"] and not (sys.stdin is not None and sys.stdin.isatty()):
        fail("--confirm: found no terminal to ask on; allowed: a terminal as standard input, or no --confirm")
    fetches = given.pop("fetch_logs")
    if given["dry_run"] and fetches:
        fail("--fetch-logs: found beside --dry-run, which flies nothing; allowed: one of them")
    if given["dry_run"]:
        sys.exit(_done(rehearse, _tell_rehearsal, **given))
    if fetches:
        flown = list[Scenario]()
        sys.exit(_done(partial(_fly_and_record, flown), partial(_conclude_with_logs, flown), **given))
    sys.exit(_done(fly_scenario, _conclude, **given))


NOT_RESUMED = ("scenario", "seed", "overrides", "out", "overwrite", "dry_run")
"""Options that `--resume` refuses: the unfinished run has its own."""
OPTION = {"scenario": "SCENARIO", "overrides": "--set"}


def _resume(given: dict[str, Any]) -> None:
    """Add scenario and directory of the run to resume, if one is given, to `fly`'s arguments."""
    resumed: Path | None = given["resume"]
    given["resume"] = resumed is not None
    if resumed is None:
        if given["scenario"] is None:
            fail("found no SCENARIO; allowed: a scenario's file, or --resume RUN_DIR")
        return
    more = next((name for name in NOT_RESUMED if given[name]), None)
    if more is not None:
        name = OPTION.get(more, f"--{more.replace('_', '-')}")
        fail(f"{name}: found beside --resume, which goes on with the run's own; allowed: none")
    if not (resumed / SCENARIO).is_file():
        fail(f"--resume: found no {SCENARIO} in {resumed}; allowed: the directory of a run that was killed")
    given["scenario"], given["out"] = resumed / SCENARIO, resumed


def _done(
    flown: Fly[Result], conclude: Callable[..., Status], *, scenario: Path, quiet: bool, as_json: bool, **given: Any
) -> Status:
    """Fly, or do a dry run, as the command line says; report the result, and return the exit status.

    `given`: `seed`, `overrides`, `out`, `plugins`, and the fields of `RunOptions` by their names.
    """
    seed, overrides, out, plugins = (given.pop(name) for name in ("seed", "overrides", "out", "plugins"))
    view, view_orders, tiles = (given.pop(name) for name in ("view", "view_orders", "tiles"))
    seeded = () if seed is None else (f"seed={seed}",)
    with Interrupts() as interrupts, ExitStack() as stack:
        loaded = load(scenario, (*overrides, *seeded), plugins)
        options = run_options(out or default_directory(loaded.name), given)
        if view is not None:
            viewer = viewing(view, options.out, plugins, orders=view_orders, to_stderr=as_json, tiles=tiles)
            options = replace(options, recording=stack.enter_context(viewer).announce)
        for warning in () if quiet else never_reached(loaded, math.inf if options.until_s is None else options.until_s):
            tell(f"warning: {warning}", err=True)
        result = flown_or_exit(flown, loaded, options, interrupts, quiet=quiet, as_json=as_json)
        return conclude(result, options, interrupts, quiet=quiet, as_json=as_json)


def run_options(out: Path, given: dict[str, Any]) -> RunOptions:
    """Return how a flight is flown and recorded, by the options of the command line, or exit with what is wrong."""
    seen: tuple[Endpoint, ...] = given.pop("forward_only", ())
    listening: tuple[Endpoint, ...] = given.pop("forward", ())
    given["forward"] = tuple(Forward(end, end in listening) for end in dict.fromkeys((*listening, *seen)))
    try:
        return RunOptions(out, **given)
    except ValueError as error:
        fail(str(error))


def flown_or_exit(
    fly: Fly[Result],
    scenario: Scenario,
    options: RunOptions,
    interrupts: Interrupts,
    *,
    quiet: bool,
    as_json: bool = False,
) -> Result:
    """Return the result of a flight, or exit with the reason why it couldn't begin or go on.

    `as_json`: the summary of one that couldn't go on is printed, if there is one.
    """
    shown = Progress() if quiet else progress_on(sys.stderr)
    try:
        return fly(scenario, options, shown, interrupts)
    except (RecordError, ScenarioError) as error:
        fail(str(error))
    except RunAbortedError as error:
        if as_json and error.figures is not None:
            click.echo(json.dumps(error.figures, indent=2))
        sys.exit(interrupted(options) if interrupts.count else say(str(error), Status.COULD_NOT_GO_ON))
    finally:
        shown.close()


def _tell_rehearsal(
    report: dict[str, Any], options: RunOptions, interrupts: Interrupts, *, quiet: bool, as_json: bool
) -> Status:
    if as_json:
        click.echo(json.dumps(report, indent=2))
    elif not quiet:
        click.echo(rehearsal_text(report))
        click.echo(f"recorded in {recorded_in(options.out)}")
    return interrupted(options) if interrupts.count else Status.FINE


def _fly_and_record(
    flown: list[Scenario], scenario: Scenario, options: RunOptions, progress: Progress, interrupts: Interrupts
) -> Summary:
    flown.append(scenario)
    return fly_scenario(scenario, options, progress, interrupts)


def _conclude_with_logs(
    flown: list[Scenario],
    summary: Summary,
    options: RunOptions,
    interrupts: Interrupts,
    *,
    quiet: bool,
    as_json: bool,
) -> Status:
    """Print the result, then fetch the autopilots' own logs; the exit status is the flight's."""
    from gcs_formation.cli.logs import fetched, words  # noqa: PLC0415 - only `--fetch-logs` needs it

    status = _conclude(summary, options, interrupts, quiet=quiet, as_json=as_json)
    found, _ = fetched(options.out, flown[-1])
    for line in words(options.out, found):
        tell(line, err=True)
    return status


def _conclude(summary: Summary, options: RunOptions, interrupts: Interrupts, *, quiet: bool, as_json: bool) -> Status:
    """Print the result of a flight, wrapped to the terminal if there is one; also as one line where stderr is a log."""
    if as_json:
        click.echo(json.dumps(summary.to_dict(), indent=2))
    if not quiet:
        stream = sys.stderr if as_json else sys.stdout
        width = shutil.get_terminal_size().columns if stream is not None and stream.isatty() else None
        if sys.stderr is not None and not sys.stderr.isatty():
            tell(result_line(summary), err=True)
        tell(summary_text(summary, recorded_in(options.out), width), err=as_json)
        tell(f"next: gcs-formation report {shlex.quote(str(recorded_in(options.out)))}", err=as_json)
    if interrupts.count:
        return interrupted(options)
    broken = (str(verdict) for verdict in summary.verdicts if verdict.held is False)
    for text in (*broken, *summary.breaches, *spoilt(summary), *unjudged(summary)):
        tell(text, err=True)
    if summary.held is None and not summary.verdicts and not quiet:
        tell(NOTHING_EXPECTED, err=True)
    return Status.EXPECTATION_BROKEN if summary.held is False else Status.FINE


def interrupted(options: RunOptions) -> Status:
    """Print where the record of an interrupted flight is; return the exit status."""
    return say(f"interrupted; what was recorded is in {recorded_in(options.out)}", Status.INTERRUPTED)

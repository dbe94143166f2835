"""The commands that fly nothing: `init`, `check`, `schema`, `tell` (to a running flight) and `report` (after it)."""

from __future__ import annotations

import json
import shutil
import sys
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click

from airlink.cli import Status, examples, fail, say
from formation_scenario.orders import UNKNOWN_SHAPE, OrderError, read_order
from gcs_formation.app.order_socket import STATUS
from gcs_formation.app.order_socket import tell as give_order
from gcs_formation.cli import OVERRIDES, PLUGINS
from gcs_formation.errors import NothingRunningError, RecordError, StationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from formation_scenario import Scenario, ScenarioError
    from formation_scenario.repair import Repair
    from formation_scenario.violations import Violation

INIT_EXAMPLES = examples(
    "gcs-formation init                      quickstart.yaml, here",
    "gcs-formation init try --example paper  try/paper.yaml",
)
CHECK_EXAMPLES = examples(
    "gcs-formation check quickstart.yaml",
    "gcs-formation check quickstart.yaml --set law.rate_hz=5 --json",
    "gcs-formation check quickstart.yaml --export path.kml             for a map; .plan for QGroundControl",
    "gcs-formation check mission.yaml --repair repaired.yaml           the nearest scenario that flies",
)
REPAIR_HINT = "next: --repair OUT.yaml writes the nearest scenario that flies"
SCHEMA_EXAMPLES = examples("gcs-formation schema > scenario.schema.json", "gcs-formation schema --markdown | less")
TELL_USAGE = (
    examples(
        "gcs-formation tell runs/quickstart status",
        "gcs-formation tell runs/quickstart shape line",
        "gcs-formation tell runs/quickstart leader 2",
    )
    + """

\b
Orders:
  shape NAME [SPACING_M]   fly another shape
  spacing SPACING_M        fly the same shape wider or closer
  speed MPS                fly the path at another speed
  heading DEG              multirotors that stand: turn on the spot
  leader ID                let another vehicle lead
  loiter | rtl | land      end the flight: circle here, at home, or land there

\b
Or:
  status                   a page on phase, vehicles, errors, delays and margins

Exit status 1: refused, with the reason. 3: no flight answers there.
"""
)
REPORT_EXAMPLES = examples("gcs-formation report runs/quickstart      writes runs/quickstart/report.html")

FORMATS = ("png", "svg", "pdf")
SUFFIX = ".yaml"
IN_THE_TREE = "configs"
"""Directory of the examples in the source tree; an installed package contains a copy."""


def load(scenario: Path, overrides: tuple[str, ...], plugins: tuple[str, ...] = ()) -> Scenario:
    """Return a scenario, or exit with what's wrong in it."""
    from formation_scenario import ScenarioError, load_scenario  # noqa: PLC0415 - `tell` starts faster without it

    try:
        return load_scenario(scenario, overrides, plugins=plugins)
    except ScenarioError as error:
        fail(str(error))


def example_names() -> list[str]:
    """Return the names of the examples that come with the package."""
    return sorted(path.name.removesuffix(SUFFIX) for path in _directory().iterdir() if path.name.endswith(SUFFIX))


def _directory() -> Path:
    package = Path(str(files("gcs_formation")))
    packaged = package / "examples"
    return packaged if packaged.is_dir() else package.parent / IN_THE_TREE


@click.command(epilog=INIT_EXAMPLES)
@click.argument("directory", type=click.Path(path_type=Path), default=Path())
@click.option("--example", type=click.Choice(example_names()), default="quickstart", show_default=True)
def init(directory: Path, example: str) -> None:
    """Write an example scenario into DIRECTORY (default: here) to begin with. Overwrites nothing."""
    path = directory / f"{example}{SUFFIX}"
    text = (_directory() / path.name).read_text(encoding="utf-8").replace(f"{IN_THE_TREE}/", "")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        if path.exists():
            fail(f"found {path}; allowed: a file that isn't there yet, as init overwrites nothing")
        fail(f"cannot write {path}: {error.strerror}; allowed: a writable directory")
    then = "run" if all(vehicle.autopilot == "emulator" for vehicle in load(path, ()).vehicles) else "fly"
    click.echo(f"wrote {path}; next:\n  gcs-formation check {path}\n  gcs-formation {then} {path}")


@click.command(epilog=CHECK_EXAMPLES)
@click.argument("scenario", type=click.Path(path_type=Path))
@OVERRIDES
@PLUGINS
@click.option("--json", "as_json", is_flag=True, help="Margins and warnings, or what is wrong, as JSON.")
@click.option(
    "--export",
    "exported",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write the flown path: .plan, .waypoints of the leader; .kml, .gpx, .geojson, .csv of every slot.",
)
@click.option("--export-vehicle", metavar="ID", help="With --export: the path of this vehicle alone.")
@click.option(
    "--repair",
    "repaired",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="OUT.yaml",
    help="Write the nearest scenario that flies, and list what is changed (key `repair`: in which order).",
)
@click.option(
    "--plan",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE.png",
    help="Draw the path from above and its heights, with what can't be flown marked.",
)
@click.option(
    "--fly/--no-fly",
    "ahead",
    default=True,
    help="Whether the start and the worst stretch are flown ahead on the virtual clock, for 2 s at most.",
)
def check(  # noqa: PLR0913, PLR0917 - a parameter for each option
    scenario: Path,
    overrides: tuple[str, ...],
    plugins: tuple[str, ...],
    as_json: bool,
    exported: Path | None,
    export_vehicle: str | None,
    repaired: Path | None,
    plan: Path | None,
    ahead: bool,
) -> None:
    """Validate SCENARIO; print it resolved, its communication graph and its delay margins. Starts nothing."""
    from formation_scenario import ScenarioError, load_scenario  # noqa: PLC0415 - nor margins
    from gcs_formation.app.check import check_report, check_text  # noqa: PLC0415
    from gcs_formation.app.rehearsal.rehearsal import rehearse  # noqa: PLC0415

    if exported is not None:
        _keep(scenario, exported)
    if repaired is not None:
        _repair(scenario, overrides, plugins, as_json, repaired, plan)
        return
    try:
        loaded = load_scenario(scenario, overrides, plugins=plugins)
    except ScenarioError as error:
        _refuse(error, as_json, plan)
    try:
        flown = rehearse(loaded) if ahead else None
        text = json.dumps(check_report(loaded, flown), indent=2) if as_json else check_text(loaded, flown)
    except StationError as error:  # of an extension, whose code is asked here for what it states
        sys.exit(say(str(error), Status.COULD_NOT_GO_ON))
    click.echo(text)
    if plan is not None:
        _draw(plan, loaded, ())
    if exported is not None:
        _export(loaded, exported, export_vehicle)
    elif export_vehicle is not None:
        fail("found --export-vehicle alone; allowed: with --export FILE")


def _refuse(error: ScenarioError, as_json: bool, plan: Path | None) -> NoReturn:
    """Exit with what is wrong in a scenario, and what would do, as far as a short search finds it."""
    from formation_scenario import ScenarioError  # noqa: PLC0415
    from formation_scenario.load import UnflyableError  # noqa: PLC0415
    from formation_scenario.repair import repair_refused  # noqa: PLC0415 - only of a scenario that is refused
    from gcs_formation.app.check import MAX_REPAIR_M, refusal_report  # noqa: PLC0415

    hint = ""
    if isinstance(error, UnflyableError):
        found = repair_refused(error, MAX_REPAIR_M)
        if plan is not None:
            _draw(plan, error.scenario, error.violations, found if found.flies else None)
        error, hint = ScenarioError(found.problems), "" if found.whole and not found.flies else f"\n{REPAIR_HINT}"
    if as_json:
        click.echo(json.dumps(refusal_report(error), indent=2))
    fail(f"{error}{hint}")


def _repair(
    scenario: Path, overrides: tuple[str, ...], plugins: tuple[str, ...], as_json: bool, file: Path, plan: Path | None
) -> None:
    """Write the nearest scenario that flies, and print what is changed; exit with what is in the way of one."""
    from formation_scenario import ScenarioError  # noqa: PLC0415
    from formation_scenario.repair import repair  # noqa: PLC0415 - only this option needs it
    from gcs_formation.app.check import repair_report  # noqa: PLC0415

    _keep(scenario, file)
    try:
        found = repair(scenario, overrides, plugins)
    except ScenarioError as error:
        fail(str(error))
    if as_json:
        click.echo(json.dumps(repair_report(found), indent=2))
    if plan is not None:
        _draw(plan, found.given.scenario, found.given.violations, found)
    if found.left:
        fail(f"nothing was found that flies; what is in the way:\n{ScenarioError(found.left)}")
    try:
        file.write_text(found.text(), encoding="utf-8")
    except OSError as error:
        fail(f"cannot write {file}: {error.strerror}; allowed: a writable file")
    if not as_json:
        click.echo("".join(f"{each}\n" for each in found.changes) or "nothing to repair\n", nl=False)
    click.echo(f"wrote {file}", err=True)


def _keep(scenario: Path, file: Path) -> None:
    """Exit where a file that is to be written is the scenario itself, with its comments."""
    if file.exists() and file.samefile(scenario):
        fail(f"found the scenario itself, {file}; allowed: another file, so that yours is kept")


def _draw(file: Path, scenario: Scenario, violations: Sequence[Violation], repair: Repair | None = None) -> None:
    from gcs_formation.report.mission_plan import draw_plan  # noqa: PLC0415 - this option alone needs it

    if file.suffix.lower() != ".png":
        fail(f"found {file}; allowed: a file *.png")
    try:
        draw_plan(scenario, violations, file, repair)
    except OSError as error:
        fail(f"cannot write {file}: {error.strerror}; allowed: a writable file")
    click.echo(f"wrote {file}", err=True)


def _export(scenario: Scenario, file: Path, vehicle: str | None) -> None:
    from formation_scenario.mission_files import MissionFileError  # noqa: PLC0415 - this option alone needs it
    from gcs_formation.app.export_path import export_path  # noqa: PLC0415

    try:
        export_path(scenario, file, vehicle)
    except MissionFileError as error:
        fail(str(error))
    click.echo(f"wrote {file}", err=True)


@click.command(epilog=SCHEMA_EXAMPLES)
@click.option("--study", is_flag=True, help="The JSON schema of study files instead.")
@click.option("--markdown", is_flag=True, help="The reference of all keys as text instead.")
@PLUGINS
def schema(study: bool, markdown: bool, plugins: tuple[str, ...]) -> None:
    """Print the JSON schema of scenarios, for editors and validators."""
    from formation_scenario import ScenarioError  # noqa: PLC0415 - importing the keys takes a second
    from formation_scenario.registry import load_extensions  # noqa: PLC0415
    from formation_scenario.schema import scenario_reference, scenario_schema  # noqa: PLC0415

    try:
        registry = load_extensions(plugins)
    except ScenarioError as error:
        fail(str(error))

    if study:
        from gcs_formation.studies import study_schema  # noqa: PLC0415 - only this option needs it

        click.echo(json.dumps(study_schema(), indent=1, ensure_ascii=False))
        return
    text = (
        scenario_reference() if markdown else json.dumps(scenario_schema(registry), indent=1, ensure_ascii=False) + "\n"
    )
    click.echo(text, nl=False)


@click.command(epilog=TELL_USAGE, context_settings={"ignore_unknown_options": True})  # "-3" is a number
@click.argument("run_dir", type=click.Path(path_type=Path))
@click.argument("order", nargs=-1, required=True)
def tell(run_dir: Path, order: tuple[str, ...]) -> None:
    """Give the flight that records into RUN_DIR an ORDER, and print what came of it; `status`: ask how it is."""
    text = " ".join(order)
    try:
        if text == STATUS:
            text = f"{STATUS} {shutil.get_terminal_size().columns}"
        else:
            read_order(text, (STATUS,))
        answer = give_order(run_dir, text)
    except OrderError as error:
        fail(str(error))
    except NothingRunningError as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    if not answer.accepted and UNKNOWN_SHAPE in answer.text:
        fail(answer.text)  # which names there are, the flight knows: extensions have shapes too
    click.echo(answer.text, err=not answer.accepted)
    sys.exit(Status.FINE if answer.accepted else Status.EXPECTATION_BROKEN)


@click.command(epilog=REPORT_EXAMPLES)
@click.argument("run_dir", type=click.Path(path_type=Path))
@click.option(
    "--format",
    "formats",
    type=click.Choice(FORMATS),
    multiple=True,
    help="Write figures/*.svg or *.pdf too, for a paper (repeatable); *.png is written in any case.",
)
@PLUGINS
def report(run_dir: Path, formats: tuple[str, ...], plugins: tuple[str, ...]) -> None:
    """Draw the figures of a run or a study, and one self-contained report.html; of a killed one, what there is."""
    from formation_scenario import ScenarioError  # noqa: PLC0415 - `tell` starts faster without figures
    from gcs_formation.report.page import write_report  # noqa: PLC0415
    from gcs_formation.studies.dataset import STUDY  # noqa: PLC0415
    from gcs_formation.studies.report import write_study_report  # noqa: PLC0415

    try:
        if (run_dir / STUDY).is_file():
            page = write_study_report(run_dir)
        else:
            page = write_report(run_dir, lambda text: click.echo(f"missing: {text}", err=True), plugins, formats)
    except (RecordError, ScenarioError) as error:
        fail(str(error))
    click.echo(f"wrote {page}")

"""`gcs-formation signing`: key files, and vehicles that are given a key or have it taken away."""

from __future__ import annotations

from pathlib import Path

import click

from airlink.cli import Command, Status, examples, fail, interruptible, tell
from airlink.signing.key import KeyFileError, write_new_key
from gcs_formation.cli import OVERRIDES, PLUGINS

EXAMPLES = examples(
    "gcs-formation signing key link.key           writes a new key; name it in links.default.signing.key_file",
    "gcs-formation signing setup real.yaml        gives it to the vehicles, over loopback",
    "gcs-formation signing setup real.yaml --cable  over serial lines, which are cables and no radios",
    "gcs-formation signing remove real.yaml       takes it away from them",
)


@click.group(cls=click.Group, epilog=EXAMPLES, context_settings={"help_option_names": ["-h", "--help"]})
def signing() -> None:
    """Keys of signed links (MAVLink 2): a key in a file, and vehicles that have it."""


@signing.command(cls=Command)
@click.argument("file", type=click.Path(path_type=Path))
def key(file: Path) -> None:
    """Write a new key into FILE, which only you can read. Overwrites nothing."""
    try:
        write_new_key(file)
    except KeyFileError as error:
        fail(str(error))
    tell(f"wrote {file}; next: links.default.signing.key_file, then gcs-formation signing setup SCENARIO")


def _vehicles(_context: click.Context, _parameter: click.Parameter, text: str | None) -> tuple[int, ...]:
    names = () if text is None else tuple(name.strip() for name in text.split(","))
    for name in names:
        if not name.isdecimal():
            raise click.BadParameter(f"found '{name}'; allowed: system ids such as 2,3")
    return tuple(int(name) for name in names)


VEHICLES = click.option(
    "--vehicles", "only", metavar="IDS", callback=_vehicles, help="Only these: 2,3.  [default: all of the scenario's]"
)


@signing.command(cls=Command)
@click.argument("scenario", type=click.Path(path_type=Path))
@VEHICLES
@click.option("--cable", is_flag=True, help="Serial lines are cables: no one listens while the key is sent.")
@OVERRIDES
@PLUGINS
def setup(
    scenario: Path, only: tuple[int, ...], cable: bool, overrides: tuple[str, ...], plugins: tuple[str, ...]
) -> None:
    """Give the vehicles of SCENARIO their link's key (SETUP_SIGNING). They must be disarmed.

    The key is sent as it is, so it goes over loopback or a cable only.
    """
    _ask(scenario, only, overrides, plugins, remove=False, cable=cable)


@signing.command(cls=Command)
@click.argument("scenario", type=click.Path(path_type=Path))
@VEHICLES
@OVERRIDES
@PLUGINS
def remove(scenario: Path, only: tuple[int, ...], overrides: tuple[str, ...], plugins: tuple[str, ...]) -> None:
    """Take the key away from the vehicles of SCENARIO: they take unsigned frames again."""
    _ask(scenario, only, overrides, plugins, remove=True, cable=False)


def _ask(
    scenario: Path,
    only: tuple[int, ...],
    overrides: tuple[str, ...],
    plugins: tuple[str, ...],
    *,
    remove: bool,
    cable: bool,
) -> None:
    from formation_scenario import ScenarioError  # noqa: PLC0415 - `signing key` starts faster without
    from gcs_formation.app.key_setup import set_up_keys  # noqa: PLC0415
    from gcs_formation.cli.no_flight import load  # noqa: PLC0415
    from gcs_formation.errors import RunAbortedError  # noqa: PLC0415

    loaded = load(scenario, overrides, plugins)
    known = [each.id for each in loaded.vehicles]
    for each in only:
        if each not in known:
            fail(f"--vehicles: found {each}; allowed: the scenario's vehicles, {', '.join(map(str, known))}")
    try:
        with interruptible():
            done = set_up_keys(loaded, only, remove=remove, cable=cable)
    except ScenarioError as error:
        fail(str(error))
    except RunAbortedError as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    except KeyboardInterrupt:
        fail("interrupted", Status.INTERRUPTED)
    what = "signs no more" if remove else "signs with the key and refuses what isn't signed"
    for each in done:
        tell(f"vehicle {each} {what}")

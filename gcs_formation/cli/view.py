"""`gcs-formation view`, and the option `--view` of `run` and `fly`.

What serves the page is imported when it is asked for: other flights don't wait for it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from airlink.cli import Status, examples, fail, say, tell
from airlink.endpoint import Address
from gcs_formation.cli import PLUGINS
from gcs_formation.errors import RecordError

if TYPE_CHECKING:
    from socket import socket

    from gcs_formation.app.viewer import Viewing
    from gcs_formation.view.access import Access
    from gcs_formation.view.tiles import Tiles

VIEW_EXAMPLES = examples(
    "gcs-formation view runs/quickstart           a flight that is over, or under way",
    "gcs-formation view flight.tlog               any MAVLink log",
    "gcs-formation view runs/quickstart --address 127.0.0.1:8080",
)
LOOPBACK = "127.0.0.1"
ANYWHERE = f"{LOOPBACK}:0"
"""A free port of this machine's own interface."""
MAX_PORT = 65535
SCENARIOS = (".yaml", ".yml")


class AddressType(click.ParamType[Address]):
    """HOST:PORT, or a port alone on this machine's own interface."""

    name = "host:port"

    def convert(self, value: str | Address, param: click.Parameter | None, ctx: click.Context | None) -> Address:
        """Parse it."""
        if isinstance(value, Address):
            return value
        host, _, port = value.rpartition(":")
        host = host.strip("[]") or LOOPBACK
        if not (port.isascii() and port.isdigit() and int(port) <= MAX_PORT):
            self.fail(f"found '{value}'; allowed: HOST:PORT, as 127.0.0.1:8080 or [::1]:8080", param, ctx)
        return Address(host, int(port))


class WithView(click.Command):
    """A command with `--view`, whose address may be left out before a scenario too."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Give `--view` its address where a scenario's file follows it."""
        for index, word in enumerate(args[:-1]):
            if word == "--view" and args[index + 1].endswith(SCENARIOS):
                args[index] = f"--view={ANYWHERE}"
        return super().parse_args(ctx, args)


ADDRESS = AddressType()
VIEW = click.option(
    "--view",
    type=ADDRESS,
    is_flag=False,
    flag_value=ANYWHERE,
    metavar="[HOST:PORT]",
    help="Show the flight in a browser: here, on a free port, unless given.",
)
VIEW_ORDERS = click.option(
    "--view-orders", is_flag=True, help="The page takes orders on other interfaces than this machine's too."
)


class TilesType(click.ParamType["Tiles"]):
    """The address of a map's tiles."""

    name = "url"

    def convert(self, value: str | Tiles, param: click.Parameter | None, ctx: click.Context | None) -> Tiles:
        """Parse it."""
        from gcs_formation.view.tiles import TileError, Tiles  # noqa: PLC0415

        if isinstance(value, Tiles):
            return value
        try:
            return Tiles.at(value)
        except TileError as error:
            self.fail(str(error), param, ctx)


TILES = click.option(
    "--view-tiles",
    "tiles",
    type=TilesType(),
    envvar="GCS_FORMATION_VIEW_TILES",
    metavar="https://HOST/{z}/{x}/{y}.png?key=KEY",
    show_envvar=True,
    help="Tiles of a map beneath the plan, which the browser fetches; without it, none are.",
)


def require_installed() -> None:
    """Exit if what the page needs isn't installed."""
    from gcs_formation.app.viewer import lacking  # noqa: PLC0415

    missing = lacking()
    if missing is not None:
        fail(missing)


def listening(address: Address, *, orders: bool) -> tuple[socket, Access]:
    """Return a socket that listens, and who may use it, or exit with the reason why there is none."""
    from gcs_formation.app.viewer import opened  # noqa: PLC0415

    require_installed()
    try:
        return opened(address, orders=orders)
    except OSError as error:
        why = error.strerror or str(error)
        sys.exit(say(f"cannot serve the page on {address}: {why}; allowed: a free port", Status.COULD_NOT_GO_ON))


def viewing(
    address: Address, directory: Path, plugins: tuple[str, ...], *, orders: bool, to_stderr: bool, tiles: Tiles | None
) -> Viewing:
    """Start the viewer of a flight, and print where it is."""
    from gcs_formation.app.viewer import Viewing  # noqa: PLC0415

    served, access = listening(address, orders=orders)
    started = Viewing(served, access, directory, plugins, tiles)
    tell(f"view {access.url}", err=to_stderr)
    return started


@click.command(epilog=VIEW_EXAMPLES)
@click.argument("recording", type=click.Path(path_type=Path, exists=True))
@click.option("--address", type=ADDRESS, default=ANYWHERE, help="HOST:PORT; default: here, on a free port.")
@VIEW_ORDERS
@TILES
@PLUGINS
def view(recording: Path, address: Address, view_orders: bool, tiles: Tiles | None, plugins: tuple[str, ...]) -> None:
    """Replay RECORDING in a browser: the directory of a run, also of one under way, or a MAVLink log (.tlog)."""
    import asyncio  # noqa: PLC0415

    require_installed()
    from gcs_formation.app.viewer import OrdersTo  # noqa: PLC0415 - after it is known that everything is installed
    from gcs_formation.view.log import LogRecording  # noqa: PLC0415
    from gcs_formation.view.run import RunRecording  # noqa: PLC0415
    from gcs_formation.view.server import Viewer  # noqa: PLC0415
    from gcs_formation.view.serving import serve  # noqa: PLC0415

    try:
        shown = RunRecording(recording, plugins) if recording.is_dir() else LogRecording(recording)
    except RecordError as error:
        fail(str(error))
    served, access = listening(address, orders=view_orders)
    orders = OrdersTo(recording) if isinstance(shown, RunRecording) else None
    tell(f"view {access.url}")
    tell("Ctrl-C ends it", err=True)
    with served:
        asyncio.run(serve(Viewer(shown, access, orders, tiles), served))

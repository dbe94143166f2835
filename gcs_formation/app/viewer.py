"""The viewer of a flight: a process of its own, which reads the record and serves the page.

`run --view` and `fly --view` start it (`Viewing`); it is `python -m gcs_formation.app.viewer`. Nothing passes from it
to the station but orders, through the run directory's socket. It reads from its standard input where to serve, and
what, and by its end that the station has gone. It stays while a browser looks on.
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Self

from airlink.cli import same_modules
from airlink.endpoint import Address
from formation_scenario.orders import Answer
from gcs_formation.app.order_socket import SOCKET, ask
from gcs_formation.errors import RecordError
from gcs_formation.view.access import Access, is_loopback
from gcs_formation.view.listening import listening_socket
from gcs_formation.view.tiles import Tiles

NICE = 10
"""The viewer yields to everything else on the machine: the station's ticks come first."""
ENDS_S = 1.0
"""How long a viewer may take to end that no one looks at, s; others go on until their browsers have left."""
NEEDED = ("starlette", "uvicorn")
LACKS = "found no {}, which the page needs; allowed: pip install 'gcs-formation[view]'"


def lacking() -> str | None:
    """Return what isn't installed that the page needs, in words; None if all is there."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    return LACKS.format(" and no ".join(missing)) if missing else None


def opened(address: Address, *, orders: bool) -> tuple[socket.socket, Access]:
    """Return a socket that listens there, and the access by it; orders are taken on loopback, or if asked for.

    Raises:
        OSError: the port is taken, or the address isn't this machine's.
    """
    listening = listening_socket(address.host, address.port)
    bound = Address(address.host, listening.getsockname()[1])
    return listening, Access(bound, orders=orders or is_loopback(address.host))


@dataclass(frozen=True)
class OrdersTo:
    """Orders to the flight that records into a directory."""

    directory: Path

    @property
    def available(self) -> bool:
        """Whether a flight takes them."""
        return (self.directory / SOCKET).exists()

    def __call__(self, line: str) -> Answer:
        """Give an order; return the flight's answer."""
        return ask(self.directory, line)


class Viewing:
    """A viewer's process, from before the flight until it ends by itself."""

    def __init__(
        self,
        listening: socket.socket,
        access: Access,
        directory: Path,
        plugins: tuple[str, ...],
        tiles: Tiles | None = None,
    ) -> None:
        """Start it on a socket that listens; it serves when `begin` says that the record is open."""
        self._directory = directory
        command = [sys.executable, "-m", __name__]
        keep = listening.fileno()
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(keep,),
            env=os.environ | same_modules(),
            start_new_session=True,  # Ctrl-C is for the flight; the viewer shows its end
        )
        self._write({"fd": keep, "host": access.address.host, "port": access.address.port, "token": access.token,
                     "orders": access.orders, "plugins": list(plugins),
                     "tiles": None if tiles is None else tiles.address})  # fmt: skip
        listening.close()

    def announce(self) -> None:
        """Say that the record is open."""
        self._write({"run": str(self._directory.absolute())})

    def _write(self, line: dict[str, object]) -> None:
        pipe = self._process.stdin
        if pipe is not None and self._process.poll() is None:
            with suppress(OSError):  # it was killed: the flight goes on
                pipe.write(json.dumps(line).encode() + b"\n")
                pipe.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Say that the flight is over; it ends when no browser looks on."""
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(ENDS_S)


def _over() -> Callable[[], bool]:
    """Return what tells whether the station has closed its end of our standard input."""
    os.set_blocking(sys.stdin.fileno(), False)

    def over() -> bool:
        try:
            return os.read(sys.stdin.fileno(), 1) == b""
        except BlockingIOError:
            return False

    return over


def main() -> None:
    """Serve the flight that standard input names."""
    os.nice(NICE)
    with open(sys.stdin.fileno(), "rb", buffering=0, closefd=False) as lines:
        head, run = json.loads(lines.readline()), lines.readline()
    if not run:
        return  # the flight never began
    from gcs_formation.view.run import RunRecording  # noqa: PLC0415 - after the first line, so that no caller waits
    from gcs_formation.view.server import Viewer  # noqa: PLC0415
    from gcs_formation.view.serving import serve  # noqa: PLC0415

    directory = Path(json.loads(run)["run"])
    try:
        recording = RunRecording(directory, tuple(head["plugins"]))
    except RecordError:
        return
    access = Access(Address(head["host"], head["port"]), orders=head["orders"], token=head["token"])
    with socket.socket(fileno=head["fd"]) as listening:
        tiles = None if head["tiles"] is None else Tiles.at(head["tiles"])
        asyncio.run(serve(Viewer(recording, access, OrdersTo(directory), tiles), listening, _over()))


if __name__ == "__main__":
    main()

"""Orders to a running flight: a line to a Unix socket in its run directory, answered by a line of JSON."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Self

from airlink.host_system import short_path
from formation_scenario.orders import MAX_LETTERS, Answer
from gcs_formation.errors import NothingRunningError

SOCKET = "orders.sock"
STATUS = "status"
"""Asks for a status page. Not an order, so a scenario can't plan it."""
CHECK = "check"
"""Before an order: asks what the answer would be."""
LINK = "link"
"""Before JSON with the keys of `links.changes`: impairs links of a `run`."""
MAX_BYTES = 1000
MAX_CALLERS = 8
"""Beyond this the oldest connection is dropped: a caller sends its order at once."""
ANSWER_S = 10.0
"""Longest wait for an answer; a running flight answers within a tick."""

Take = Callable[[str], Answer]


class OrderSocket:
    """Takes orders while it is entered; never blocks."""

    def __init__(self, directory: Path, take: Take) -> None:
        """Pass every order to `take`, and send its answer."""
        self._directory = directory
        self._take = take
        self._listening: socket.socket | None = None
        self._callers: dict[socket.socket, bytes] = {}
        """Bytes received from each caller, oldest caller first."""

    def __enter__(self) -> Self:
        """Start listening; if that fails, the flight goes on without orders."""
        with suppress(OSError), short_path(self._directory) as short:
            path = short / SOCKET
            with suppress(FileNotFoundError):
                path.unlink()
            opened = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            opened.setblocking(False)
            opened.bind(str(path))
            path.chmod(0o600)
            opened.listen(MAX_CALLERS)
            self._listening = opened
        return self

    def __exit__(self, *_: object) -> None:
        for opened in (*self._callers, *([self._listening] if self._listening else [])):
            opened.close()
        with suppress(OSError):
            (self._directory / SOCKET).unlink()

    def poll(self) -> None:
        """Answer the orders that have arrived."""
        if self._listening is None:
            return
        for caller in list(self._callers):
            self._listen_to(caller)
        with suppress(OSError):  # no caller waits, or too many files are open: try again later
            for _ in range(MAX_CALLERS):
                caller, _ = self._listening.accept()
                caller.setblocking(False)
                if len(self._callers) == MAX_CALLERS:
                    self._drop(next(iter(self._callers)))
                self._callers[caller] = b""
                self._listen_to(caller)

    def _listen_to(self, caller: socket.socket) -> None:
        try:
            received = caller.recv(MAX_BYTES)
        except BlockingIOError:
            return
        except OSError:
            received = b""
        request = self._callers[caller] + received
        if b"\n" in request:
            self._answer(caller, request.partition(b"\n")[0])
        elif received and len(request) < MAX_BYTES:
            self._callers[caller] = request
            return
        self._drop(caller)

    def _drop(self, caller: socket.socket) -> None:
        del self._callers[caller]
        caller.close()

    def _answer(self, caller: socket.socket, line: bytes) -> None:
        answer = self._take(line.decode(errors="replace"))
        with suppress(OSError):
            caller.sendall(json.dumps(answer._asdict(), ensure_ascii=False).encode() + b"\n")


def tell(directory: Path, order: str) -> Answer:
    """Give an order to the flight that records into `directory`; return its answer.

    Raises:
        NothingRunningError: no flight answers there.
    """
    return ask(directory, " ".join(order.split())[: MAX_LETTERS + 1])


def ask(directory: Path, line: str) -> Answer:
    """Send a line to the flight that records into `directory`; return its answer.

    Raises:
        NothingRunningError: no flight answers there.
    """
    try:
        with short_path(directory) as short, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
            caller.settimeout(ANSWER_S)
            caller.connect(str(short / SOCKET))
            caller.sendall(line.encode() + b"\n")
            with caller.makefile("rb") as answers:
                return Answer(**json.loads(answers.readline()))
    except (OSError, ValueError, TypeError) as error:
        raise NothingRunningError(
            f"no flight answers in {directory}; allowed: the directory of a running one"
        ) from error

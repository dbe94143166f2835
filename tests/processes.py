"""Helpers for tests of whole programs: processes, ports and waiting."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

LIMIT_S = 300
"""How long a busy machine may take for what usually takes seconds."""
STATION = [sys.executable, "-m", "gcs_formation"]
VEHICLES = [sys.executable, "-m", "sim_vehicles"]


def free_ports(count: int) -> list[int]:
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


def free_port() -> int:
    return free_ports(1)[0]


@contextmanager
def started(command: Sequence[str | Path]) -> Generator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=_default_interrupts,  # noqa: PLW1509 - no threads here
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def _default_interrupts() -> None:
    """Restore the handling of Ctrl-C, which a shell's background jobs ignore and their children inherit."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def wait_for(condition: Callable[[], object], within_s: float = LIMIT_S, every_s: float = 0.05) -> None:
    """Wait in real time for something in another process, which no clock of ours can advance."""
    deadline = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < deadline, f"not so within {within_s:g} s"
        time.sleep(every_s)


def events_of(run: Path) -> list[dict[str, Any]]:
    """Return the events that a run has recorded so far, without an incomplete last line."""
    file = run / "events.jsonl"
    lines = file.read_text().splitlines(keepends=True) if file.exists() else []
    return [json.loads(line) for line in lines if line.endswith("\n")]


def wait_for_event(run: Path, text: str, after: int = 0, within_s: float = LIMIT_S, **fields: str) -> dict[str, Any]:
    """Wait until an event of this text and these fields is recorded after the first `after` ones; return it."""

    def those() -> list[dict[str, Any]]:
        return [each for each in events_of(run)[after:] if fields.items() | {("text", text)} <= each.items()]

    wait_for(those, within_s)
    return those()[0]

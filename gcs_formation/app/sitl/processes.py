"""Starts simulators, each in a directory of its own, notices one that ends, and ends each by its own process."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Generator, Iterable, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Final

from airlink.endpoint import VehicleId
from airlink.host_system import STATUS_OF_PROCESS
from gcs_formation.app.sitl import guard
from gcs_formation.app.sitl.fleet import Simulated
from gcs_formation.app.sitl.simulator import SimulatorError

DIRECTORY, OUTPUT = "simulators", "output.txt"
LAST_BYTES: Final = 300
MAX_NUMBERS: Final = 200
"""Of simulators that are distinguished by their numbers."""


@dataclass(frozen=True)
class Running:
    """A simulator's process."""

    identity: VehicleId
    process: subprocess.Popen[bytes]
    directory: Path

    @property
    def ended(self) -> str:
        """In words how it has ended; "" while it runs."""
        if self.process.poll() is None:
            return ""
        printed = (self.directory / OUTPUT).read_bytes()[-LAST_BYTES:].decode(errors="replace").strip()
        last = printed.splitlines()[-1] if printed else f"exit status {self.process.returncode}"
        return f"vehicle {self.identity}: its simulator has ended: {last} ({self.directory / OUTPUT})"


@contextmanager
def running(fleet: Sequence[Simulated], out: Path) -> Generator[list[Running]]:
    """Run the simulators in `out`, and end them, the newest first; a process of its own does if this one is killed.

    Raises:
        SimulatorError: a program can't be executed.
    """
    shutil.rmtree(out / DIRECTORY, ignore_errors=True)
    with ExitStack() as stack:
        guarded = stack.enter_context(_guard())
        started = list[Running]()
        for each in fleet:
            started.append(stack.enter_context(_started(each, out / DIRECTORY / str(each.craft.system))))
            guarded.write(f"{started[-1].process.pid}\n")
            guarded.flush()
        yield started


@contextmanager
def _guard() -> Generator[IO[str]]:
    """Run the process that ends the simulators whose numbers it is given, should this one be killed."""
    command = [sys.executable, "-I", "-S", str(Path(guard.__file__)), STATUS_OF_PROCESS]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, text=True, process_group=0)
    assert process.stdin is not None
    try:
        yield process.stdin
    finally:  # while its input is open, so that it ends none
        process.kill()
        process.wait()
        process.stdin.close()


def ended(simulators: Iterable[Running]) -> str:
    """Return in words which simulator has ended; "" if all run."""
    return next(filter(None, (each.ended for each in simulators)), "")


@contextmanager
def _started(one: Simulated, directory: Path) -> Generator[Running]:
    directory.mkdir(parents=True)
    launch = one.simulator.launch(one.program, one.craft)
    for name, text in launch.files.items():
        (directory / name).write_text(text, encoding="utf-8")
    with (directory / OUTPUT).open("wb") as output:
        try:
            # A process group of its own: Ctrl-C reaches only us, so that the vehicles can be commanded to loiter first.
            # No session: Linux shares processors between sessions, whatever their niceness.
            process = subprocess.Popen(
                launch.command,
                cwd=directory,
                env=os.environ | dict(launch.variables),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                process_group=0,
            )
        except OSError as error:
            raise SimulatorError(f"can't run {launch.command[0]}: {error.strerror or error}") from error
        try:
            yield Running(one.identity, process, directory)
        finally:
            _end(process, waits=one.craft.stepped)


def _end(process: subprocess.Popen[bytes], *, waits: bool) -> None:
    """End a simulator; one that `waits` for its next step can't end by itself."""
    if waits:
        process.kill()
    else:
        process.terminate()
    try:
        process.wait(guard.END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def with_free_ports(fleet: Sequence[Simulated]) -> Sequence[Simulated]:
    """Return the simulators with numbers whose ports are free: another run may have started some.

    Raises:
        SimulatorError: a port that one needs is taken, whatever its number.
    """
    for further in range(0, MAX_NUMBERS, max(len(fleet), 1)):
        numbered = [replace(each, craft=replace(each.craft, number=each.craft.number + further)) for each in fleet]
        if not any(_taken(each) for each in numbered):
            return numbered
    each, port = next((each, port) for each in fleet if (port := _taken(each)))
    found = f"found port {port} taken, which vehicle {each.identity}'s simulator needs"
    raise SimulatorError(f"{found}; allowed: no other simulator of this number")


def _taken(one: Simulated) -> int:
    """Return a port that a simulator needs and another program has; 0 if all are free."""
    for kind, port in one.simulator.ports(one.craft):
        with socket.socket(socket.AF_INET, kind) as probe:
            # As simulators do: a connection that has just ended doesn't keep a port taken.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(kind == socket.SOCK_STREAM))
            try:
                probe.bind(("", port))
            except OSError:
                return port
    return 0

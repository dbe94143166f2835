"""Runs tests on mutants, each in a process of its own that is forked once all modules are loaded."""

import contextlib
import gc
import importlib
import os
import signal
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import pytest

from tests.mutation.imports import Imports, name_of
from tests.mutation.mutant import Finder, Mutant

PYTEST = (
    *("-x", "-q", "--assert=plain", "-p", "no:cacheprovider", "-p", "no:xdist"),
    *("-W", "ignore::pytest.PytestAssertRewriteWarning"),
)
"""Assertions stay plain: pytest's own import hook would stand before the one that brings the fault."""
MIN_LIMIT_S, TIMES_AS_LONG = 30.0, 8.0
"""A mutant that runs longer than both, the second as a multiple of the unchanged package, counts as seen."""
POLL_S = 0.02


def run(drawn: Sequence[Mutant], tests: Sequence[Path], marked: str, jobs: int) -> Iterator[tuple[Mutant, bool]]:
    """Run the tests on each mutant; yield it and whether it lives: all of them passed.

    Args:
        drawn: the mutants.
        tests: files of tests.
        marked: which tests of them, as pytest's `-m`.
        jobs: number of processes at once.

    Raises:
        RuntimeError: they don't pass on the unchanged package.
    """
    imports = Imports()
    for name in sorted(imports.needed_by(map(name_of, tests))):
        if not name.startswith("tests"):
            importlib.import_module(name)
    gc.freeze()
    again = {file: imports.that_need(name_of(file)) for file in {mutant.file for mutant in drawn}}
    start = time.monotonic()
    if status := os.waitstatus_to_exitcode(os.waitpid(_forked(None, (), ["-m", marked, *map(str, tests)]), 0)[1]):
        raise RuntimeError(f"the unchanged package doesn't pass its tests: pytest ended with status {status}")
    limit_s = max(MIN_LIMIT_S, TIMES_AS_LONG * (time.monotonic() - start))
    running, waiting = dict[int, tuple[Mutant, float]](), list(drawn)
    while running or waiting:
        while waiting and len(running) < jobs:
            mutant = waiting.pop(0)
            pid = _forked(mutant, again[mutant.file], ["-m", marked, *map(str, _soonest_first(mutant, tests))])
            running[pid] = mutant, time.monotonic() + limit_s
        pid, status = os.waitpid(-1, os.WNOHANG)
        if pid in running:
            yield running.pop(pid)[0], os.waitstatus_to_exitcode(status) == 0
        else:
            _kill_late_ones(running)
            time.sleep(POLL_S)


def _soonest_first(mutant: Mutant, tests: Sequence[Path]) -> list[Path]:
    """Return the tests with those first that are named after the mutant's module."""
    return sorted(tests, key=lambda file: mutant.file.stem not in file.stem)


def _kill_late_ones(running: dict[int, tuple[Mutant, float]]) -> None:
    for pid, (_, deadline) in running.items():
        if time.monotonic() > deadline:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(pid, signal.SIGKILL)


def _forget(module: str) -> None:
    """Let a module be loaded again, also by `from package import module`, which asks its package first."""
    package, _, name = module.rpartition(".")
    if package in sys.modules:
        vars(sys.modules[package]).pop(name, None)
    del sys.modules[module]


def _forked(mutant: Mutant | None, again: Iterable[str], tests: Sequence[str]) -> int:
    """Start pytest on a mutant in a process of its own, silently, `again` loaded again; return its process ID."""
    if pid := os.fork():
        return pid
    status = 1
    with contextlib.suppress(BaseException):
        os.setpgid(0, 0)
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nowhere, stream)
        for name in [each for each in sys.modules if each in again or each.startswith("tests.")]:
            _forget(name)
        if mutant is not None:
            sys.meta_path.insert(0, Finder(mutant))
        status = int(pytest.main([*PYTEST, *tests]))
    os._exit(status)

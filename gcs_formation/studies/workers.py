"""Flies tasks in processes of this machine. Each flight counts once, even if processes die."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker
from typing import Any, Self

from airlink.cli import SIGNALS, same_modules
from gcs_formation.studies.flight import Task, fly, lost

TRIES = 3
"""A flight isn't tried again after this many workers died while flying it."""
AHEAD = 2
"""Flights submitted for each worker: one in flight, one waiting."""


class Processes:
    """Processes of this machine, each reused for many flights."""

    where = ""

    def __init__(self, count: int) -> None:
        self._count = count

    def __enter__(self) -> Self:
        self._pool = self._new_pool()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Shut down the processes: at once if the study was given up."""
        processes = list(self._pool._processes.values()) if kind is not None else []
        self._pool.shutdown(wait=kind is None, cancel_futures=True)
        for process in processes:
            process.kill()

    def rows(self, tasks: deque[Task]) -> Iterator[dict[str, Any]]:
        """Yield the rows. A process that is killed breaks the pool, whichever of the submitted flights caused that.

        So each of these flights is flown again alone; one that always kills its process then fails alone.
        """
        flying, deaths, suspects = dict[Future[dict[str, Any]], Task](), Counter[int](), set[int]()
        while tasks or flying:
            while tasks and len(flying) < (1 if suspects else AHEAD * self._count):
                task = tasks.popleft()
                with _interrupts_deferred():
                    flying[self._pool.submit(fly, task)] = task
            done, _ = wait(flying, return_when=FIRST_COMPLETED)
            broken = [flying.pop(each) for each in done if isinstance(each.exception(), BrokenProcessPool)]
            ended = [future.result() for future in done if flying.pop(future, None) is not None]
            if broken:
                broken += flying.values()
                flying.clear()
                self._pool = self._new_pool()
                if len(broken) == 1:
                    ended += retried(broken[0], deaths, tasks)
                else:
                    suspects.update(task.planned.flight for task in broken)
                    tasks.extendleft(broken)
            suspects.difference_update(row["flight"] for row in ended)
            yield from ended

    def _new_pool(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["gcs_formation.studies.flight"])
        with _interrupts_deferred(), _environment(same_modules()):
            forkserver.ensure_running()
        return ProcessPoolExecutor(self._count, context, _begin)


@contextmanager
def _interrupts_deferred() -> Generator[None]:
    """Defer Ctrl-C while a process starts: it would reach the new process too, or leave it without its parent."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held = list[int]()
    before = {number: signal.signal(number, lambda number, _: held.append(number)) for number in SIGNALS}
    resource_tracker.ensure_running()  # this would unblock the signal later
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # inherited by the new process
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in before.items():
            signal.signal(number, handler)
    for first in held[:1]:
        signal.raise_signal(first)


@contextmanager
def _environment(variables: dict[str, str]) -> Generator[None]:
    """Set environment variables for a while: a process started meanwhile has them."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _begin() -> None:
    """Leave Ctrl-C to the process that collects the rows, and exit when that process does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def retried(task: Task, deaths: Counter[int], tasks: deque[Task]) -> Iterator[dict[str, Any]]:
    """Queue a task whose worker died at the front, or yield its row after `TRIES` deaths."""
    deaths[task.planned.flight] += 1
    if deaths[task.planned.flight] < TRIES:
        tasks.appendleft(task)
    else:
        yield lost(task, f"the process that flew it was ended from outside, {TRIES} times")

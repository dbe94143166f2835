"""Flies tasks in processes of this machine or on a Dask cluster. Each flight counts once, even if workers die."""

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
from importlib import import_module
from importlib.metadata import version
from multiprocessing import forkserver, resource_tracker
from time import sleep
from typing import Any, Self, TypeAlias

from airlink.cli import SIGNALS, same_modules
from airlink.clock import Stopwatch
from gcs_formation.errors import RunAbortedError
from gcs_formation.studies.flight import VERSION, Task, fly, lost

TRIES = 3
"""A flight isn't tried again after this many workers died while flying it."""
AHEAD = 2
"""Flights submitted for each worker: one in flight, one waiting."""
ANSWER_S = 10.0
"""Time in which a scheduler must answer."""
GONE_S = 60.0
"""Time for which a scheduler may be without workers."""
ASKED_EVERY_S, POLL_S = 1.0, 0.01


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
                    ended += _retried(broken[0], deaths, tasks)
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


def _retried(task: Task, deaths: Counter[int], tasks: deque[Task]) -> Iterator[dict[str, Any]]:
    """Queue a task whose worker died at the front, or yield its row after `TRIES` deaths."""
    deaths[task.planned.flight] += 1
    if deaths[task.planned.flight] < TRIES:
        tasks.appendleft(task)
    else:
        yield lost(task, f"the process that flew it was ended from outside, {TRIES} times")


class Cluster:
    """The workers of a Dask scheduler (docs.dask.org, `distributed`)."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._flown_at_a_time = 0
        self._asked: Stopwatch | None = None
        self._seen = Stopwatch()

    def __enter__(self) -> Self:
        """Connect; RunAbortedError: `distributed` isn't installed, or no scheduler answers."""
        try:
            connect: Any = import_module("distributed").Client
        except ImportError as error:
            raise RunAbortedError("--scheduler needs Dask: pip install 'gcs-formation[study]'") from error
        try:
            self._client = connect(self._address, timeout=ANSWER_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise RunAbortedError(f"no Dask scheduler answers at {self._address}: {error}") from error
        self._client._timeout = GONE_S  # time for which it tries to reconnect
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._client.close()

    @property
    def where(self) -> str:
        """The address of Dask's dashboard, in words."""
        return f"Dask's dashboard: {self._client.dashboard_link}"

    def rows(self, tasks: deque[Task]) -> Iterator[dict[str, Any]]:
        """Yield the rows. Dask repeats a flight whose worker died; we repeat one that a restarted scheduler lost.

        Raises:
            RunAbortedError: a worker has another version; or the scheduler, or its last worker, is gone for good.
        """
        from distributed.client import FutureCancelledError  # noqa: PLC0415 - an extra
        from distributed.scheduler import KilledWorker  # noqa: PLC0415

        self._check_versions()
        flying, deaths = dict[Any, Task](), Counter[int]()
        ended = import_module("distributed").as_completed(with_results=False, raise_errors=False)
        while tasks or flying:
            while tasks and len(flying) < AHEAD * self._threads():
                task = tasks.popleft()
                future = self._client.submit(fly, task, pure=False, retries=TRIES)
                flying[future] = task
                ended.add(future)
            if not ended.has_ready():
                self._wait_a_little()
                continue
            future = next(ended)
            task = flying.pop(future)
            try:
                yield future.result()
            except FutureCancelledError:
                tasks.appendleft(task)
            except KilledWorker:
                yield from _retried(task, deaths, tasks)

    def _wait_a_little(self) -> None:
        """Wait a moment for results; RunAbortedError: there has been no worker for too long."""
        if self._client.status == "closed" or (not self._threads() and self._seen.wall_s > GONE_S):
            raise RunAbortedError(f"the Dask scheduler at {self._address}, or its last worker, is gone")
        sleep(POLL_S)

    def _threads(self) -> int:
        """Return how many flights the workers fly at a time, at most a second old; 0 without a scheduler."""
        if self._client.status != "running":
            return 0
        if self._asked is None or self._asked.wall_s > ASKED_EVERY_S:
            self._flown_at_a_time, self._asked = sum(self._client.nthreads().values()), Stopwatch()
        if self._flown_at_a_time:
            self._seen = Stopwatch()
        return self._flown_at_a_time

    def _check_versions(self) -> None:
        """Refuse a cluster without workers, or with a worker of another version, whose flights would differ."""
        found: dict[str, str] = self._client.run(version, "gcs-formation")
        if not found:
            raise RunAbortedError(f"the Dask scheduler at {self._address} has no workers")
        for worker, theirs in found.items():
            if theirs != VERSION:
                raise RunAbortedError(f"the Dask worker {worker} has gcs-formation {theirs}; here it is {VERSION}")


Workers: TypeAlias = Processes | Cluster
"""Flies tasks, in whatever order; the caller may add some meanwhile. Left with an error, it gives up what isn't flown.

`where`, known once they are started, says where else their work can be watched; "" for nowhere.
"""

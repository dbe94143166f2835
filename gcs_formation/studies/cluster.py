"""Flies tasks on the workers of a Dask scheduler, which may be other machines that share no disk with this one."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import sleep
from typing import Any, Self, TypeAlias

from airlink.cli import COMPILED
from airlink.clock import Stopwatch
from airlink.installed import PACKAGE
from gcs_formation.errors import RunAbortedError
from gcs_formation.studies.flight import VERSION, Task
from gcs_formation.studies.records import keep
from gcs_formation.studies.shipment import Flown, Lacking, Shipment, Worker, fly_shipped, forget, receive
from gcs_formation.studies.workers import AHEAD, TRIES, Processes, retried

ANSWER_S = 10.0
"""Time in which a scheduler must answer."""
GONE_S = 60.0
"""Time for which a scheduler may be without workers."""
ASKED_EVERY_S, POLL_S = 1.0, 0.01
UNREACHED = (OSError, TimeoutError)
"""Errors of a worker or a scheduler that is gone, or can't be reached at the moment."""


class Cluster:
    """The workers of a Dask scheduler (docs.dask.org, `distributed`)."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._flown_at_a_time = 0
        self._asked: Stopwatch | None = None
        self._seen = Stopwatch()
        self._shipment: Shipment | None = None

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
        if self._shipment is not None and self._client.status == "running":
            with suppress(*UNREACHED):
                self._on_workers(None, forget, self._shipment.digest)
        self._client.close()

    @property
    def where(self) -> str:
        """The address of Dask's dashboard, in words."""
        return f"Dask's dashboard: {self._client.dashboard_link}"

    def rows(self, tasks: deque[Task]) -> Iterator[dict[str, Any]]:
        """Yield the rows, each once its record is kept.

        Dask repeats a flight whose worker died; we repeat one that a restarted scheduler lost.

        Raises:
            RunAbortedError: a worker can't fly the study; or the scheduler, or its last worker, is gone for good.
        """
        from distributed.client import FutureCancelledError  # noqa: PLC0415 - an extra
        from distributed.scheduler import KilledWorker  # noqa: PLC0415

        flying, deaths = dict[Any, Task](), Counter[int]()
        ended = import_module("distributed").as_completed(with_results=False, raise_errors=False)
        while tasks or flying:
            while tasks and len(flying) < AHEAD * self._threads():
                task = tasks.popleft()
                future = self._submit(task)
                flying[future] = task
                ended.add(future)
            if not ended.has_ready():
                self._wait_a_little()
                continue
            future = next(ended)
            task = flying.pop(future)
            try:
                yield from self._kept(task, tasks, future.result())
            except FutureCancelledError:
                tasks.appendleft(task)
            except KilledWorker:
                yield from retried(task, deaths, tasks)

    def _submit(self, task: Task) -> Any:  # noqa: ANN401 - Dask's future
        """Submit a flight; the first of a study after all workers were sent what it needs."""
        if self._shipment is None or not self._shipment.is_for(task):
            self._shipment = Shipment(task.study, task.base)
            self._send(None)
        job = task.planned, task.directory, self._shipment.digest
        return self._client.submit(fly_shipped, *job, pure=False, retries=TRIES)

    def _kept(self, task: Task, tasks: deque[Task], flown: Flown | Lacking) -> Iterator[dict[str, Any]]:
        """Yield a flight's row when its record is kept; queue it again if its worker lacked what it needs."""
        if isinstance(flown, Lacking):
            tasks.appendleft(task)
            with suppress(*UNREACHED):
                self._send([flown.worker])
            return
        if task.directory is not None:
            keep(flown.record, Path(task.directory))
        yield flown.row

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

    def _send(self, workers: Sequence[str] | None) -> None:
        """Send the study to workers, by default to all; one that can't fly it is refused, as its flights would differ.

        Raises:
            RunAbortedError: a worker has another version, isn't compiled, or lacks an extension.
        """
        assert self._shipment is not None
        for worker, theirs in self._on_workers(workers, version, PACKAGE).items():
            if theirs != version(PACKAGE):
                has = "no gcs-formation" if isinstance(theirs, PackageNotFoundError) else f"gcs-formation {theirs}"
                raise RunAbortedError(f"the Dask worker {worker} has {has}; here it is {VERSION}")
        sent = self._shipment.content, self._shipment.digest
        for worker, theirs in self._on_workers(workers, receive, *sent).items():
            if (wrong := _unfit(theirs)) is not None:
                raise RunAbortedError(f"the Dask worker {worker} {wrong}")

    def _on_workers(self, workers: Sequence[str] | None, call: Callable[..., Any], *given: object) -> dict[str, Any]:
        """Return what each worker answers to a call, or raises; without those that can't be reached any more.

        Raises:
            RunAbortedError: there is no worker.
        """
        found: dict[str, Any] = self._client.run(call, *given, workers=workers, on_error="return")
        if not found and workers is None:
            raise RunAbortedError(f"the Dask scheduler at {self._address} has no workers")
        return {worker: theirs for worker, theirs in found.items() if not isinstance(theirs, UNREACHED)}


def _unfit(found: Worker | Exception) -> str | None:
    """Return why a worker's flights would differ from those here, or couldn't be flown; None if it is fit."""
    if isinstance(found, Exception):
        return f"has gcs-formation {VERSION} of another tree: {type(found).__name__}: {found}"
    if found.version != VERSION:
        return f"has gcs-formation {found.version}; here it is {VERSION}"
    if COMPILED and not found.compiled:
        return f"has gcs-formation {VERSION} without its compiled modules; here it is compiled"
    return f"can't fly the study: {found.wrong}" if found.wrong else None


Workers: TypeAlias = Processes | Cluster
"""Flies tasks, in whatever order; the caller may add some meanwhile. Left with an error, it gives up what isn't flown.

`where`, known once they are started, says where else their work can be watched; "" for nowhere.
"""

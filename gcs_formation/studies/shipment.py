"""What a study's flights need, on its way to a worker on another machine; and a flight there.

A worker may share no disk with the study's process. It is sent everything once: the study, its scenario, what
extensions register (by the content of their files) and the files that keys name. It unpacks them below its own
directory, in a folder named by their hash, and each flight there reads them from it. A worker that doesn't have the
folder, because it came later or was started again, says so and is sent everything then. So nothing depends on what a
scheduler remembers.
"""

from __future__ import annotations

import hashlib
import pickle
import shutil
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from airlink.cli import COMPILED
from formation_scenario import ScenarioError
from formation_scenario.named_files import below, copies_below
from gcs_formation.errors import RunAbortedError
from gcs_formation.studies.flight import VERSION, Task, fly
from gcs_formation.studies.plan import Planned
from gcs_formation.studies.records import Record, is_url, packed

if TYPE_CHECKING:
    from formation_scenario import Scenario
    from gcs_formation.studies import Study

ORDERS, FILES = "study.pickle", "files"


class Shipment:
    """A study, its scenario, and the content of everything that they name, packed once."""

    def __init__(self, study: Study, base: Mapping[Any, Any] | Scenario) -> None:
        """Pack them; RunAbortedError: a file can't be read any more."""
        self.study, self.base = study, base
        try:
            files = {below(file).as_posix(): file.read_bytes() for file in study.files}
        except OSError as error:
            raise RunAbortedError(f"cannot read {error.filename}: {error.strerror or error}") from error
        self.content = pickle.dumps((pickle.dumps((study, base)), files))
        self.digest = hashlib.sha256(self.content).hexdigest()

    def is_for(self, task: Task) -> bool:
        """Return whether a flight is one of this study."""
        return task.study is self.study and task.base is self.base


class Worker(NamedTuple):
    """What a worker is, as far as flights depend on it."""

    version: str
    compiled: bool
    wrong: str
    """Why it can't fly the study in words, such as an extension that it lacks; "" if it can."""


class Flown(NamedTuple):
    """A flight's row and its record."""

    row: dict[str, Any]
    record: Record


class Lacking(NamedTuple):
    """A worker's answer that it hasn't been sent what the flight needs."""

    worker: str


def receive(content: bytes, digest: str, dask_worker: Any = None) -> Worker:  # noqa: ANN401 - Dask passes the worker
    """Unpack a shipment on a worker, and return what the worker is."""
    wrong, unpacked = "", Path(dask_worker.local_directory) / digest
    orders, files = pickle.loads(content)
    try:
        pickle.loads(orders)
    except ScenarioError as error:
        return Worker(VERSION, COMPILED, str(error))
    fresh = unpacked.with_name(f"{digest}.new")
    shutil.rmtree(fresh, ignore_errors=True)
    try:
        for name, each in {ORDERS: orders, **{f"{FILES}/{name}": each for name, each in files.items()}}.items():
            (fresh / name).parent.mkdir(parents=True, exist_ok=True)
            (fresh / name).write_bytes(each)
        if not unpacked.exists():
            fresh.rename(unpacked)
    except OSError as error:
        wrong = f"it cannot write {unpacked}: {error.strerror or error}"
    return Worker(VERSION, COMPILED, wrong)


def forget(digest: str, dask_worker: Any = None) -> None:  # noqa: ANN401 - Dask passes the worker
    """Remove a shipment from a worker."""
    shutil.rmtree(Path(dask_worker.local_directory) / digest, ignore_errors=True)


def fly_shipped(planned: Planned, directory: str | None, digest: str) -> Flown | Lacking:
    """Fly a flight on a Dask worker by what was shipped to it; `directory` is where its record is kept in the end.

    Raises:
        RecordingError: its record can't be written.
    """
    from distributed import get_worker  # noqa: PLC0415 - an extra

    worker = get_worker()
    return fly_from(Path(worker.local_directory) / digest, planned, directory) or Lacking(worker.address)


def fly_from(unpacked: Path, planned: Planned, directory: str | None) -> Flown | None:
    """Fly a flight by a shipment, in the directory `unpacked`; None if there is none.

    Raises:
        RecordingError: its record can't be written.
    """
    try:
        study, base = pickle.loads((unpacked / ORDERS).read_bytes())
    except OSError:
        return None
    with TemporaryDirectory() as scratch, copies_below(unpacked / FILES):
        here = Path(scratch) / "record"
        kept = directory if directory is None or is_url(directory) else str(here)
        return Flown(fly(Task(planned, study, base, kept)), packed(here))

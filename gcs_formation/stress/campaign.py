"""Flying many seeds, several at a time, and saying which of them broke what."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from formation_scenario import Scenario
from gcs_formation.app.interrupt import Interrupts
from gcs_formation.app.options import RunOptions
from gcs_formation.app.progress import Silent
from gcs_formation.app.run import run
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.record.run_directory import EVENTS, TIMESERIES, TLOG
from gcs_formation.stress.invariants import broken, read_flown
from gcs_formation.stress.scenarios import USUAL, Severity, draw

REPEATED_EVERY = 10
"""One flight in so many is flown again and compared byte for byte."""


@dataclass(frozen=True)
class Trial:
    """One seed's flight."""

    seed: int
    flown_s: float
    broken: tuple[str, ...]
    """What wasn't so, in words."""


def fly_seed(seed: int, out: Path | None = None, severity: Severity = USUAL, *, overwrite: bool = False) -> Trial:
    """Fly one seed under the virtual clock and hold its record against the invariants.

    Args:
        seed: of the scenario and everything random in it.
        out: where the record is kept; by default nowhere.
        severity: of what is drawn.
        overwrite: whether an earlier run there may be replaced.

    Raises:
        RecordError: `out` can't be written.
    """
    scenario = draw(seed, severity)
    with tempfile.TemporaryDirectory() as scratch:
        directory = out or Path(scratch) / "flight"
        wrong = _fly(scenario, RunOptions(directory, "virtual", overwrite=overwrite))
        if not wrong and seed % REPEATED_EVERY == 0:
            again = Path(scratch) / "again"
            _fly(scenario, RunOptions(again, "virtual"))
            if _digest(directory) != _digest(again):
                wrong = ["repeatable: flown again, the record differs"]
    return Trial(seed, scenario.duration_s, tuple(wrong))


def fly_seeds(first: int, count: int, jobs: int, severity: Severity = USUAL) -> Iterator[Trial]:
    """Yield the flights of `count` seeds from `first` on, as they finish, `jobs` at a time."""
    seeds, fly = range(first, first + count), partial(fly_seed, severity=severity)
    if jobs == 1:
        yield from map(fly, seeds)
        return
    with ProcessPoolExecutor(jobs) as pool:
        for flight in as_completed(pool.submit(fly, seed) for seed in seeds):
            yield flight.result()


def _fly(scenario: Scenario, options: RunOptions) -> list[str]:
    try:
        run(scenario, options, Silent(), Interrupts())
    except RecordError:
        raise
    except RunAbortedError as error:
        return [f"completed: {error}"]
    except Exception as error:  # noqa: BLE001 - what this looks for; the seed says where to find it again
        return [f"completed: raised {error!r}"]
    return broken(read_flown(options.out, scenario))


def _digest(directory: Path) -> str:
    return hashlib.sha256(b"".join((directory / name).read_bytes() for name in (TLOG, TIMESERIES, EVENTS))).hexdigest()

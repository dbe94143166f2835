"""One flight for each law: the same scenario, seed and virtual clock, several at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path

from formation_scenario import Scenario, load_scenario
from gcs_formation.app.interrupt import Interrupts
from gcs_formation.app.options import RunOptions
from gcs_formation.app.progress import Silent
from gcs_formation.app.run import run
from gcs_formation.compare.laws import LAWS
from gcs_formation.errors import RunAbortedError
from gcs_formation.record.summary import Summary


@dataclass(frozen=True)
class Trial:
    """One law's flight, before it's flown."""

    law: str
    scenario: Scenario
    directory: Path


@dataclass(frozen=True)
class Flown:
    """One law's flight and its outcome."""

    law: str
    directory: Path
    summary: Summary | None = None
    aborted: str = ""
    """Why the run could not go on."""
    interrupted: bool = False


def trials(source: Path, overrides: tuple[str, ...], laws: tuple[str, ...], out: Path) -> list[Trial]:
    """Return a trial for each law, whose settings take precedence over `overrides`.

    Raises:
        ScenarioError: the scenario or an override is wrong.
    """
    return [Trial(law, load_scenario(source, (*overrides, *LAWS[law])), out / law) for law in laws]


def fly_trials(planned: list[Trial], until_s: float | None, jobs: int, interrupts: Interrupts) -> list[Flown]:
    """Fly `jobs` trials at a time; return the outcomes in the trials' order, without those that an interrupt prevented.

    Raises:
        RecordError: a run directory can't be written.
        RunAbortedError: a worker process was killed.
    """
    flown: Mapping[str, Flown] = {}
    for outcome in _flown(planned, until_s, jobs):
        flown = {**flown, outcome.law: outcome}
        if interrupts.count or outcome.interrupted:
            break
    return [flown[trial.law] for trial in planned if trial.law in flown]


def _flown(planned: list[Trial], until_s: float | None, jobs: int) -> Iterator[Flown]:
    if jobs == 1:
        for trial in planned:
            yield fly_trial(trial, until_s)
        return
    pool = ProcessPoolExecutor(jobs)
    try:
        waiting: list[Future[Flown]] = [pool.submit(fly_trial, trial, until_s) for trial in planned]
        for future in waiting:
            yield future.result()
    except BrokenProcessPool as error:
        raise RunAbortedError("a process that flew one of the laws was ended from outside") from error
    finally:
        pool.shutdown(cancel_futures=True)


def fly_trial(trial: Trial, until_s: float | None) -> Flown:
    """Fly one law under the virtual clock.

    Raises:
        RecordError: the run directory can't be written.
    """
    options = RunOptions(trial.directory, "virtual", until_s=until_s, overwrite=True)
    with Interrupts() as interrupts:
        try:
            summary = run(trial.scenario, options, Silent(), interrupts)
        except RunAbortedError as error:
            return Flown(trial.law, trial.directory, aborted=str(error), interrupted=interrupts.count > 0)
    return Flown(trial.law, trial.directory, summary, interrupted=interrupts.count > 0)

"""A stretch of a rehearsal: the scenario flown on the virtual clock with emulated vehicles, until it has shown enough.

It is flown by what `run` flies, so that nothing of the flight is modelled a second time. Its record is thrown away.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from airlink.cli import rare_garbage_collection
from airlink.clock import NANOSECONDS
from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario
from formation_scenario.extensions import RECORDER
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import in_memory, recorded_truth
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.session import Session
from gcs_formation.record.figures_of_merit import percentile
from gcs_formation.record.flight import FlightBuilder, RecordedFlight, tables
from gcs_formation.record.run_directory import SPOOL
from gcs_formation.record.timeseries import Spool

AXES: Final = "xyz"
SHARE: Final = 0.95
"""Share of the time within which an error stays that is reported."""
Enough = Callable[[Session], bool]
"""Returns whether a flight has shown what it is flown for; asked after every event."""


class Flown(NamedTuple):
    """What a flight has shown."""

    seconds: float
    """How long it was flown, take-off and run-in included, s."""
    scored_s: float
    """For how long of that errors were taken, s."""
    errors_m: Mapping[str, float]
    """The error that the worst follower stays within for `SHARE` of that, by truth, m; empty if none was taken."""
    failure: str | None
    """Why it couldn't go on; None if nothing failed."""


def flown(scenario: Scenario, enough: Enough, from_s: float = 0.0) -> Flown:
    """Fly a scenario until it has shown enough, or ends; take errors from a mission time on.

    Raises:
        RunAbortedError: a part from outside can't begin.
        ScenarioError: an endpoint or a key can't be used by emulated vehicles.
    """
    with tempfile.TemporaryDirectory() as scratch, rare_garbage_collection():
        options = RunOptions(Path(scratch) / "flight", "virtual", record="none")
        with in_memory(_unrecorded(scenario), options, Progress(), Interrupts()) as (session, run_until):
            run_until(lambda: session.attend() or enough(session))
        session.recorder.close()
        errors_m = _errors(session.scenario, session.recorder.path, from_s)
        seconds = session.clock.now() / NANOSECONDS
        return Flown(seconds, *errors_m, session.station.phase_machine.failure)


def _unrecorded(scenario: Scenario) -> Scenario:
    """Return a scenario without recorders from outside, which would take the rehearsal for a flight."""
    known = scenario.registered
    kept = {name: keys for name, keys in scenario.extensions.items() if known.get(name, RECORDER) is None}
    return scenario.model_copy(update={"extensions": kept})


def _errors(scenario: Scenario, directory: Path, from_s: float) -> tuple[float, dict[str, float]]:
    """Return for how long errors were taken, s, and how large they are, by axis."""
    recorded = _recorded(scenario, directory)
    window = recorded.window(from_s, np.inf)
    each = [recorded.scored(vehicle, window)[1] for vehicle in recorded.followers(scenario)]
    known = [[percentile(axis_m, 100.0 * SHARE) for axis_m in np.abs(errors).T] for errors in each if errors.size]
    if not known:
        return 0.0, {}
    worst_m = np.max(known, axis=0).tolist()
    return float(window.sum()) / scenario.law.rate_hz, dict(zip(AXES, worst_m, strict=True))


def _recorded(scenario: Scenario, directory: Path) -> RecordedFlight:
    truth, rows, builder = recorded_truth(directory), Spool(directory / SPOOL), FlightBuilder(scenario)
    none: dict[VehicleId, Array] = {each.vehicle_id: np.zeros((rows.ticks, 2)) for each in scenario.vehicles}
    for _ in builder.passing(tables(rows.blocks(), scenario, None if truth is None else truth.between, none)):
        pass
    return builder.flight()

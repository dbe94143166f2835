"""What flies a scenario with the user's simulators: under the real clock beside them, under the virtual one in step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from formation_scenario import Scenario
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run_options import ClockName, RunOptions
from gcs_formation.app.sitl.flight import run_simulated
from gcs_formation.app.sitl.stepped.flight import run_stepped
from gcs_formation.record.summary import Summary

Fly = Callable[[Scenario, RunOptions, Progress, Interrupts], Summary]


def with_simulators(programs: Mapping[str, Path], clock: ClockName) -> Fly:
    """Return what flies with programs, by their families, under a clock."""
    return partial(run_stepped if clock == "virtual" else run_simulated, programs)

"""A ground station that flies formations over MAVLink."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from formation_scenario import Scenario, ScenarioError, load_scenario
    from formation_scenario.orders import OrderError
    from gcs_formation.errors import NothingRunningError, RecordError, RunAbortedError, StationError
    from gcs_formation.notebook import FlightFigure
    from gcs_formation.python_api import Answer, Summary, run, study, tell
    from gcs_formation.stepped_flight import Flight

_HOME = {
    "Answer": "gcs_formation.python_api",
    "Flight": "gcs_formation.stepped_flight",
    "FlightFigure": "gcs_formation.notebook",
    "NothingRunningError": "gcs_formation.errors",
    "OrderError": "formation_scenario.orders",
    "RecordError": "gcs_formation.errors",
    "RunAbortedError": "gcs_formation.errors",
    "Scenario": "formation_scenario",
    "ScenarioError": "formation_scenario",
    "StationError": "gcs_formation.errors",
    "Summary": "gcs_formation.python_api",
    "load_scenario": "formation_scenario",
    "run": "gcs_formation.python_api",
    "study": "gcs_formation.python_api",
    "tell": "gcs_formation.python_api",
}


def __getattr__(name: str) -> object:
    """Import a name on first use, so that a program that only needs a delay margin doesn't load the rest."""
    if name not in _HOME:
        raise AttributeError(f"module 'gcs_formation' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    """Return what is here already and what is imported on first use."""
    return sorted({*globals(), *_HOME})


__all__ = [
    "Answer",
    "Flight",
    "FlightFigure",
    "NothingRunningError",
    "OrderError",
    "RecordError",
    "RunAbortedError",
    "Scenario",
    "ScenarioError",
    "StationError",
    "Summary",
    "load_scenario",
    "run",
    "study",
    "tell",
]

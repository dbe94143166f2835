"""Laws, filters, monitors, recorders and metrics of one's own: base classes, and the functions that register them.

A class is registered by a decorator, keeps its keys in an inner pydantic model `Keys`, and is used by a scenario that
names it. docs/own-law.md is the tutorial, docs/extensions.md says when each is made, called and left.
"""

from __future__ import annotations

from gcs_formation.control.plain_values import FollowerSlot, Setpoint, State
from gcs_formation.extend.base import Extension, FollowerLaw, FormationLaw, Metric, Monitor, Recorder, SetpointFilter
from gcs_formation.extend.cycle import Cycle, Vehicle
from gcs_formation.extend.flight_window import FlightWindow
from gcs_formation.extend.register import (
    register_filter,
    register_formation_law,
    register_law,
    register_metric,
    register_monitor,
    register_recorder,
)
from gcs_formation.recorder import Event

__all__ = [
    "Cycle",
    "Event",
    "Extension",
    "FlightWindow",
    "FollowerLaw",
    "FollowerSlot",
    "FormationLaw",
    "Metric",
    "Monitor",
    "Recorder",
    "Setpoint",
    "SetpointFilter",
    "State",
    "Vehicle",
    "register_filter",
    "register_formation_law",
    "register_law",
    "register_metric",
    "register_monitor",
    "register_recorder",
]

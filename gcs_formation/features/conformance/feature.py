"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.conformance.monitor import ConformanceMonitor
from gcs_formation.features.conformance.stages import Answers, Motion, NoMotion


def _stages(cycle: Cycle) -> list[Stage]:
    monitor = ConformanceMonitor(cycle.scenario, cycle.controller, cycle.vehicles, cycle.log_event)
    return [Answers(monitor), Motion(monitor, cycle), NoMotion(monitor)]


FEATURE = Feature(
    "notices vehicles that don't do what they acknowledged",
    _stages,
    events={
        "disobeys": "a vehicle doesn't do what it acknowledged, or refuses it",
        "obeys": "it does again",
        "uplink": "a vehicle is heard, and may not receive us, or answers again",
    },
)

"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.airspace.stages import FenceStage, GroundStage


def _stages(cycle: Cycle) -> list[Stage]:
    return [FenceStage(cycle), GroundStage(cycle)]


FEATURE = Feature(
    "keeps setpoints inside the fence, and heights above the ground",
    _stages,
    events={
        "fence": "a setpoint is held at the fence or above the ground, or no longer is",
    },
)

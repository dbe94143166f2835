"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.all_down.watch import AllDown


def _stages(cycle: Cycle) -> list[Stage]:
    return [AllDown(cycle)]


FEATURE = Feature(
    "ends a flight when all vehicles are down",
    _stages,
)

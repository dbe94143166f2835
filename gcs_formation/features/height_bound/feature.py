"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.height_bound.height_bound import HeightBound


def _stages(cycle: Cycle) -> list[Stage]:
    return [HeightBound(cycle)]


FEATURE = Feature(
    "bounds commanded heights by those of path and slot, whatever a vehicle says of its own",
    _stages,
)

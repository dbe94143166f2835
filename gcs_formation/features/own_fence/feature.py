"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.own_fence.heights import OwnFences


def _stages(cycle: Cycle) -> list[Stage]:
    return [OwnFences(cycle)]


FEATURE = Feature(
    "keeps commanded heights within the geofences that vehicles have themselves",
    _stages,
)

"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.separation.stages import Separation


def _stages(cycle: Cycle) -> list[Stage]:
    return [Separation(cycle)]


FEATURE = Feature(
    "keeps vehicles apart",
    _stages,
    events={
        "separation": "a vehicle avoids another, still does, or no longer does",
    },
)

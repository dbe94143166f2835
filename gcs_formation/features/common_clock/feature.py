"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.common_clock.agreed_utc import CommonClock


def _stages(cycle: Cycle) -> list[Stage]:
    return [CommonClock(cycle)]


FEATURE = Feature(
    "maps all vehicles' stamps to one clock by the UTC that most agree on",
    _stages,
    events={
        "clock": "whether a vehicle's UTC is used, or why not",
    },
)

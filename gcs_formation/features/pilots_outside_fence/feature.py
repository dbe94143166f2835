"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.pilots_outside_fence.watch import PilotsOutsideFence


def _stages(cycle: Cycle) -> list[Stage]:
    return [PilotsOutsideFence(cycle)]


FEATURE = Feature(
    "reports who flies outside the fence in a pilot's hands",
    _stages,
    events={"fence": "a vehicle is flown outside by its pilot or its failsafe, or no longer is"},
)

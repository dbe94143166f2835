"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.resumption.stages import TakenOver
from gcs_formation.features.resumption.takeover import Takeover


def _stages(cycle: Cycle) -> list[Stage]:
    takeover = cycle.beginning
    return [TakenOver(takeover)] if isinstance(takeover, Takeover) else []


FEATURE = Feature(
    "resumes a flight whose station was killed",
    _stages,
    events={
        "takeover": "what became of a vehicle of a resumed flight: taken over, or left as it is, and why",
    },
    resumes=Takeover,
)

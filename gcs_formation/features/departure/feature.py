"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.departure.awaiting import AwaitingFormation
from gcs_formation.features.departure.take_off_order import TakeOffOrder


def _stages(cycle: Cycle) -> list[Stage]:
    return [TakeOffOrder(cycle), AwaitingFormation(cycle)]


FEATURE = Feature(
    "arms fixed wings together, each line from its front, and lets those that wait for the formation fly straight on",
    _stages,
    events={"take_off_order": "a vehicle stays on the ground until all are ready, and those ahead of it are armed"},
)

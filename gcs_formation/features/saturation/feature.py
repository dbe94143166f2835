"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.saturation.speed_reserve import SpeedReserve


def _stages(cycle: Cycle) -> list[Stage]:
    return [SpeedReserve(cycle)] if cycle.scenario.hovers else []


FEATURE = Feature(
    "slows the leader down while a multirotor can't reach its commanded speed",
    _stages,
    events={"saturated": "a multirotor can't reach its commanded speed, so the leader is slowed down, or it can again"},
)

"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.limit_cycle.watch import LimitCycles


def _stages(cycle: Cycle) -> list[Stage]:
    return [LimitCycles(cycle)]


FEATURE = Feature(
    "names followers whose lateral error is a limit cycle",
    _stages,
    events={"limit_cycle": "a follower swings about its slot with a steady amplitude, or no longer does"},
)

"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.time_constants.stages import MotionSeen, TimeConstants, TimeConstantsOff, lag_estimator


def _stages(cycle: Cycle) -> list[Stage]:
    lags = lag_estimator(cycle)
    return [MotionSeen(lags), TimeConstants(lags), TimeConstantsOff(lags)]


FEATURE = Feature(
    "estimates each vehicle's time constants",
    _stages,
)

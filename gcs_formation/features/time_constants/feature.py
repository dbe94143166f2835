"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.time_constants.stages import (
    MotionSeen,
    TimeConstants,
    TimeConstantsOff,
    time_constant_estimator,
)


def _stages(cycle: Cycle) -> list[Stage]:
    estimator = time_constant_estimator(cycle)
    return [MotionSeen(estimator), TimeConstants(estimator), TimeConstantsOff(estimator)]


FEATURE = Feature(
    "estimates each vehicle's time constants",
    _stages,
)

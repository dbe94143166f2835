"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.succession.stages import Succession


def _stages(_: Cycle) -> list[Stage]:
    return [Succession()]


FEATURE = Feature(
    "replaces a lost leader by a follower; without it all loiter",
    _stages,
)

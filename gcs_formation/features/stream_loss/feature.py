"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.stream_loss.stream_loss import StreamLosses


def _stages(cycle: Cycle) -> list[Stage]:
    return [StreamLosses(cycle)]


FEATURE = Feature(
    "measures loss where a router filters messages",
    _stages,
    figures={
        "links.*.measured_loss": "the share of a vehicle's frames that were lost",
    },
)

"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.message_intervals.requested_again import MessageIntervals
from gcs_formation.features.message_intervals.stages import RequestedAgain


def _stages(cycle: Cycle) -> list[Stage]:
    return [RequestedAgain(MessageIntervals(cycle.vehicles, cycle.log_event))]


FEATURE = Feature(
    "requests messages again that stop coming as requested",
    _stages,
    events={
        "streams": "messages don't come as requested, are refused, or come again",
    },
)

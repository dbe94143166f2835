"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.link_budget.link_budget import link_budget
from gcs_formation.features.link_budget.stages import Budget


def _stages(cycle: Cycle) -> list[Stage]:
    budget = link_budget(cycle.as_written, cycle.vehicles, cycle.log_event, cycle.radio_reports, cycle.heartbeats)
    return [Budget(budget)]


FEATURE = Feature(
    "fits what goes over the links to what they carry",
    _stages,
    events={
        "link_load": "a link is full, or has room again, and what goes over it from then on",
    },
)

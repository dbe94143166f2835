"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.delay_margins.margin_watch import DesignWatch, MarginWatch
from gcs_formation.features.delay_margins.stages import DelayMargins, FirstGainDesign, GainDesign


def _stages(cycle: Cycle) -> list[Stage]:
    margins = MarginWatch(cycle.scenario, cycle.vehicles, cycle.log_event)
    retunes = (cycle.controller.retune, margins.retune)
    design = DesignWatch(cycle.scenario, cycle.vehicles, retunes, cycle.log_event)
    return [GainDesign(design), FirstGainDesign(design), DelayMargins(margins, cycle)]


FEATURE = Feature(
    "compares the loops' delays with their margins, and lowers gains where the scenario asks for that",
    _stages,
    events={
        "delay_margin": "a vehicle's loops come near their delay margin, or are well inside it again",
        "design": "gains are designed for slower links",
        "gains": "gains are lowered, or the scenario's again",
    },
    figures={
        "stability.worst_loop_delay_s": "the longest loop delay",
        "stability.margin_used": "the largest share of a margin that was used",
    },
)

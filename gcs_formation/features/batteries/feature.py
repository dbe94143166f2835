"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.batteries.before_take_off import findings
from gcs_formation.features.batteries.stages import BatteryWatch


def _stages(cycle: Cycle) -> list[Stage]:
    return [BatteryWatch(cycle)]


FEATURE = Feature(
    "keeps a reserve in the batteries of vehicles that tell them, and sends home whose lasts for the way home alone",
    _stages,
    events={"battery": "what is left in a vehicle's battery lasts for the way home and the reserve alone"},
    before_take_off=findings,
)

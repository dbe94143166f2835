"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.ending.approach_heights import ApproachHeights, lands
from gcs_formation.features.ending.ending import SeparatedEndings
from gcs_formation.features.ending.landing_check import LandingCheck
from gcs_formation.features.ending.stages import AtEndHeights, EndHeights


def _stages(cycle: Cycle) -> list[Stage]:
    gate = cycle.phase_machine.gate
    if cycle.scenario.finish.then == "land":
        gate.hold(LandingCheck(cycle.scenario, cycle.vehicles))
    if lands(cycle.scenario) and not gate.examines:
        gate.hold(ApproachHeights(cycle.vehicles))
    chosen = EndHeights()
    return [chosen, AtEndHeights(chosen)]


FEATURE = Feature(
    "ends a flight with vehicles at separate heights, here, at home or on the ground",
    _stages,
    ends=SeparatedEndings,
)

"""Declares the feature."""

from __future__ import annotations

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.feature import Feature
from gcs_formation.features.preflight.parameters import ParameterExamination
from gcs_formation.features.preflight.position import findings


def _stages(cycle: Cycle) -> list[Stage]:
    gate = cycle.phase_machine.gate
    if gate.examines:
        gate.add(ParameterExamination(cycle))
    return []


FEATURE = Feature(
    "checks parameters and positions before the first command; without it vehicles are armed and take off unchecked",
    _stages,
    before_take_off=findings,
)

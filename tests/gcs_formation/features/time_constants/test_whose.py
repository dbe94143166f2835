"""Whose time constants are estimated in flight, and whether they are used."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from formation_scenario import load_scenario
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.time_constants.estimator import TimeConstantEstimator
from gcs_formation.features.time_constants.stages import time_constant_estimator
from gcs_formation.from_scenario import autopilot_models
from tests.flights.conftest import scenario


def estimator(*overrides: str, **vehicles: Any) -> TimeConstantEstimator:
    loaded = load_scenario(scenario(vehicles={"count": 3} | vehicles), overrides)
    controller = SimpleNamespace(models=autopilot_models(loaded), history=SetpointHistory(10.0))
    cycle: Any = SimpleNamespace(scenario=loaded, controller=controller)
    return time_constant_estimator(cycle)


@pytest.mark.parametrize(
    ("vehicles", "speed_mps", "estimated"),
    [({}, 22, True), ({"model": "arduplane"}, 22, False), ({"model": "arducopter"}, 5, False)],
)
def test_those_of_vehicles_that_fly_by_the_papers_model_are(
    vehicles: dict[str, Any], speed_mps: int, estimated: bool
) -> None:
    """Of an aircraft with energies, and of one that hovers, it is only an approximation."""
    found = estimator(f"path.speed_mps={speed_mps}", **vehicles)
    assert [each._estimated for each in found.vehicles] == [estimated] * 3


def test_they_are_used_unless_the_scenario_fixes_its_models() -> None:
    assert [each._in_use for each in estimator().vehicles] == [True] * 3
    assert [each._in_use for each in estimator("law.lag_estimation=false").vehicles] == [False] * 3

"""The distance that is kept: the scenario's, or a share of what its nearest slots leave."""

from __future__ import annotations

from typing import Any

import pytest

from formation_scenario import load_scenario
from gcs_formation.estimation.predictor import SetpointHistory
from gcs_formation.parameters import autopilot_model
from gcs_formation.separation.keeper import SeparationKeeper
from tests.flights.conftest import scenario

WIDE, NARROW = {"shape": "line", "spacing_m": 30}, {"shape": "line", "spacing_m": 8}
CASES: list[tuple[dict[str, Any], float]] = [
    (WIDE, 10.0),
    (NARROW, 6.4),
    (WIDE | {"changes": [{"at_s": 10, "spacing_m": 8}]}, 6.4),
    (WIDE | {"changes": [{"at_s": 10, "leader": 2}]}, 10.0),
]


@pytest.mark.parametrize(("formation", "kept_m"), CASES)
def test_the_formation_is_not_fought_whoever_leads_it(formation: dict[str, Any], kept_m: float) -> None:
    flown = load_scenario(scenario(formation=formation, safety={"separation_m": 5}))
    keeper = SeparationKeeper(flown, SetpointHistory(flown.law.rate_hz), autopilot_model(flown))
    assert keeper.kept_m == pytest.approx(kept_m)

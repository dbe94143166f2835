"""What the first command of a flight waits for, by how the flight ends and whether vehicles are checked anyway."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from formation_scenario import load_scenario
from gcs_formation.features.ending.approach_heights import ApproachHeights
from gcs_formation.features.ending.feature import FEATURE
from gcs_formation.features.ending.landing_check import LandingCheck
from tests.flights.conftest import scenario

AT_THE_END = {"finish": {"then": "land", "loiter_s": 0}}
BY_ORDER = {"orders": [{"at_s": 5, "order": "land"}]}


@pytest.mark.parametrize(
    ("keys", "examines", "awaited"),
    [
        (AT_THE_END, False, [LandingCheck, ApproachHeights]),
        (AT_THE_END, True, [LandingCheck]),
        (BY_ORDER, False, [ApproachHeights]),
        (BY_ORDER, True, []),
        ({}, False, []),
        ({}, True, []),
    ],
)
def test_landings_are_judged_if_the_flight_ends_in_them_and_approaches_read_unless_all_parameters_are(
    keys: dict[str, Any], examines: bool, awaited: list[type]
) -> None:
    held = list[Any]()
    gate = SimpleNamespace(examines=examines, hold=held.append)
    cycle: Any = SimpleNamespace(
        phase_machine=SimpleNamespace(gate=gate), scenario=load_scenario(scenario(**keys)), vehicles={}
    )
    assert [each.name for each in FEATURE.stages(cycle)] == ["end_heights", "at_end_heights"]
    assert [type(each) for each in held] == awaited

"""The table of laws, against the scenario's keys."""

import pytest

from formation_scenario import load_scenario
from formation_scenario.law import LAW_TYPES
from gcs_formation.control.laws import LAWS, gain_range
from gcs_formation.studies import compare
from tests.flights.conftest import scenario


def test_it_has_every_law_that_a_scenario_can_name_and_compare_flies_each() -> None:
    assert set(LAWS) == set(LAW_TYPES)
    assert set(LAWS) <= set(compare.LAWS)


def test_names_of_compared_laws_are_those_that_were_always_there() -> None:
    assert list(compare.LAWS) == [
        "pid",
        "pid_uncompensated",
        "fuzzy_pid",
        "fuzzy_pid_uncompensated",
        "fuzzy_pid_symmetric",
        "fuzzy_pid_symmetric_uncompensated",
        "consensus",
        "consensus_uncompensated",
    ]
    fuzzy = ("law.type=fuzzy_pid", "law.fuzzy.tables=symmetric", "law.delay_compensation=false")
    assert compare.LAWS["fuzzy_pid_symmetric_uncompensated"] == fuzzy


@pytest.mark.parametrize(("law", "span"), [("pid", 0.0), ("fuzzy_pid", 0.6)])
def test_only_the_scheduled_law_moves_its_gains(law: str, span: float) -> None:
    flown = load_scenario(scenario(law={"type": law}))
    assert gain_range(flown).span == span

"""The table of laws, against the scenario's keys."""

from typing import Any, cast

import pytest

from formation_scenario import load_scenario
from formation_scenario.extensions import Origin, Registered
from formation_scenario.law import LAW_TYPES
from gcs_formation.control.law_over_all import LawOverAll
from gcs_formation.control.laws import LAWS, gain_range
from gcs_formation.studies import compare
from tests.flights.conftest import scenario
from tests.gcs_formation import tables
from tests.gcs_formation.control import law_ticks


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


class Remembering:
    """A law over all that holds what it is given, and how often it was reset."""

    def __init__(self, keys: Any) -> None:
        self.resets = 0
        self.seen: list[Any] = []

    def reset(self) -> None:
        self.resets += 1

    def setpoints(self, followers: list[Any], dt_s: float) -> dict[str, tuple[float, float, float]]:
        self.seen = followers
        return {each.id: (20.0, 0.1, 90.0) for each in followers}


def test_a_law_over_all_begins_again_when_another_vehicle_leads() -> None:
    entry = Registered("law", "remembering", Remembering, 1, Origin("law.py", ""))
    over_all = LawOverAll(entry, load_scenario(scenario()), tables.models(law_ticks.MODEL))
    law = cast("Remembering", over_all._law)
    now = law_ticks.cycle_input(law_ticks.in_formation())
    over_all.decide(now, law_ticks.DT_S)
    over_all.decide(now, law_ticks.DT_S)
    assert law.resets == 0
    now.lead.leader = 1
    over_all.decide(now, law_ticks.DT_S)
    over_all.decide(now, law_ticks.DT_S)
    assert law.resets == 1

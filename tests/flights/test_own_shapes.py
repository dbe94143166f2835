"""A shape from outside: planned, with its keys, changed to, ordered in flight, and refused where it can't be flown."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml

import gcs_formation
from formation_scenario import ScenarioError, load_scenario
from formation_scenario.formation import CUSTOM, SHAPE_NAMES
from formation_scenario.registry import load_extensions
from formation_scenario.schema import scenario_schema
from formation_scenario.slot_assignment import OURS, slot_schedule, slot_table
from tests.flights.own_files import EXAMPLES, HEAD, keys, own, series

VEE = EXAMPLES / "vee_shape.py"
SLOTS = (
    HEAD + "@register_shape('it')\nclass It(Shape):\n    def slots(self, followers, spacing_m):\n        return {}\n"
)


def loaded(formation, *overrides, plugin=VEE, **more):
    return load_scenario(keys(formation=formation, **more), overrides, plugins=[plugin])


def test_ours_are_registered_as_one_from_outside_is():
    assert (*OURS, CUSTOM) == SHAPE_NAMES


def test_its_slots_are_those_of_its_keys():
    scenario = loaded({"shape": "vee", "spacing_m": 40, "parameters": {"half_deg": 60, "step_up_m": 5}})
    out_m = 40 * math.sin(math.radians(60))
    assert np.allclose(slot_table(scenario), [[-20, -out_m, 5], [-20, out_m, 5]])


def test_changes_have_their_own_keys_or_the_formations():
    changes = [{"at_s": 1, "shape": "line"}, {"at_s": 5, "shape": "vee"}]
    changes.append({"at_s": 9, "shape": "vee", "parameters": {"half_deg": 70}})
    formation = {"shape": "vee", "spacing_m": 40, "parameters": {"half_deg": 60}, "changes": changes}
    behind_m = [float(step.positions_m[1, 0]) for step in slot_schedule(loaded(formation))]
    assert behind_m == pytest.approx([-20, 0, -20, -40 * math.cos(math.radians(70))])


def test_it_is_ordered_in_flight_and_flown(tmp_path):
    formation = {"shape": "line", "spacing_m": 30}
    with gcs_formation.Flight(
        keys(formation=formation, duration_s=40), out=tmp_path / "run", plugins=[VEE], until=30
    ) as flight:
        for tick in flight:
            if 0.95 < tick.mission_time_s < 1.05:
                assert flight.tell("shape vee").accepted
        with pytest.raises(gcs_formation.OrderError, match=r"allowed: follower, .*custom, vee .did you mean 'vee'"):
            flight.tell("shape vea")
    assert series(tmp_path, "slot_forward_m", "2")[-1] == pytest.approx(-30 * math.cos(math.radians(35)), abs=0.01)
    resolved = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text())
    assert "parameters" not in resolved["formation"]


@pytest.mark.parametrize(
    ("formation", "said"),
    [
        ({"shape": "vea"}, "formation.shape: found 'vea'; allowed: follower, diamond"),
        ({"shape": "vea"}, "custom, vee (did you mean 'vee'?)"),
        ({"shape": "vee", "parameters": {"half": 3}}, "formation.parameters.half: found an unknown key 'half'"),
        ({"shape": "vee", "parameters": {"half_deg": 3}}, "formation.parameters.half_deg: found 3"),
        ({"shape": "line", "parameters": {"half_deg": 40}}, "none: line has its keys beside formation.shape"),
        (
            {"shape": "line", "changes": [{"at_s": 3, "shape": "vee", "parameters": {"half_deg": 3}}]},
            "formation.changes.0.parameters.half_deg: found 3",
        ),
    ],
)
def test_names_and_keys_are_checked_as_all_others(formation, said):
    with pytest.raises(ScenarioError) as refused:
        loaded(formation)
    assert said in str(refused.value)


def test_an_order_for_a_shape_that_is_not_registered_is_refused_in_the_scenario():
    orders = [{"at_s": 3, "order": "shape vee"}]
    assert loaded({"shape": "line"}, orders=orders).orders[0].order == "shape vee"
    with pytest.raises(ScenarioError, match=r"orders.0.order: found 'shape vee'; .*echelon, circle, custom"):
        load_scenario(keys(orders=orders))


@pytest.mark.parametrize(
    ("returned", "said"),
    [
        ("1 / 0", "ZeroDivisionError: division by zero ("),
        ("[(0, 30)]", "ValueError"),
        ("[(0, 30), (0, float('inf'))]", "isn't finite ("),
        ("[(0, 30), (0, 31)]", "formation.spacing_m: found slots of vehicle 2 and vehicle 3 1 m apart in it"),
    ],
)
def test_slots_that_cannot_be_flown_are_a_bad_scenario_with_its_file(returned, said, tmp_path):
    file = own(tmp_path, SLOTS.format(returned))
    with pytest.raises(ScenarioError) as refused:
        loaded({"shape": "it"}, plugin=file)
    assert said in str(refused.value)
    assert "formation.s" in str(refused.value)


def test_the_schema_has_its_name_and_keys():
    found = scenario_schema(load_extensions([VEE]))["$defs"]["Formation"]["properties"]
    assert "vee" in found["shape"]["enum"]
    assert "half_deg" in str(found["parameters"])
    assert "half_deg" not in str(scenario_schema())

"""Keys that features bring stand where they say, and have one place."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from pathlib import Path
from typing import get_type_hints

import pytest

from formation_scenario.brought_keys import BroughtKeys, brought_keys, in_order
from formation_scenario.feature_folders import feature_names
from formation_scenario.fields import Flag, Keys, Positive, ScenarioError, key
from formation_scenario.load import load_scenario
from formation_scenario.safety import Safety
from tests.formation_scenario.conftest import minimal

KNOWN = """
import sys
from formation_scenario.safety import Safety
print(len(Safety.model_fields), *sys.modules)
"""


class First(BroughtKeys, group="nowhere", after=("one",)):
    a: Flag = key(True, "", False)
    b: Flag = key(True, "", False)


class Behind(BroughtKeys, group="nowhere", after=("one", "a", "left_out")):
    c: Positive = key(1.0, "", 2)


class Again(BroughtKeys, group="nowhere", after=("two",)):
    a: Flag = key(True, "", False)


class Lost(BroughtKeys, group="nowhere", after=("left_out",)):
    d: Flag = key(True, "", False)


def test_keys_stand_behind_all_that_they_name_and_that_are_there() -> None:
    assert in_order(["one", "two"], [Behind, First]) == ["one", "a", "c", "b", "two"]
    assert in_order(["one", "two"], [First]) == ["one", "a", "b", "two"]
    assert in_order(["one", "two"], [Behind]) == ["one", "c", "two"]


@pytest.mark.parametrize("wrong", [[First, Again], [Lost]])
def test_keys_without_a_position_of_their_own_are_refused(wrong: list[type[BroughtKeys]]) -> None:
    with pytest.raises(ValueError, match=r"twice|behind no key"):
        in_order(["one", "two"], wrong)


def test_each_is_a_key_of_its_group_in_this_and_in_another_process() -> None:
    scenario = load_scenario(minimal())
    copied = pickle.loads(pickle.dumps(scenario))
    assert brought_keys()
    for each in brought_keys():
        for name in each.fields():
            assert getattr(each.of(copied), name) == getattr(each.of(scenario), name)
    assert copied == scenario


def test_a_recorded_run_s_unknown_key_names_the_features_that_it_was_flown_with_and_that_are_not_here(
    tmp_path: Path,
) -> None:
    scenario = tmp_path / "run.yaml"
    scenario.write_text(json.dumps(minimal() | {"safety": {"ceiling": {"top_m": 140}}}))
    said = {True: "; it was flown with features that aren't here: ceiling", False: ""}
    for flown in (True, False):
        features = [*feature_names(), *(["ceiling"] if flown else [])]
        (tmp_path / "summary.json").write_text(json.dumps({"features": features}))
        with pytest.raises(ScenarioError) as refused:
            load_scenario(scenario)
        (problem,) = refused.value.problems
        assert (problem.key, problem.found) == ("safety.ceiling", "found an unknown key 'ceiling'")
        assert problem.allowed == ", ".join(Safety.model_fields) + said[flown]


def test_the_models_of_groups_are_read_by_type_checkers_without_brought_keys() -> None:
    """The names beside the class stay those of the core: a feature's are asked for by its own class."""
    theirs = {name for each in brought_keys() if each.group == "safety" for name in each.fields()}
    assert theirs
    assert theirs < Safety.model_fields.keys()
    assert issubclass(Safety, Keys)
    assert set(get_type_hints(BroughtKeys)) == {"group", "after"}


@pytest.mark.slow
def test_a_program_that_reads_keys_loads_nothing_else_of_a_feature() -> None:
    said = subprocess.run([sys.executable, "-c", KNOWN], capture_output=True, text=True, check=True).stdout.split()
    assert int(said[0]) == len(Safety.model_fields)
    loaded = {each for each in said if each.startswith("gcs_formation.")}
    assert {each.rpartition(".")[2] for each in loaded if each.count(".") == 3} == {"keys"}
    assert {each for each in loaded if not each.startswith("gcs_formation.features")} == set()

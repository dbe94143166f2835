"""Vehicle files: named in a scenario, read relative to it, and refused in the user's terms."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from formation_scenario import ScenarioError, dump_scenario, load_scenario
from formation_scenario.shipped_aircraft import shipped_names
from formation_scenario.source import Source
from formation_scenario.vehicle_files import read_model

PATH = {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}
FILE = {"schema": 1, "name": "mine", "model": {"tau_v_s": 2.5, "speed_min_mps": 15}, "fit": {"airspeed_mps": 0.1}}


def written(directory, file=None, **vehicle):
    if file is not None:
        (directory / "mine.yaml").write_text(file if isinstance(file, str) else yaml.safe_dump(file))
    scenario = {"vehicles": [{"id": 1, "role": "leader"}, {"id": 2} | vehicle], "path": PATH}
    (directory / "scenario.yaml").write_text(yaml.safe_dump(scenario))
    return directory / "scenario.yaml"


def refusal(*arguments, **keys):
    with pytest.raises(ScenarioError) as refused:
        load_scenario(written(*arguments, **keys))
    return str(refused.value)


def test_a_file_is_found_beside_the_scenario_and_becomes_part_of_the_run(tmp_path):
    scenario = load_scenario(written(tmp_path, FILE, model="mine.yaml"))
    assert scenario.vehicles[1].model.tau_v_s == 2.5
    assert scenario.vehicles[1].model.tau_psi_s == scenario.vehicles[0].model.tau_psi_s
    assert scenario.law.gains == "auto"
    assert load_scenario(yaml.safe_load(dump_scenario(scenario))) == scenario


def test_an_arduplane_without_a_model_is_the_shipped_one(tmp_path):
    by_family = load_scenario(written(tmp_path, autopilot="arduplane")).vehicles[1].model
    by_name = load_scenario(written(tmp_path, model="arduplane")).vehicles[1].model
    assert by_family == by_name
    assert by_name.airframe is not None
    assert load_scenario(written(tmp_path, autopilot="arduplane", model={})).vehicles[1].model.airframe is None


def test_what_only_the_emulator_flies_doesnt_change_the_law(tmp_path):
    accepted, flown = load_scenario(written(tmp_path)), load_scenario(written(tmp_path, true_model="arduplane"))
    assert flown.law == accepted.law
    true = flown.vehicles[1].true_model
    assert true is not None
    assert true.airframe is not None


def test_gains_are_designed_for_the_delay_of_real_links_as_for_that_of_emulated_ones(tmp_path):
    path = written(tmp_path, model="arduplane")
    none, real, emulated = (
        load_scenario(path, overrides).law.speed
        for overrides in ([], ["law.design_delay_ms=300"], ["links.default.delay_ms=300"])
    )
    assert real == emulated
    assert real.kp < 0.8 * none.kp


def test_every_shipped_file_flies():
    for name in shipped_names():
        model: Any = read_model(name, Path(), Source(None, {}), ())
        speed_mps = (model["speed_min_mps"] + model["speed_max_mps"]) / 2
        vehicles = {"count": 2, "model": name}
        assert load_scenario({"vehicles": vehicles, "path": PATH | {"speed_mps": speed_mps}}).law.gains == "auto"


def test_a_group_may_name_a_file():
    found = load_scenario({"vehicles": {"count": 3, "model": "arduplane"}, "path": PATH})
    assert all(each.model == found.vehicles[0].model for each in found.vehicles)


def test_problems_name_the_file_or_the_key_that_names_it(tmp_path):
    assert "vehicles.1.model: found 'arduplan'" in refusal(tmp_path, model="arduplan")
    assert "did you mean 'arduplane'?" in refusal(tmp_path, model="arduplan")
    missing = refusal(tmp_path, model="nowhere.yaml")
    assert "scenario.yaml:" in missing
    assert "nowhere.yaml': No such file" in missing
    assert "mine.yaml:1:9: model.tau: found an unknown key 'tau'" in refusal(
        tmp_path, "model: {tau: 3}", model="mine.yaml"
    )
    assert "model: not found" in refusal(tmp_path, "name: mine", model="mine.yaml")
    assert "mine.yaml:1" in refusal(tmp_path, "model: {tau_v_s: [}", model="mine.yaml")

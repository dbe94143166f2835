"""Laws, filters, monitors, recorders and metrics from files outside of the packages are flown."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from click.testing import CliRunner

import gcs_formation
from formation_scenario import ScenarioError, load_scenario
from formation_scenario.registry import load_extensions
from formation_scenario.schema import scenario_schema
from formation_scenario.used_extensions import used_extensions
from gcs_formation.cli import main
from gcs_formation.record.run_directory import SCENARIO, TIMESERIES
from gcs_formation.report.page import write_report
from gcs_formation.studies import Study
from gcs_formation.studies.compare import _settings, named_laws
from gcs_formation.studies.flight import Task, fly
from gcs_formation.studies.plan import Planned
from tests.flights.own_files import HEAD, events, flown, keys, own

EXAMPLES = Path(__file__).parents[2] / "examples" / "extensions"
CONTRACT = """
from pydantic import BaseModel
from gcs_formation.extend import FollowerLaw, SetpointFilter, register_filter, register_law

@register_law("lqr")                                    # law.type: lqr
class Lqr(FollowerLaw):
    class Keys(BaseModel):                              # law.parameters, checked like every key
        k: float = 1.2
    def feedback(self, error, error_rate, dt_s):
        return self.keys.k * error[0] + error_rate[0], error[1] + error_rate[1], error[2]

@register_filter("ceiling")                             # extensions.ceiling
class Ceiling(SetpointFilter):
    class Keys(BaseModel):
        top_m: float
    def apply(self, cycle):
        for vehicle in cycle.vehicles:
            if vehicle.setpoint.height_m > self.keys.top_m:
                vehicle.replace(height_m=self.keys.top_m)
                cycle.event("ceiling", "held under it", vehicle)
"""


@pytest.fixture(scope="module")
def climb(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, gcs_formation.Summary]:
    """A flight by the law and under the ceiling of the contract, on a path that climbs above it."""
    home = tmp_path_factory.mktemp("climb")
    path = {"waypoints_m": [[0, 0, 100], [300, 0, 100], [700, 0, 108], [2000, 0, 108]]}
    law = {"type": "lqr", "parameters": {"k": 1.4}}
    more = {"path": path, "law": law, "extensions": {"ceiling": {"top_m": 104}}, "duration_s": 40}
    return home, flown(home, own(home, CONTRACT), **more)


def test_a_ceiling_holds_all_vehicles_and_the_law_keeps_its_slots_under_it(climb):
    home, summary = climb
    found = pq.read_table(home / "run" / TIMESERIES).to_pydict()
    on_path = np.array(found["phase"]) == "flying"
    commanded_m, true_m = np.array(found["setpoint_height_m"])[on_path], np.array(found["true_height_m"])[on_path]
    assert commanded_m.max() == 104.0
    assert true_m.max() < 104.2
    assert summary.figures["followers"]["2"]["error_z_m"]["max"] < 0.2
    assert summary.figures["followers"]["2"]["error_x_m"]["max"] < 0.2


def test_followers_take_a_leader_that_a_filter_holds_to_go_on_as_it_was_commanded(tmp_path):
    held = CONTRACT.replace("if vehicle.setpoint", "if vehicle.leads and vehicle.setpoint")
    path = {"waypoints_m": [[0, 0, 100], [300, 0, 100], [700, 0, 108], [2000, 0, 108]]}
    more = {"path": path, "extensions": {"ceiling": {"top_m": 102}}, "duration_s": 30}
    summary = flown(tmp_path, own(tmp_path, held), **more)
    assert summary.figures["followers"]["2"]["error_z_m"]["max"] < 0.05


def test_an_event_that_is_raised_tick_after_tick_is_one_and_none_disobeys(climb):
    home, _ = climb
    assert sorted(each["vehicle"] for each in events(home, "ceiling") if each["t_s"] < 40) == ["1", "2", "3"]
    assert not events(home, "disobeys")


def test_the_record_names_what_was_used_and_is_flown_again_only_with_it(climb):
    home, summary = climb
    resolved = yaml.safe_load((home / "run" / SCENARIO).read_text(encoding="utf-8"))
    assert resolved["law"]["parameters"] == {"k": 1.4}
    assert resolved["extensions"] == {"ceiling": {"top_m": 104.0}}
    assert [(each["kind"], each["name"]) for each in summary.figures["extensions"]] == [
        ("law", "lqr"),
        ("filter", "ceiling"),
    ]
    assert all(len(each["sha256"]) == 64 for each in summary.figures["extensions"])
    with pytest.raises(ScenarioError) as refused:
        load_scenario(home / "run" / SCENARIO)
    said = str(refused.value)
    assert "law.type: found 'lqr'; allowed: fuzzy_pid, pid, consensus" in said
    assert f"it was flown with --plugin {home / 'own.py'} (sha256 " in said
    again = load_scenario(home / "run" / SCENARIO, plugins=[home / "own.py"])
    assert again.law.parameters == {"k": 1.4}
    with pytest.raises(gcs_formation.RecordError, match="it was flown with --plugin"):
        write_report(home / "run")


def test_a_scenario_without_extensions_has_no_new_keys(tmp_path):
    gcs_formation.run(keys(), clock="virtual", out=tmp_path / "run", until=1)
    resolved = yaml.safe_load((tmp_path / "run" / SCENARIO).read_text(encoding="utf-8"))
    assert "extensions" not in resolved
    assert "parameters" not in resolved["law"]
    assert not (tmp_path / "run" / "extensions.json").exists()


def test_the_example_of_a_law_keeps_a_formation_in_its_slots(tmp_path):
    summary = flown(tmp_path, EXAMPLES / "lqr_law.py", law={"type": "lqr", "parameters": {"share": 0.9}})
    assert all(each["error_x_m"]["max"] < 0.05 for each in summary.figures["followers"].values())
    assert summary.figures["stability"]["delay_margin_s"] is None


def test_the_example_of_a_law_over_all_keeps_a_formation(tmp_path):
    summary = flown(tmp_path, EXAMPLES / "chase_law.py", law={"type": "chase"})
    assert summary.figures["followers"]["3"]["error_x_m"]["max"] < 0.5


def test_the_example_of_a_filter_keeps_everybody_away_from_an_obstacle(tmp_path):
    obstacle = {"keep_out": {"north_m": 600, "east_m": 15, "radius_m": 60}}
    flown(tmp_path, EXAMPLES / "keep_out_filter.py", extensions=obstacle, duration_s=40)
    found = pq.read_table(tmp_path / "run" / TIMESERIES).to_pydict()
    north_m, east_m = np.array(found["true_north_m"]), np.array(found["true_east_m"])
    assert np.nanmin(np.hypot(north_m - 600, east_m - 15)) > 40, "it turns with a lag"
    assert {each["vehicle"] for each in events(tmp_path, "keep_out")} == {"1", "3"}, "2 is beyond the leader"


def test_the_examples_of_monitor_recorder_and_metric(tmp_path):
    code = "".join(
        (EXAMPLES / f"{name}.py").read_text() for name in ("slot_monitor", "lines_recorder", "spread_metric")
    )
    more = {"extensions": {"in_slot": {"within_m": 0.001}, "lines": {}}, "wind": {"velocity_mps": [3, 3, 0]}}
    expect = [{"metric": "spread_m", "above": 40, "below": 100, "from_s": 1, "to_s": 10}]
    summary = flown(tmp_path, own(tmp_path, code), expect=expect, **more)
    (verdict,) = summary.figures["expect"]
    assert verdict["held"], verdict
    assert {each["vehicle"] for each in events(tmp_path, "in_slot")} == {"2", "3"}
    lines = [json.loads(line) for line in (tmp_path / "run" / "positions.jsonl").read_text().splitlines()]
    assert sum("vehicles" in line for line in lines) > 200
    assert any(line.get("kind") == "in_slot" for line in lines)


BROKEN: dict[str, tuple[str, str, str, dict[str, Any]]] = {
    "law": ("register_law", "FollowerLaw", "def feedback(self, error, error_rate, dt_s)", {"law": {"type": "it"}}),
    "filter": ("register_filter", "SetpointFilter", "def apply(self, cycle)", {"extensions": {"it": {}}}),
    "monitor": ("register_monitor", "Monitor", "def watch(self, cycle)", {"extensions": {"it": {}}}),
    "recorder": ("register_recorder", "Recorder", "def tick(self, cycle)", {"extensions": {"it": {}}}),
    "metric": (
        "register_metric",
        "Metric",
        "def measure(self, flight)",
        {"expect": [{"metric": "it", "below": 1}]},
    ),
    "formation law": (
        "register_formation_law",
        "FormationLaw",
        "def setpoints(self, followers, dt_s)",
        {"law": {"type": "it"}},
    ),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_an_error_of_an_extension_ends_the_flight_with_its_file_and_line(kind, tmp_path):
    register, base, method, more = BROKEN[kind]
    code = f"{HEAD}@{register}('it')\nclass It({base}):\n    {method}:\n        return 1 / 0\n"
    file = own(tmp_path, code)
    with pytest.raises(gcs_formation.RunAbortedError) as failed:
        flown(tmp_path, file, **more)
    assert f"{kind} 'it'" in str(failed.value)
    assert f"ZeroDivisionError: division by zero ({file}, line 6)" in str(failed.value)


def test_a_metric_that_raises_leaves_a_summary_of_the_flight_with_the_other_figures(tmp_path):
    code = f"{HEAD}@register_metric('it')\nclass It(Metric):\n    def measure(self, flight):\n        return 1 / 0\n"
    expect = [{"metric": "it", "below": 1}, {"metric": "error_x_m.max", "below": 5}]
    file = own(tmp_path, code)
    with pytest.raises(gcs_formation.RunAbortedError) as failed:
        flown(tmp_path, file, expect=expect)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert summary["failure"] == str(failed.value)
    assert f"the metric 'it' could not be computed: ZeroDivisionError: division by zero ({file}, line 6)" in str(
        failed.value
    )
    own_figure, *others = summary["expect"]
    assert (own_figure["held"], own_figure["judged"], own_figure["value"]) == (None, False, None)
    assert "line 6" in own_figure["reason"]
    assert len(others) == 2
    assert all(each["held"] for each in others)


@pytest.mark.parametrize(
    ("code", "more", "said"),
    [
        (
            "@register_law('it')\nclass It(FollowerLaw):\n    def feedback(self, *_):\n"
            "        return 0, float('nan'), 0\n",
            {"law": {"type": "it"}},
            "is not finite: feedback: speed 0 m/s, heading nan rad, height 0 m",
        ),
        (
            "@register_filter('it')\nclass It(SetpointFilter):\n    def apply(self, cycle):\n"
            "        cycle.vehicles[0].replace(speed_mps=float('inf'))\n",
            {"extensions": {"it": {}}},
            "is not finite: setpoint: airspeed (m/s) inf",
        ),
    ],
)
def test_what_is_not_finite_ends_the_flight(code, more, said, tmp_path):
    file = own(tmp_path, HEAD + code)
    with pytest.raises(gcs_formation.RunAbortedError) as failed:
        flown(tmp_path, file, **more)
    assert f"'it' ({file}:3) returned for vehicle" in str(failed.value)
    assert said in str(failed.value)


def test_the_summary_of_a_flight_that_ended_early_is_printed_as_json_too(tmp_path):
    code = HEAD + "@register_law('it')\nclass It(FollowerLaw):\n    def feedback(self, *_):\n        return 1, 2\n"
    (tmp_path / "s.yaml").write_text(yaml.dump(keys(law={"type": "it"})))
    options = ["--clock", "virtual", "--plugin", str(own(tmp_path, code)), "--out", str(tmp_path / "run"), "--json"]
    done = CliRunner().invoke(main, ["run", str(tmp_path / "s.yaml"), *options])
    assert done.exit_code == 3
    assert json.loads(done.stdout) == json.loads((tmp_path / "run" / "summary.json").read_text())
    assert "returned (1, 2); allowed: three numbers" in done.stderr


def test_a_filter_stays_within_the_envelope_and_the_law_knows_what_was_replaced(tmp_path):
    code = HEAD + (
        "@register_law('it')\nclass It(FollowerLaw):\n    def feedback(self, error, *_):\n"
        "        if self.replaced[0] and not self.replaced[2]:\n            raise LookupError('known')\n"
        "        return error\n"
        "@register_filter('fast')\nclass Fast(SetpointFilter):\n    def apply(self, cycle):\n"
        "        if cycle.mission_time_s > 1:\n            cycle.vehicles[1].replace(speed_mps=99)\n"
        "            if cycle.vehicles[1].setpoint.speed_mps != 28.0:\n                raise ValueError('envelope')\n"
    )
    with pytest.raises(gcs_formation.RunAbortedError, match="LookupError: known"):
        flown(tmp_path, own(tmp_path, code), law={"type": "it"}, extensions={"fast": {}})


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("law.type=lqrr", "law.type: found 'lqrr'; allowed: fuzzy_pid, pid, consensus, lqr (did you mean 'lqr'?)"),
        ("law.parameters.kk=1", "law.parameters.kk: found an unknown key 'kk'; allowed: k (did you mean 'k'?)"),
        ("law.parameters.k=much", "law.parameters.k: found 'much'; allowed: a number"),
        ("law.parameters.k=.nan", "law.parameters.k: found nan; allowed: a finite number"),
        ("law.parameters=3", "law.parameters: found 3; allowed: a mapping with k"),
        ("extensions={ceilin: {top_m: 3}}", "found an unknown extension 'ceilin'; allowed: ceiling (did you mean"),
        ("extensions={ceiling: }", "extensions.ceiling.top_m: not found; allowed: a number"),
        ("expect=[{metric: spread, below: 3}]", "expect.0.metric: found 'spread'; allowed: error_x_m.rms"),
    ],
)
def test_names_and_keys_are_refused_as_all_others_are(override, said, tmp_path):
    with pytest.raises(ScenarioError) as refused:
        load_scenario(keys(law={"type": "lqr"}), [override], plugins=[own(tmp_path, CONTRACT)])
    assert said in str(refused.value)


def test_the_place_of_a_wrong_key_is_its_line(tmp_path):
    file = tmp_path / "s.yaml"
    file.write_text(yaml.safe_dump(keys()) + "extensions:\n  ceiling:\n    top: 3\n", encoding="utf-8")
    line = file.read_text(encoding="utf-8").count("\n")
    with pytest.raises(ScenarioError, match=f"s.yaml:{line}:5: extensions.ceiling.top: found an unknown key 'top'"):
        load_scenario(file, plugins=[own(tmp_path, CONTRACT)])


def test_a_models_own_validator_says_what_is_allowed(tmp_path):
    code = CONTRACT.replace(
        "        top_m: float\n",
        "        top_m: float\n        @__import__('pydantic').field_validator('top_m')\n"
        "        def high(cls, top_m):\n"
        "            assert top_m > 50, 'more than 50 m'\n            return top_m\n",
    )
    with pytest.raises(ScenarioError, match=r"extensions.ceiling.top_m: found 3; allowed: more than 50 m"):
        load_scenario(keys(extensions={"ceiling": {"top_m": 3}}), plugins=[own(tmp_path, code)])


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("x = 1\n", "registers nothing; allowed: a register function of gcs_formation.extend"),
        ("x = 1\nimport nonsense_of_mine\n", "own.py:2: ModuleNotFoundError"),
        ("def (\n", "own.py:1: SyntaxError"),
        (CONTRACT.replace('"lqr"', '"pid"'), "law 'pid': found twice: gcs_formation itself and "),
        (CONTRACT + CONTRACT, "law 'lqr': found twice: "),
        (HEAD + "@register_law('it')\nclass It(Monitor):\n    pass\n", "own.py:3: TypeError: found <class"),
    ],
)
def test_files_that_cannot_be_used_are_named(code, said, tmp_path):
    with pytest.raises(ScenarioError) as refused:
        load_extensions([own(tmp_path, code)])
    assert said in str(refused.value)


def test_two_files_that_register_a_name_are_both_named(tmp_path):
    one, other = own(tmp_path, CONTRACT), own(tmp_path, CONTRACT, "other.py")
    with pytest.raises(ScenarioError) as refused:
        load_extensions([one, other])
    assert f"found twice: {one}:5 and {other}:5" in str(refused.value)


def test_registrations_travel_by_content(tmp_path):
    file = own(tmp_path, CONTRACT)
    study = Study(until_s=2, metrics=("error_x_m.max",)).with_registered(load_extensions([file]))
    task = pickle.dumps(Task(Planned(0, 1, {}), study, keys(law={"type": "lqr"})))
    file.unlink()
    row = fly(pickle.loads(task))
    assert (row["exit"], row["words"]) == (0, "")
    assert load_extensions().get("lqr", "law") is None, "they belong to that flight"


def test_an_installed_package_registers_by_its_entry_point(tmp_path, monkeypatch):
    (tmp_path / "own_package").mkdir()
    own(tmp_path / "own_package", CONTRACT, "parts.py")
    own(tmp_path / "own_package", "from own_package import parts\n", "__init__.py")
    info = tmp_path / "own_package-1.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-package\nVersion: 1.5\n")
    (info / "entry_points.txt").write_text("[gcs_formation.extensions]\nall = own_package\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    scenario = load_scenario(keys(law={"type": "lqr"}))
    (used,) = used_extensions(scenario)
    assert (used.origin.package, used.origin.version) == ("own-package", "1.5")
    assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_laws_from_outside_are_compared_and_parameters_stay_with_their_own(tmp_path):
    registry = load_extensions([own(tmp_path, CONTRACT)])
    scenario = load_scenario(keys(law={"type": "lqr", "parameters": {"k": 2.0}}), plugins=registry)
    assert named_laws("lqr,pid,lqr_uncompensated", registry) == ("lqr", "pid", "lqr_uncompensated")
    assert _settings("lqr", scenario, registry) == ("law.type=lqr", "law.delay_compensation=true")
    other = load_scenario(scenario, _settings("pid", scenario, registry))
    assert (other.law.type, other.law.parameters) == ("pid", {})


def test_the_schema_has_the_names_and_keys_of_extensions(tmp_path):
    schema = scenario_schema(load_extensions([own(tmp_path, CONTRACT)]))
    assert "lqr" in schema["$defs"]["Law"]["properties"]["type"]["enum"]
    ceiling, _ = schema["properties"]["extensions"]["anyOf"][0]["properties"]["ceiling"]["anyOf"]
    assert ceiling["required"] == ["top_m"]
    assert ceiling["additionalProperties"] is False

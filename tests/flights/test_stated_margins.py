"""A law from outside may state its own delay margins; nothing is said in their place where it doesn't."""

from __future__ import annotations

import json
import math

import pytest
from click.testing import CliRunner

import gcs_formation
from formation_scenario import load_scenario
from gcs_formation.app.check import check_report, check_text
from gcs_formation.cli import main
from tests.flights.own_files import HEAD, events, flown, keys, own

LAW = (
    HEAD
    + """
@register_law("it")
class It(FollowerLaw):
    def feedback(self, error, error_rate, dt_s):
        return 1.2 * error[0] + error_rate[0], error[1] + error_rate[1], error[2]
"""
)
STATED = (
    LAW
    + """
    def delay_margins_s(self, follower):
        return {"forward": 0.25 * follower.tau_v_s, "height": 0.5 if follower.id == 2 else 0.8}
    def mismatch_margins_s(self, follower, delay_s):
        return {"forward": 0.5 - delay_s}
"""
)
LATE = {"default": {"delay_ms": 100}}


def loaded(directory, code, **more):
    return load_scenario(keys(links=LATE, **more), plugins=[own(directory, code)])


def test_check_prints_what_a_law_states_of_each_followers_loops(tmp_path):
    scenario = loaded(tmp_path, STATED, law={"type": "it"})
    tau_s = scenario.followers[0].model.tau_v_s
    found = check_report(scenario)
    assert found["delay_margin_s"] == found["delay_margin_worst_s"] == {"forward": 0.25 * tau_s, "height": 0.5}
    assert found["mismatch_margin_s"] == {"forward": pytest.approx(0.2)}, "0.3 s of loop delay"
    text = check_text(scenario)
    assert "as law it states them" in text
    assert f"vehicle 3: forward {0.25 * tau_s:.3f}, height 0.800" in text
    assert "# delay margin: –" not in text


def test_check_warns_by_a_stated_margin(tmp_path):
    scenario = loaded(tmp_path, STATED.replace("0.5 if", "0.35 if"), law={"type": "it", "delay_compensation": False})
    assert any(
        "loop height: 0.300 s of delay is 86% of its margin 0.350 s" in w for w in check_report(scenario)["warnings"]
    )


def test_the_watch_in_flight_compares_the_delay_with_what_is_stated(tmp_path):
    law = {"type": "it", "delay_compensation": False}
    summary = flown(tmp_path, own(tmp_path, STATED.replace("0.5 if", "0.35 if")), links=LATE, law=law)
    found = summary.figures["stability"]
    assert found["delay_margin_s"] == 0.35
    assert found["margin_used"] == pytest.approx(found["worst_loop_delay_s"] / 0.35)
    (near,) = {each["vehicle"] for each in events(tmp_path, "delay_margin")}
    assert near == "2"


def test_a_law_that_states_none_of_the_prediction_has_no_used_share_with_it(tmp_path):
    code = STATED.replace("def mismatch_margins_s", "def unused")
    summary = flown(tmp_path, own(tmp_path, code), links=LATE, law={"type": "it"}, duration_s=4)
    found = summary.figures["stability"]
    assert (found["margin_used"], found["delay_margin_s"]) == (None, 0.5)


def test_a_law_over_all_states_the_margins_of_all(tmp_path):
    code = (
        HEAD
        + """
@register_formation_law("all")
class All(FormationLaw):
    def setpoints(self, followers, dt_s):
        return {each.id: each.leader[3:5] + each.leader[2:3] for each in followers}
    def delay_margins_s(self, followers):
        return {"ring": 0.1 * len(followers)}
"""
    )
    assert check_report(loaded(tmp_path, code, law={"type": "all"}))["delay_margin_s"] == {"ring": 0.2}


@pytest.mark.parametrize("wrong", ["1 / 0", "{'forward': math.nan}"])
def test_a_law_that_cannot_state_them_is_named(wrong, tmp_path):
    code = "import math\n" + LAW + f"    def delay_margins_s(self, follower):\n        return {wrong}\n"
    file, scenario = own(tmp_path, code), tmp_path / "s.json"
    scenario.write_text(json.dumps(keys(law={"type": "it"})))
    done = CliRunner().invoke(main, ["check", str(scenario), "--no-fly", "--plugin", str(file)])
    assert done.exit_code == 3
    assert "the law 'it' can't state its margins: " in done.stderr
    assert str(file) in done.stderr


def test_a_law_that_fails_to_state_them_in_flight_ends_it_safely(tmp_path):
    code = STATED.replace("0.5 - delay_s", "0.5 if delay_s < 0.15 else 1 / 0")
    with pytest.raises(gcs_formation.RunAbortedError, match=r"the law .it. could not compute.* line 12"):
        flown(tmp_path, own(tmp_path, code), links=LATE, law={"type": "it"})
    assert events(tmp_path, "failure")
    assert math.isfinite(json.loads((tmp_path / "run" / "summary.json").read_text())["wall_s"])

"""Predictors, estimators of delay, guidance and families of autopilots from files outside of the packages are flown."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
import yaml

import gcs_formation
from formation_scenario import ScenarioError, load_scenario
from formation_scenario.extensions import AUTOPILOT, DELAY_ESTIMATOR, GUIDANCE, PREDICTOR
from formation_scenario.registry import OURS
from formation_scenario.used_extensions import used_extensions
from tests.flights.own_files import EXAMPLES, HEAD, events, flown, keys, own, series

BENDS = {"waypoints_m": [[0, 0, 100], [600, 0, 100], [1200, 300, 108], [1800, 300, 108]]}
LATE = {"default": {"delay_ms": 300}}
BY_MODEL = (
    HEAD
    + """
@register_predictor("it")
class It(Predictor):
    def predict(self, vehicle, to_s, whose):
        return vehicle.by_model(to_s)
"""
)


RUN_IN = {"in_air": True, "run_in_s": 14}


def errors_m(summary, axis="x"):
    return max(each[f"error_{axis}_m"]["max"] for each in summary.figures["followers"].values())


@pytest.mark.slow
def test_a_predictor_is_asked_for_the_states_that_guidance_and_law_act_on(tmp_path):
    more = {"path": BENDS, "links": LATE, "duration_s": 22, "law": {"predictor": {"type": "it"}}, "start": RUN_IN}
    (tmp_path / "a").mkdir()
    by_model = flown(tmp_path / "a", own(tmp_path, BY_MODEL), **more)
    assert errors_m(by_model) < 0.1
    late = BY_MODEL.replace("vehicle.by_model(to_s)", "vehicle.state")
    (tmp_path / "b").mkdir()
    newest = flown(tmp_path / "b", own(tmp_path, late, "late.py"), **more)
    assert errors_m(newest) > 4 * errors_m(by_model)
    resolved = yaml.safe_load((tmp_path / "a" / "run" / "run.yaml").read_text())
    assert resolved["law"]["predictor"] == {"type": "it", "parameters": {}}
    assert by_model.figures["extensions"][0]["kind"] == "predictor"


def test_a_predictor_sees_stamps_and_the_setpoints_in_flight(tmp_path):
    code = BY_MODEL.replace(
        "    def predict",
        """    def take(self, vehicles):
        for each in vehicles:
            late_s = each.acts_s - each.stamp_s
            if each.active and not 0.55 < late_s < 0.85:
                raise LookupError(f"{each.id}: {late_s}")
            if each.active and each.id != 1 and each.stamp_s > 22 and not each.setpoint_at(each.stamp_s).speed_mps > 15:
                raise LookupError(each.setpoint_at(each.stamp_s))
    def predict""",
    )
    flown(tmp_path, own(tmp_path, code), links=LATE, law={"predictor": {"type": "it"}}, duration_s=4, start=RUN_IN)


@pytest.mark.slow
def test_the_example_of_a_predictor_keeps_a_formation(tmp_path):
    law = {"predictor": {"type": "drift", "parameters": {"share": 0.02}}}
    summary = flown(
        tmp_path, EXAMPLES / "drift_predictor.py", path=BENDS, links=LATE, law=law, duration_s=30, start=RUN_IN
    )
    assert errors_m(summary) < 0.2


def test_without_compensation_there_is_nothing_to_predict(tmp_path):
    code = BY_MODEL.replace("return vehicle.by_model(to_s)", "raise LookupError")
    law = {"predictor": {"type": "it"}, "delay_compensation": False}
    assert errors_m(flown(tmp_path, own(tmp_path, code), law=law, duration_s=3)) < 1


@pytest.mark.slow
def test_an_estimator_tells_how_a_round_trip_is_shared(tmp_path):
    leaders = {"changes": [{"at_s": 0, "vehicles": [1], "uplink": {"delay_ms": 400}}]}
    more = {"links": leaders, "duration_s": 6, "start": RUN_IN}
    (tmp_path / "a").mkdir()
    clock = {"clock": "known_asymmetry", "parameters": {"up_share": 1.0}}
    known = flown(tmp_path / "a", EXAMPLES / "known_asymmetry.py", telemetry=clock, **more)
    link = known.figures["links"]["1"]
    assert link["measured_up_ms"] == pytest.approx(400, abs=12)
    assert link["measured_down_ms"] == pytest.approx(0, abs=12)
    assert link["measured_delay_ms"]["p50"] == pytest.approx(200, abs=6)
    assert np.nanmedian(series(tmp_path / "a", "up_s", "1")) == pytest.approx(0.4, abs=0.012)
    (tmp_path / "b").mkdir()
    wrong = {"clock": "known_asymmetry", "parameters": {"up_share": 0.0}}
    off = flown(tmp_path / "b", EXAMPLES / "known_asymmetry.py", telemetry=wrong, **more)
    assert off.figures["links"]["1"]["measured_up_ms"] == 0
    assert errors_m(known) < 0.3
    assert errors_m(off) > 4.0, "its leader's states are taken for 0.4 s younger than they are, at 22 m/s"


def test_each_vehicle_has_an_estimator_of_its_own_that_gets_our_own_delays(tmp_path):
    code = (
        HEAD
        + """
@register_delay_estimator("it")
class It(DelayEstimator):
    def measure(self, trip):
        more = 0.1 * self.vehicle
        return trip.usual_s[0] + more, trip.usual_s[1] + more
"""
    )
    summary = flown(tmp_path, own(tmp_path, code), telemetry={"clock": "it"}, duration_s=1)
    reported_ms = [summary.figures["links"][name]["measured_up_ms"] for name in "123"]
    assert reported_ms == pytest.approx([100, 200, 300], abs=25)


@pytest.mark.slow
def test_the_example_of_a_guidance_keeps_to_the_path(tmp_path):
    guided = {**BENDS, "guidance": {"type": "pursuit", "parameters": {"period_s": 10}}}
    summary = flown(tmp_path, EXAMPLES / "pursuit_guidance.py", path=guided, links=LATE, duration_s=30, start=RUN_IN)
    off_m = summary.figures["path"]["leader"]["across_m"]["max"]
    assert 0.02 < off_m < 1.0
    assert errors_m(summary, "y") < 1.0, "its followers know what it is commanded"


def test_a_guidance_sees_the_route_and_what_ours_would_do(tmp_path):
    code = (
        HEAD
        + """
@register_guidance("it")
class It(LeaderGuidance):
    def steer(self, leader):
        here = leader.route(leader.distance_m)
        off_m = ((here.north_m - leader.state.north_m) ** 2 + (here.east_m - leader.state.east_m) ** 2) ** 0.5
        if not (off_m < 20 and leader.usual.speed_mps > 16 and leader.on_path and leader.length_m > 1500):
            raise LookupError(leader)
        return leader.usual.speed_mps, leader.usual.heading_rad, leader.usual.height_m + 3
"""
    )
    path = {**BENDS, "guidance": {"type": "it"}}
    flown(tmp_path, own(tmp_path, code), path=path, duration_s=14)
    assert series(tmp_path, "true_height_m", "1").min() > 101.0, "ours would bring it back to 100 m"


BROKEN: dict[str, tuple[str, str, str, dict[str, Any]]] = {
    "predictor": ("predictor", "Predictor", "predict(self, *_)", {"law": {"predictor": {"type": "it"}}}),
    "delay estimator": ("delay_estimator", "DelayEstimator", "measure(self, trip)", {"telemetry": {"clock": "it"}}),
    "guidance": ("guidance", "LeaderGuidance", "steer(self, leader)", {"path": {**BENDS, "guidance": {"type": "it"}}}),
}


@pytest.mark.parametrize("kind", BROKEN)
@pytest.mark.parametrize("fails", ["1 / 0", "[float('nan')] * 8", "3", "[-1.0, 0.0]"])
def test_one_that_fails_ends_the_flight_safely_with_its_file_and_line(kind, fails, tmp_path):
    register, base, method, more = BROKEN[kind]
    code = f"{HEAD}@register_{register}('it')\nclass It({base}):\n    def {method}:\n        return {fails}\n"
    file = own(tmp_path, code)
    with pytest.raises(gcs_formation.RunAbortedError) as failed:
        flown(tmp_path, file, duration_s=6, **more)
    assert f"{kind} 'it'" in str(failed.value)
    assert str(file) in str(failed.value)
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["failure"]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"law": {"predictor": {"type": "drif"}}}, "law.predictor.type: found 'drif'; allowed: model, drift (did you"),
        (
            {"law": {"predictor": {"type": "drift", "parameters": {"shar": 1}}}},
            "law.predictor.parameters.shar: found",
        ),
        (
            {"telemetry": {"clock": "gns"}},
            "telemetry.clock: found 'gns'; allowed: round_trip, gnss (did you",
        ),
        ({"telemetry": {"parameters": {"up_share": 1}}}, "none: round_trip has its keys beside telemetry.clock"),
        (
            {"path": {**BENDS, "guidance": {"type": "pursue"}}},
            "path.guidance.type: found 'pursue'; allowed: track; a",
        ),
    ],
)
def test_names_and_keys_are_checked_as_all_others(wrong, said):
    with pytest.raises(ScenarioError) as refused:
        load_scenario(keys(**wrong), plugins=[EXAMPLES / "drift_predictor.py"])
    assert said in str(refused.value)


def test_ours_have_their_names_by_the_same_registry():
    assert OURS[PREDICTOR] == ("model",)
    assert OURS[GUIDANCE] == ("track",)
    assert OURS[DELAY_ESTIMATOR] == ("round_trip", "gnss")
    assert OURS[AUTOPILOT][0] == "emulator"
    for more in ({"law": {"predictor": {"type": "model"}}}, {"path": {**BENDS, "guidance": {"type": "track"}}}):
        assert used_extensions(load_scenario(keys(**more))) == ()
    assert math.isfinite(load_scenario(keys()).duration_s)


FORKED = EXAMPLES / "forked_plane.py"


def fleet(*autopilots, **own_keys):
    """Vehicles with these autopilots, the first leads."""
    keys = [{"id": i + 1, "autopilot": name} for i, name in enumerate(autopilots)]
    keys[0]["role"] = "leader"
    return [each | (own_keys if each["autopilot"] != "emulator" else {}) for each in keys]


def test_a_family_from_outside_commands_its_vehicles_alone(tmp_path):
    vehicles = fleet("emulator", "forked_plane", "emulator", parameters={"height_step_m": 40.0})
    summary = flown(tmp_path, FORKED, vehicles=vehicles, duration_s=12)
    assert np.std(series(tmp_path, "true_height_m", "2")) > 0.05, "commanded to 80 m and to 120 m in turn"
    assert np.std(series(tmp_path, "true_height_m", "3")) < 0.005
    assert [each["name"] for each in summary.figures["extensions"]] == ["forked_plane"]
    resolved = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text())
    assert resolved["vehicles"][1]["parameters"] == {"height_step_m": 40.0}
    assert "parameters" not in resolved["vehicles"][0]


@pytest.mark.parametrize(
    ("method", "when"),
    [("setpoint(self, *_)", "flying"), ("start_up(self, rates_hz)", "start"), ("speaks(self, _)", "start")],
)
def test_a_family_that_fails_is_commanded_as_its_kin_until_the_flight_has_ended(method, when, tmp_path):
    late = "\n        if self.calls < 40:\n            self.calls += 1\n            return super().setpoint(*_)"
    code = (
        "from gcs_formation.extend.autopilots import ArduPlane\n"
        + HEAD
        + "@register_autopilot('it')\nclass It(ArduPlane):\n    calls = 0\n"
        + f"    def changed(self, *_):\n        return list(self.setpoint(*_[:2]))\n    def {method}:"
        + (late if when == "flying" else "")
        + "\n        return 1 / 0\n"
    )
    file = own(tmp_path, code)
    with pytest.raises(gcs_formation.RunAbortedError) as failed:
        flown(tmp_path, file, vehicles=fleet("emulator", "it"))
    assert "the autopilot family 'it' could not compute anything at" in str(failed.value)
    assert f"ZeroDivisionError: division by zero ({file}, line " in str(failed.value)
    if when == "flying":
        texts = [each["text"] for each in events(tmp_path, "mode") if each["vehicle"] == "2"]
        assert texts[-1] == "LOITER", "by the command of its kin"


@pytest.mark.parametrize(
    ("vehicle", "said"),
    [
        (
            {"autopilot": "forked_plan"},
            "vehicles.1.autopilot: found 'forked_plan'; allowed: emulator, arduplane,",
        ),
        ({"autopilot": "forked_plane", "parameters": {"height_step_m": 0}}, "height_step_m: found 0; allowed"),
        ({"parameters": {"height_step_m": 1}}, "none: emulator has its keys beside vehicles.1.autopilot"),
    ],
)
def test_a_family_and_its_keys_are_checked_as_all_others(vehicle, said):
    vehicles = [{"id": 1, "role": "leader"}, {"id": 2, **vehicle}]
    with pytest.raises(ScenarioError) as refused:
        load_scenario(keys(vehicles=vehicles), plugins=[FORKED])
    assert said in str(refused.value)

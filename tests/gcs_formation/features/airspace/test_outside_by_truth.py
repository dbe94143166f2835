"""Who has left the fence, by the vehicles' own truth, whatever setpoints said."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gcs_formation
from formation_scenario import load_scenario
from tests.flights.conftest import Fly, scenario

LIFT = {"at_s": 3, "vehicles": "all", "velocity_mps": [0, 0, -3.5]}
"""Air that rises faster than anybody can sink."""


def test_leaving_the_fence_is_a_violation_by_the_truth_whatever_setpoints_said(fly: Fly, kept_truth):
    keys: dict[str, Any] = {"safety": {"fence": {"height_max_m": 110}}, "disturbances": [LIFT], "duration_s": 20}
    wanted = [{"metric": "fence_m", "below": 0.1}, {"metric": "violations", "below": 1}]
    summary = fly(**keys, expect=wanted)
    safety, (truth,) = summary.to_dict()["safety"], kept_truth
    flown_m = np.where(truth["airborne"] > 0, truth["height_m"], 0.0)
    assert safety["fence_m"] == pytest.approx(flown_m.max() - 110.0, abs=0.01)
    assert safety["fence_m"] > 15.0
    assert safety["violations"] == 1
    assert not summary.held
    (said,) = [text for text in summary.breaches if "outside the fence" in text]
    assert f"{safety['fence_m']:.3g} m" in said
    assert [each.held for each in summary.verdicts] == [False, False]


def test_who_is_blown_into_an_exclusion_has_left_the_fence_by_the_truth(fly: Fly, kept_truth, tmp_path: Path):
    gust = {"at_s": 1, "vehicles": "all", "velocity_mps": [0, 45, 0]}
    lake = {"kind": "exclusion", "centre_m": [150, 280], "radius_m": 100}
    summary = fly(safety={"fence": {"areas": [lake]}}, disturbances=[gust], duration_s=9)
    (truth,), (said,) = kept_truth, summary.breaches
    away_m = np.hypot(truth["north_m"] - 150.0, truth["east_m"] - 280.0)[truth["airborne"] > 0]
    assert summary.to_dict()["safety"]["fence_m"] == pytest.approx(100.0 - away_m.min(), abs=0.01)
    assert 100.0 - away_m.min() > 20.0
    assert "m inside the exclusion circle at" in said
    assert said.endswith("allowed: outside it (safety.fence.areas.0)")
    events = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
    assert any(each["kind"] == "fence" and each["text"].startswith("turned away") for each in events)


@pytest.mark.slow
def test_a_fence_that_none_leaves_is_kept_though_they_take_off_below_it(fly: Fly):
    fence = {"height_min_m": 80, "height_max_m": 200}
    safety = fly(safety={"fence": fence}, duration_s=3, start={"in_air": False}).to_dict()["safety"]
    assert (safety["fence_m"], safety["violations"]) == (0.0, 0)


def test_a_fence_is_needed_to_be_outside_of_it():
    keys = scenario(expect=[{"metric": "fence_m", "below": 1}])
    with pytest.raises(gcs_formation.ScenarioError, match="found fence_m without a fence"):
        load_scenario(keys)

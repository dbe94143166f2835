"""A formation whose vehicles act later than is believed, by more than its loops bear."""

from __future__ import annotations

import json

import pytest

from gcs_formation.testing.flight_plan import Formation


@pytest.mark.slow
def test_followers_that_swing_without_end_are_named_and_why(tmp_path):
    keys = {
        "duration_s": 80,
        "vehicles": {"count": 3, "true_model": {"dead_time_s": 1.2}},
        "start": {"in_air": True, "offset_m": [8, 6, 4], "timeout_s": 5},
        "finish": {"loiter_s": 0},
        "formation": {"shape": "diamond", "spacing_m": 30},
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [3000, 0, 100]]},
    }
    Formation((), tmp_path)(keys).fly()
    (file,) = tmp_path.rglob("events.jsonl")
    events = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    named = [each for each in events if each["kind"] == "limit_cycle" and each["begins"]]
    assert {each["vehicle"] for each in named} == {"2", "3"}
    for each in named:
        assert each["amplitude_m"] > 1.0
        assert 4.0 < each["period_s"] < 9.0
        assert each["late_s"] == pytest.approx(1.2, abs=0.3)
        assert "later than its model says, by a dead time that the model hasn't" in each["text"]

"""Multirotors against a wind that leaves them hardly the speed of their path."""

from __future__ import annotations

import json
from typing import Any

import pytest

from gcs_formation.testing.flight_plan import Formation

KEYS: dict[str, Any] = {
    "duration_s": 45,
    "vehicles": {"count": 3, "autopilot": "arducopter"},
    "start": {"in_air": True, "run_in_s": 10},
    "finish": {"loiter_s": 0},
    "formation": {"shape": "diamond", "spacing_m": 12, "changes": [{"at_s": 12, "shape": "line"}]},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 40], [600, 0, 40]]},
}


@pytest.mark.parametrize(
    ("further", "within_m"),
    [
        pytest.param({}, 4.0, id="found by the change alone", marks=pytest.mark.slow),
        pytest.param({"links": {"default": {"delay_ms": 150, "jitter_ms": 20}}}, 1.5, id="found before it"),
    ],
)
def test_the_leader_leaves_its_followers_speed_for_a_change(tmp_path, further, within_m):
    """They reach 10.7 m/s through the air, 4.7 over ground: without a reserve they were 12 m off their slots."""
    Formation((), tmp_path)(KEYS | further | {"wind": {"velocity_mps": [-6, 0, 0]}}).fly().stays_within(within_m)
    events = _events(tmp_path)
    assert {each["vehicle"] for each in events if each["kind"] == "saturated" and each["begins"]} == {"2", "3"}
    assert not [each for each in events if each["kind"] in {"disobeys", "separation"}]


def test_where_the_wind_leaves_them_enough_nobody_is_slowed_down(tmp_path):
    Formation((), tmp_path)(KEYS | {"wind": {"velocity_mps": [-2, 0, 0]}}).fly()
    assert not [each for each in _events(tmp_path) if each["kind"] == "saturated"]


def test_a_sample_that_stays_the_newest_for_long_shows_no_limit(tmp_path):
    """The downlink is silent while they accelerate: what was flown before is all that is known."""
    keys = {
        "orders": [{"at_s": 5, "order": "speed 0"}, {"at_s": 12, "order": "speed 5"}],
        "formation": {"shape": "diamond", "spacing_m": 12},
        "links": {"changes": [{"at_s": at_s, "downlink": {"loss": loss}} for at_s, loss in ((13.4, 1.0), (14.9, 0.0))]},
        "duration_s": 20,
    }
    Formation((), tmp_path)(KEYS | keys).fly()
    assert not [each for each in _events(tmp_path) if each["kind"] == "saturated"]


def _events(directory: Any) -> list[dict[str, Any]]:
    (file,) = directory.rglob("events.jsonl")
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]

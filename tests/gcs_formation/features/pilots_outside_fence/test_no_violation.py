"""What a pilot flies outside the fence is said, and is no violation."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.flights.conftest import Fly


@pytest.mark.slow
def test_what_a_pilot_flies_outside_is_said_and_is_no_violation(fly: Fly, tmp_path: Path):
    """At the end the others circle above it, and so outside themselves."""
    taken = {"at_s": 2, "vehicles": [3], "kind": "pilot", "mode": "LOITER"}
    lift = {"at_s": 4, "until_s": 9, "vehicles": [3], "velocity_mps": [0, 0, -14]}
    inside = [{"metric": "fence_m", "below": 0.001}]
    summary = fly(
        safety={"fence": {"height_max_m": 140}}, faults=[taken], disturbances=[lift], duration_s=22, expect=inside
    )
    assert summary.to_dict()["safety"]["outside_by_pilot_m"]["3"] > 5.0
    assert summary.verdicts[0].value == 0.0
    events = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
    said = [each for each in events if each["kind"] == "fence" and each.get("vehicle") == "3"]
    assert [each["begins"] for each in said] == [True, False]
    assert "by its pilot or its failsafe" in said[0]["text"]

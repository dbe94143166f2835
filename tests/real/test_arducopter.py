"""Four simulated ArduCopters fly `configs/arducopter.yaml`: stops and changes of the formation included.

Set ARDUCOPTER_SITL to the path of ArduPilot's `arducopter` binary for SITL to run it.
"""

from __future__ import annotations

import json

import pytest
import yaml

from tests.real.simulators import ARDUCOPTER, ROOT, flown, needs

pytestmark = needs("ARDUCOPTER_SITL", "an arducopter SITL binary")


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    keys = yaml.safe_load((ROOT / "configs" / "arducopter.yaml").read_text())
    run = flown(ARDUCOPTER, tmp_path_factory.mktemp("copters"), keys)
    return json.loads((run / "summary.json").read_text())


@pytest.mark.parametrize("axis", ["error_x_m", "error_y_m", "error_z_m"])
def test_followers_keep_their_slots_through_stops_and_changes(summary, axis):
    assert max(follower[axis]["rms"] for follower in summary["followers"].values()) < 0.5


def test_nobody_came_near_another(summary):
    assert summary["safety"]["violations"] == 0
    assert summary["safety"]["min_separation_m"] > 3.0


def test_everybody_was_in_its_slot_soon_after_every_change(summary):
    assert all(follower["in_slot_share"] > 0.8 for follower in summary["followers"].values())

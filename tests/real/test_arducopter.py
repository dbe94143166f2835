"""Four simulated ArduCopters fly `configs/arducopter.yaml`, including stops and changes of the formation.

Set ARDUCOPTER_SITL to the path of ArduPilot's `arducopter` binary for SITL to run it.
"""

from __future__ import annotations

import json

import pytest
import yaml

from tests.processes import events_of
from tests.real.simulators import ARDUCOPTER, ROOT, flown, needs

pytestmark = needs("ARDUCOPTER_SITL", "an arducopter SITL binary")


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    keys = yaml.safe_load((ROOT / "configs" / "arducopter.yaml").read_text())
    run = flown(ARDUCOPTER, tmp_path_factory.mktemp("copters"), keys)
    return json.loads((run / "summary.json").read_text())


def test_a_formation_that_stands_turns_on_the_spot_and_back(tmp_path):
    keys = yaml.safe_load((ROOT / "configs" / "arducopter.yaml").read_text())
    turn = {30: "speed 0", 45: "heading 210", 90: "heading 90", 125: "speed 5"}
    keys |= {"orders": [{"at_s": at_s, "order": order} for at_s, order in turn.items()]}
    keys |= {"path": {"speed_mps": 5, "waypoints_m": [[0, 0, 30], [0, 150, 30], [0, 600, 35]]}}
    run = flown(ARDUCOPTER, tmp_path, keys)
    flight = json.loads((run / "summary.json").read_text())
    assert not [each for each in events_of(run) if "refused" in each["text"]]
    assert flight["safety"]["violations"] == 0
    for follower in flight["followers"].values():
        assert max(follower[f"error_{axis}_m"]["rms"] for axis in "xyz") < 0.5
        assert max(follower[f"error_{axis}_m"]["max"] for axis in "xyz") < 3.0


@pytest.mark.parametrize("axis", ["error_x_m", "error_y_m", "error_z_m"])
def test_followers_keep_their_slots_through_stops_and_changes(summary, axis):
    assert max(follower[axis]["rms"] for follower in summary["followers"].values()) < 0.5


def test_none_came_near_another(summary):
    assert summary["safety"]["violations"] == 0
    assert summary["safety"]["min_separation_m"] > 3.0


def test_everybody_was_in_its_slot_soon_after_every_change(summary):
    assert all(follower["in_slot_share"] > 0.8 for follower in summary["followers"].values())

"""Real autopilots flown by a scenario without a gain or a lag: the shipped model, and gains designed for it."""

from __future__ import annotations

import json

import pytest

from tests.real.simulators import ARDUPLANE, flown, needs

pytestmark = needs("ARDUPLANE_SITL", "an arduplane SITL binary")

COUNT = 4
SPEEDUP = 3
BENDS_AND_CLIMBS = [
    [0, 0, 100],
    [800, 0, 100],
    [1550, 250, 110],
    [2150, 750, 125],
    [2750, 1250, 130],
    [3300, 1800, 130],
]


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    vehicles = [{"id": i, "autopilot": "arduplane"} for i in range(1, COUNT + 1)]
    vehicles[0]["role"] = "leader"
    keys = {
        "vehicles": vehicles,
        "start": {"timeout_s": 900},
        "formation": {"shape": "diamond", "spacing_m": 40},
        "path": {"speed_mps": 22, "waypoints_m": BENDS_AND_CLIMBS},
    }
    run = flown(ARDUPLANE, tmp_path_factory.mktemp("without_gains"), keys, SPEEDUP)
    return json.loads((run / "summary.json").read_text())


@pytest.mark.parametrize(("axis", "below_m"), [("error_x_m", 0.75), ("error_y_m", 0.225), ("error_z_m", 0.75)])
def test_followers_keep_their_slots(summary, axis, below_m):
    assert max(follower[axis]["rms"] for follower in summary["followers"].values()) < below_m


def test_setpoints_of_airspeed_are_quiet(summary):
    assert max(each["effort"]["speed"]["step_p95"] for each in summary["followers"].values()) < 0.15

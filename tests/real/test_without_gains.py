"""Real autopilots flown by a scenario without a gain or a lag: the shipped model, and gains designed for it."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import ExitStack

import pytest
import yaml

from tests.real.test_arduplane import BINARY, ROOT, free_ports, simulated

pytestmark = [
    pytest.mark.skipif(not BINARY, reason="ARDUPLANE_SITL isn't set to the path of an arduplane SITL binary"),
    pytest.mark.slow,
]

COUNT = 4
SPEEDUP = 3
LIMIT_S = 500
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
    directory, ports = tmp_path_factory.mktemp("without_gains"), free_ports(COUNT)
    vehicles = [
        {"id": i, "autopilot": "arduplane", "endpoint": f"udpin:127.0.0.1:{port}"} for i, port in enumerate(ports, 1)
    ]
    vehicles[0]["role"] = "leader"
    scenario = {
        "vehicles": vehicles,
        "start": {"timeout_s": 900},
        "formation": {"shape": "diamond", "spacing_m": 40},
        "path": {"speed_mps": 22, "waypoints_m": BENDS_AND_CLIMBS},
    }
    file = directory / "plain.yaml"
    file.write_text(yaml.safe_dump(scenario))
    with ExitStack() as stack:
        for number, port in enumerate(ports, 1):
            stack.enter_context(simulated(number, port, directory / f"plane{number}"))
        command = [sys.executable, "-m", "gcs_formation", "fly", str(file), "--speedup", str(SPEEDUP)]
        command += ["--out", str(directory / "run")]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads((directory / "run" / "summary.json").read_text())


@pytest.mark.parametrize(("axis", "below_m"), [("error_x_m", 0.75), ("error_y_m", 0.225), ("error_z_m", 0.75)])
def test_followers_keep_their_slots(summary, axis, below_m):
    assert max(follower[axis]["rms"] for follower in summary["followers"].values()) < below_m


def test_setpoints_of_airspeed_are_quiet(summary):
    assert max(each["effort"]["speed"]["step_p95"] for each in summary["followers"].values()) < 0.15

"""`run --sitl`: each shipped scenario of real autopilots from boot to the ground, its simulators started by the run."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests.processes import STATION
from tests.real.simulators import ROOT

SHIPPED = {
    "arduplane": ("arduplane", "ARDUPLANE_SITL"),
    "arducopter": ("arducopter", "ARDUCOPTER_SITL"),
    "px4": ("px4", "PX4_SITL"),
    "px4_copter": ("px4", "PX4_SITL"),
}

BELOW_M = {
    "arduplane": (1.0, 0.5, 1.0),
    "arducopter": (0.5, 0.5, 0.5),
    "px4": (2.0, 2.5, 2.0),
    "px4_copter": (0.8, 0.8, 0.8),
}
"""By ground truth, m RMS, on a machine that keeps up."""
LANDING = [part for index in range(4) for part in ("--set", f"vehicles.{index}.landing={{approach_m: 700}}")]
"""What PX4s land by: their glide slope is at most 5 degrees."""
LIMIT_S = 1500.0


@pytest.mark.slow
@pytest.mark.parametrize("config", SHIPPED)
def test_a_shipped_scenario_is_flown_to_the_ground_and_judged_by_true_states(config: str, tmp_path: Path) -> None:
    family, variable = SHIPPED[config]
    if not (program := os.environ.get(variable)):
        pytest.skip(f"{variable} isn't set to the path of a SITL binary")
    command = [*STATION, "run", f"configs/{config}.yaml", "--sitl", f"{family}={Path(program).absolute()}", "--json"]
    command += ["--speedup", "2", "--set", "finish.then=land", *(LANDING if config == "px4" else ())]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "run")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode in (0, 1), done.stderr
    summary = json.loads(done.stdout)
    assert summary["truth"] is True
    assert summary["safety"]["violations"] == 0
    assert all(each["landed"] for each in summary["finish"]["vehicles"].values())
    for follower in summary["followers"].values():
        for axis, below_m in zip("xyz", BELOW_M[config], strict=True):
            assert follower[f"error_{axis}_m"]["rms"] < below_m

"""Four simulated ArduCopters fly `configs/arducopter.yaml`: stops and changes of the formation included.

Set ARDUCOPTER_SITL to the path of ArduPilot's `arducopter` binary for SITL to run it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import yaml

from tests.real.test_arduplane import ROOT, free_ports

BINARY = os.environ.get("ARDUCOPTER_SITL")
pytestmark = [
    pytest.mark.skipif(not BINARY, reason="ARDUCOPTER_SITL isn't set to the path of an arducopter SITL binary"),
    pytest.mark.slow,
]

LIMIT_S = 900
FIRST_INSTANCE = 60
"""Its RC input is at UDP port 5501 + 10 times this: away from a simulation that somebody else runs."""
APART_DEG = 0.0001
COMPASS = {"X": 5, "Y": 13, "Z": -18}
PARAMETERS = {
    "FRAME_CLASS": 1,
    "FRAME_TYPE": 0,
    "FS_THR_ENABLE": 0,
    "FS_GCS_ENABLE": 1,
    "BATT_MONITOR": 4,
    "INS_ACCOFFS_X": 0.001,
    "INS_ACCOFFS_Y": 0.001,
    "INS_ACCOFFS_Z": 0.001,
    "INS_ACCSCAL_X": 1.001,
    "INS_ACCSCAL_Y": 1.001,
    "INS_ACCSCAL_Z": 1.001,
    "INS_ACC2OFFS_X": 0.001,
    "INS_ACC2OFFS_Y": 0.001,
    "INS_ACC2OFFS_Z": 0.001,
    "INS_ACC2SCAL_X": 1.001,
    "INS_ACC2SCAL_Y": 1.001,
    "INS_ACC2SCAL_Z": 1.001,
    **{f"COMPASS_OFS{which}_{axis}": value for which in ("", 2, 3) for axis, value in COMPASS.items()},
    **{f"RC{channel}_{name}": value for channel in range(1, 9) for name, value in (("MIN", 1000), ("MAX", 2000))},
}
"""Sensors of the simulator count as calibrated only with offsets that aren't 0, its transmitter only with limits."""


@contextmanager
def simulated(number: int, port: int, directory: Path) -> Generator[None]:
    """Run one ArduCopter as system `number`, some way east of the others."""
    directory.mkdir()
    lines = [f"{name} {value}" for name, value in (PARAMETERS | {"MAV_SYSID": number}).items()]
    (directory / "copter.parm").write_text("\n".join(lines) + "\n")
    command = [str(BINARY), "--model", "+", "--speedup", "1", f"-I{FIRST_INSTANCE + number}"]
    command += ["--home", f"35.0,{125.0 + (number - 1) * APART_DEG},0,0", "--defaults", "copter.parm"]
    command += ["--serial0", f"udpclient:127.0.0.1:{port}", "--serial1", "none:0", "--serial2", "none:0"]
    with (directory / "log.txt").open("w") as log:
        process = subprocess.Popen(command, cwd=directory, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        try:
            yield
        finally:
            process.terminate()
            process.wait(10)


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    directory = tmp_path_factory.mktemp("copters")
    keys = yaml.safe_load((ROOT / "configs" / "arducopter.yaml").read_text())
    ports = free_ports(len(keys["vehicles"]))
    for vehicle, port in zip(keys["vehicles"], ports, strict=True):
        vehicle["endpoint"] = f"udpin:127.0.0.1:{port}"
    file = directory / "copters.yaml"
    file.write_text(yaml.safe_dump(keys))
    with ExitStack() as stack:
        for number, port in enumerate(ports, 1):
            stack.enter_context(simulated(number, port, directory / f"copter{number}"))
        command = [sys.executable, "-m", "gcs_formation", "fly", str(file), "--out", str(directory / "run")]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads((directory / "run" / "summary.json").read_text())


@pytest.mark.parametrize("axis", ["error_x_m", "error_y_m", "error_z_m"])
def test_followers_keep_their_slots_through_stops_and_changes(summary, axis):
    assert max(follower[axis]["rms"] for follower in summary["followers"].values()) < 0.5


def test_nobody_came_near_another(summary):
    assert summary["safety"]["violations"] == 0
    assert summary["safety"]["min_separation_m"] > 3.0


def test_everybody_was_in_its_slot_soon_after_every_change(summary):
    assert all(follower["in_slot_share"] > 0.8 for follower in summary["followers"].values())

"""`run --clock virtual --sitl`: real autopilots in step, from boot to the ground, in the scenario's air."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.processes import STATION
from tests.real.simulators import ROOT

SHIPPED = {
    "arduplane": ("arduplane", "ARDUPLANE_SITL"),
    "arducopter": ("arducopter", "ARDUCOPTER_SITL"),
    "px4_copter": ("px4", "PX4_SITL"),
}
AIR = [
    *("--set", "wind.velocity_mps=[-4, 3, 0]"),
    *("--set", "disturbances=[{kind: dryden, at_s: 0, wind_6m_mps: 5}]"),
    *("--set", "finish.then=land"),
]
LINKS = ["--set", "links.default={delay_ms: 150, jitter_ms: 20, loss: 0.02}"]
LIMIT_S = 1500.0


def flown(config: str, out: Path, *options: str) -> dict[str, Any]:
    family, variable = SHIPPED[config]
    if not (program := os.environ.get(variable)):
        pytest.skip(f"{variable} isn't set to the path of a SITL binary")
    command = [*STATION, "run", f"configs/{config}.yaml", "--sitl", f"{family}={Path(program).absolute()}"]
    command += ["--clock", "virtual", "--json", "--out", str(out), *AIR, *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode in (0, 1), done.stderr
    summary: dict[str, Any] = json.loads(done.stdout)
    return summary


@pytest.mark.slow
@pytest.mark.parametrize("config", SHIPPED)
def test_a_shipped_scenario_is_flown_to_the_ground_in_wind_and_no_tick_is_late(config: str, tmp_path: Path) -> None:
    summary = flown(config, tmp_path / "run")
    assert summary["truth"] is True
    assert summary["safety"]["violations"] == 0
    assert summary["control"]["late_ticks"] == 0
    assert all(each["landed"] for each in summary["finish"]["vehicles"].values())


@pytest.mark.slow
def test_real_autopilots_repeat_byte_for_byte_over_impaired_links(tmp_path: Path) -> None:
    for name in ("one", "other"):
        flown("arduplane", tmp_path / name, *LINKS, "--until", "60")
    for name in ("flight.tlog", "events.jsonl", "timeseries.parquet"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()

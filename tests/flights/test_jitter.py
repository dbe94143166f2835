"""How exactly a formation flies behind jitter, which is how exactly its vehicles' clocks are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gcs_formation
from gcs_formation.record import parquet
from tests.flights.conftest import scenario

FAR = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [3000, 0, 100], [6000, 800, 120], [9500, 800, 120]]}


@pytest.mark.slow
@pytest.mark.parametrize(("jitter_ms", "max_m"), [(20, 0.02), (5, 0.01)])
def test_after_two_minutes_jitter_hardly_shows(tmp_path: Path, jitter_ms: float, max_m: float) -> None:
    """300 ms each way, as long as clocks have been known for two minutes; the rms over followers and eight flights.

    What is left is nearly constant in a flight, by a clock's error of up to 1 ms, so two flights may be off by half.
    """
    early, late = list[float](), list[float]()
    for seed in range(1, 9):
        plan = scenario(
            seed=seed,
            duration_s=300,
            start={"in_air": False},
            path=FAR,
            links={"default": {"delay_ms": 300, "jitter_ms": jitter_ms}},
        )
        out = tmp_path / str(seed)
        gcs_formation.run(plan, clock="virtual", out=out)
        table = parquet.read_parquet(out / "timeseries.parquet")
        for vehicle in (2, 3):
            rows = table["vehicle"] == vehicle
            mission_s, error_m = table["mission_time_s"][rows], table["error_x_m"][rows]
            early.append(float(np.nanmean(error_m[(mission_s >= 0) & (mission_s < 30)] ** 2)))
            late.append(float(np.nanmean(error_m[mission_s >= 120] ** 2)))
    assert np.sqrt(max(early)) < 0.15
    assert np.sqrt(np.mean(late)) < max_m

"""A flight over hills: everybody keeps clear of the ground below itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcs_formation.record.timeseries import read_parquet
from tests.flights.conftest import Fly

HILLS = [
    {"name": "steep hill", "north_m": 900, "east_m": 60, "height_m": 70, "radius_m": 180},
    {"name": "ridge aside", "north_m": 500, "east_m": -140, "height_m": 45, "radius_m": 90, "length_m": 300},
]


@pytest.mark.slow
def test_leader_and_followers_keep_the_clearance_over_a_hill_steeper_than_they_climb(fly: Fly, tmp_path: Path) -> None:
    """The ground rises by 5.2 m/s at 22 m/s; climbs are limited to 3 m/s, and links take 300 ms each way."""
    summary = fly(
        duration_s=75,
        path={"speed_mps": 22, "waypoints_m": [[0, 0, 70], [2000, 0, 70]]},
        terrain={"clearance_m": 60, "hills": HILLS},
        formation={"shape": "line", "spacing_m": 60},
        links={"default": {"delay_ms": 300}},
        safety={"clearance_m": 58},
    )
    assert summary.held
    assert 58.0 < summary.to_dict()["safety"]["min_clearance_m"] < 61.0
    columns = read_parquet(tmp_path / "run" / "timeseries.parquet")
    flown = np.isfinite(columns["mission_time_s"])
    aside = flown & (columns["vehicle"] == 2)
    np.testing.assert_allclose(columns["clearance_m"] + columns["ground_height_m"], columns["true_height_m"])
    assert columns["slot_up_m"][aside].max() > 5.0  # for the ridge, which the leader doesn't rise for
    assert columns["slot_up_m"][aside].min() >= -1e-6
    assert np.nanmax(np.abs(columns["error_z_m"][flown])) < 1.0

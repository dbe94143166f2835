"""How the formation flies with the rule turned off."""

from __future__ import annotations

import numpy as np
import pytest

from gcs_formation.record.parquet import read_parquet
from tests.flights.conftest import Fly


@pytest.mark.slow
def test_who_comes_from_afar_doesnt_overshoot_its_slot_by_much(fly: Fly) -> None:
    """With gains for an ArduPlane, from 300 m ahead: its slot passed it by 35 m, and it was 1 m off after 135 s."""
    summary = fly(
        duration_s=70,
        vehicles=[
            {"id": 1, "role": "leader", "model": "arduplane"},
            {"id": 2, "model": {"speed_min_mps": 12, "speed_max_mps": 30}},
        ],
        start={"in_air": True, "run_in_s": 4, "timeout_s": 1, "offset_m": [300, 20, 0]},
        formation={"shape": "custom", "slots_m": {2: [-40, -40, 0]}},
        safety={"avoidance": {"enabled": False}},
    )
    flown = read_parquet(summary.run_dir / "timeseries.parquet")
    flight = (flown["vehicle"] == 2) & np.isfinite(flown["law_error_x_m"]) & (flown["mission_time_s"] >= 0)
    error_m, time_s = flown["law_error_x_m"][flight], flown["mission_time_s"][flight]
    assert error_m[0] < -250, "it is still that far ahead when the path begins"
    assert error_m.max() < 12
    assert np.abs(error_m[time_s > 65]).max() < 1

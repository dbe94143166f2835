"""Formations whose slots are fixed to north and east keep them through turns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcs_formation.record.parquet import read_parquet
from tests.flights.conftest import Fly

BEND = [[0, 0, 100], [300, 0, 100], [480, 120, 100], [480, 420, 100], [300, 600, 100]]
"""North, then east, then back: 135 degrees."""
SLOTS = {2: (-30.0, 30.0, 5.0), 3: (40.0, 0.0, -5.0)}
FORMATION: dict[str, Any] = {
    "shape": "custom",
    "frame": "north",
    "slots_m": {number: list(place) for number, place in SLOTS.items()},
}
REAL: list[dict[str, Any]] = [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 3}]
slow = pytest.mark.slow


def kinds(autopilot: str, *, leader: bool = True) -> list[dict[str, Any]]:
    return [each | {"autopilot": autopilot} for each in REAL if leader or each["id"] != 1]


@pytest.mark.parametrize(
    ("autopilot", "leader", "delay_ms", "law"),
    [
        ("arducopter", True, 300, "fuzzy_pid"),
        *(
            pytest.param(*each, marks=slow)
            for each in (
                ("emulator", True, 300, "fuzzy_pid"),
                ("emulator", True, 0, "fuzzy_pid"),
                ("emulator", False, 300, "fuzzy_pid"),
                ("emulator", True, 0, "consensus"),
                ("emulator", False, 300, "pid"),
                ("arducopter", True, 0, "pid"),
                ("arducopter", False, 300, "fuzzy_pid"),
            )
        ),
    ],
)
def test_followers_stay_north_and_east_of_their_leader_through_a_bend(
    fly: Fly, tmp_path: Path, autopilot: str, leader: bool, delay_ms: float, law: str
) -> None:
    """Multirotors behind a virtual leader, which flies from the start on, are in their slots 30 s later."""
    slower = 4.0 if autopilot == "arducopter" else 1.0
    path = {"speed_mps": 22 / slower, "waypoints_m": [[north / slower, east / slower, 100] for north, east, _ in BEND]}
    summary = fly(
        vehicles=kinds(autopilot, leader=leader),
        formation=FORMATION,
        links={"default": {"delay_ms": delay_ms}},
        law={"type": law},
        path=path,
        start={"in_air": True, "run_in_s": 6 if leader or autopilot == "emulator" else 30},
        duration_s=36.0,
    )
    figures = summary.figures["followers"]
    for number, (north_m, east_m, up_m) in SLOTS.items():
        assert all(figures[str(number)][axis]["rms"] <= 0.1 for axis in ("error_x_m", "error_y_m", "error_z_m"))
        if leader:
            rows = read_parquet(tmp_path / "run" / "timeseries.parquet")
            own, led = rows["vehicle"] == number, rows["vehicle"] == 1
            scored = np.abs(rows["mission_time_s"][own] - 20.0) < 15.0
            for name, wanted_m, axis in zip(
                ("true_north_m", "true_east_m", "true_height_m"),
                (north_m, east_m, up_m),
                ("error_x_m", "error_y_m", "error_z_m"),
                strict=True,
            ):
                distance_m = (rows[name][own] - rows[name][led])[scored]
                assert np.nanmax(np.abs(distance_m - wanted_m)) <= figures[str(number)][axis]["max"] + 1e-6
    assert summary.figures["path"]["centre"]["across_m"]["max"] < 10.0


@slow
def test_changes_of_leader_and_shape_are_flown_clear_of_each_other(fly: Fly) -> None:
    formation = {
        "shape": "arrow",
        "frame": "north",
        "changes": [{"at_s": 5, "shape": "line"}, {"at_s": 22, "leader": 2}],
    }
    summary = fly(vehicles=REAL, formation=formation, path={"speed_mps": 22, "waypoints_m": BEND})
    assert summary.figures["safety"]["min_separation_m"] > 18.0
    assert all(each["in_slot_share"] > 0.95 for each in summary.figures["followers"].values())

"""Flights along legs: every lane of a survey straight, the formation level and in shape on each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.flights.conftest import Fly

IN_SHAPE_M = 0.3
"""Largest error of a follower on a lane, 12 s after the turn before it."""
SETTLED_S = 12.0
ON_LANE_M = 0.5
LEVEL_M = 0.1


def lanes(distance_m: float, count: int, length_m: float) -> list[list[float]]:
    ends = [[[0.0, lane * distance_m, 100.0], [length_m, lane * distance_m, 100.0]] for lane in range(count)]
    return [end for lane, both in enumerate(ends) for end in (both if lane % 2 == 0 else both[::-1])]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("distance_m", "count", "length_m", "delay_ms"),
    [
        (60.0, 2, 350.0, 0),
        *(
            pytest.param(distance_m, 4, 1500.0, 300, marks=pytest.mark.slow)
            for distance_m in (40.0, 60.0, 100.0, 200.0)
        ),
    ],
)
def test_every_lane_is_flown_straight_level_and_in_shape(
    fly: Fly, tmp_path: Path, distance_m: float, count: int, length_m: float, delay_ms: float
) -> None:
    path = {"kind": "legs", "speed_mps": 22, "waypoints_m": lanes(distance_m, count, length_m)}
    formation = {"shape": "diamond", "spacing_m": 30}
    summary = fly(
        path=path,
        formation=formation,
        vehicles={"count": 4},
        duration_s=2000,
        start={"in_air": True, "run_in_s": 12},
        links={"default": {"delay_ms": delay_ms}},
    )
    assert summary.figures["safety"]["violations"] == 0
    table = pq.read_table(tmp_path / "run" / "timeseries.parquet")
    column = {name: table.column(name).to_numpy() for name in table.column_names if name != "phase"}
    phase = np.array(table.column("phase").to_pylist())
    flown = (column["mission_time_s"] >= 0.0) & (phase == "flying")
    leader = flown & (column["vehicle"] == 1)
    times_s, north_m, east_m = (column[name][leader] for name in ("mission_time_s", "true_north_m", "true_east_m"))
    heights_m = column["true_height_m"][flown]
    assert np.abs(heights_m - 100.0).max() < LEVEL_M
    for lane in range(count):
        way = np.cos(column["true_heading_rad"][leader]) * (1 if lane % 2 == 0 else -1) > 0.9
        over = (north_m > 5.0) & (north_m < length_m - 5.0) & (np.abs(east_m - lane * distance_m) < 15.0) & way
        assert np.count_nonzero(over) > 0.8 * (length_m - 10.0) / 22.0 * 10.0
        assert np.abs(east_m[over] - lane * distance_m).max() < ON_LANE_M
        from_s, to_s = times_s[over].min() + SETTLED_S, times_s[over].max()
        in_shape = flown & (column["mission_time_s"] > from_s) & (column["mission_time_s"] < to_s)
        for axis in "xyz":
            errors_m = column[f"error_{axis}_m"][in_shape & (column["vehicle"] != 1)]
            assert errors_m.size
            assert np.abs(errors_m).max() < IN_SHAPE_M


@pytest.mark.slow
def test_legs_of_several_speeds_are_flown_at_them_in_shape_and_in_time(fly: Fly, tmp_path: Path) -> None:
    waypoints = [[0.0, 0.0, 100.0], [500.0, 0.0, 100.0], [1100.0, 0.0, 100.0]]
    summary = fly(
        path={"kind": "legs", "speed_mps": [22, 25], "waypoints_m": waypoints},
        formation={"shape": "diamond", "spacing_m": 30},
        vehicles={"count": 3},
        duration_s=2000,
        links={"default": {"delay_ms": 300}},
    )
    table = pq.read_table(tmp_path / "run" / "timeseries.parquet")
    column = {name: table.column(name).to_numpy() for name in table.column_names if name != "phase"}
    phase = np.array(table.column("phase").to_pylist())
    flown = (column["mission_time_s"] >= 0.0) & (phase == "flying")
    leader = flown & (column["vehicle"] == 1)
    north_m, speed_mps = column["true_north_m"][leader], column["true_airspeed_mps"][leader]
    assert np.abs(speed_mps[north_m < 500.0] - 22.0).max() < 0.1
    assert np.abs(speed_mps[north_m > 900.0] - 25.0).max() < 0.1
    for axis in "xyz":
        assert np.abs(column[f"error_{axis}_m"][flown & (column["vehicle"] != 1)]).max() < IN_SHAPE_M
    along = summary.figures["path"]["leader"]["along_m"]
    assert along["max"] - along["rms"] < 2.0

"""Multirotors along legs: they stop at waypoints, hover, turn in place, fly corners, and keep their slots in all."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import gcs_formation
from flight_model.arrays import Array
from flight_model.stops.timetable import Timetable
from formation_scenario import load_scenario

CORNER = [[0, 0, 30], [40, 0, 30], [40, 30, 30]]
STOP = [{"waypoint": 1, "hold_s": 4}]


def keys(waypoints: Sequence[Sequence[float]], *, count: int = 4, delay_ms: float = 0.0, **more: Any) -> dict[str, Any]:
    path = {"kind": "legs", "speed_mps": 5, "waypoints_m": waypoints}
    return {
        "vehicles": {"count": count, "autopilot": "arducopter"},
        "start": {"in_air": True, "run_in_s": 6},
        "finish": {"loiter_s": 1},
        "formation": {"shape": "diamond", "spacing_m": 12},
        "path": path | more.pop("path", {}),
        "links": {"default": {"delay_ms": delay_ms}},
        "safety": {"separation_m": 3, "clearance_m": 5},
    } | more


def worst(flown: dict[str, Any], figure: str) -> float:
    axes = ("error_x_m", "error_y_m", "error_z_m")
    return max(follower[axis][figure] for follower in flown["followers"].values() for axis in axes)


def leader(directory: Path) -> tuple[Array, Array, Array]:
    """Return the leader's mission times, places (2, T) and ground speeds, until the flight along the path ends."""
    rows = pq.read_table(directory / "timeseries.parquet").to_pydict()
    first = (np.array(rows["leads"]) > 0) & (np.array(rows["phase"]) == "flying")
    columns = {name: np.array(rows[name], dtype=float)[first] for name in ("mission_time_s", *TRUE)}
    return columns["mission_time_s"], np.stack([columns[name] for name in TRUE[:2]]), columns[TRUE[2]]


TRUE = ("true_north_m", "true_east_m", "true_airspeed_mps")


def test_they_hover_at_a_stop_for_the_time_asked_turn_and_go_on(tmp_path):
    """Two of them, over links of 150 ms each way."""
    scenario = load_scenario(keys(CORNER, count=2, delay_ms=300, path={"stops": STOP}))
    flown = gcs_formation.run(scenario, clock="virtual", out=tmp_path / "run").to_dict()
    time_s, place_m, speed_mps = leader(tmp_path / "run")
    assert isinstance(scenario.speeds, Timetable)
    (pause,) = scenario.speeds.pauses
    hovers = (time_s > pause.begin_s + 2.0) & (time_s < pause.end_s - 0.5)
    assert hovers.sum() > 40
    assert np.hypot(*(place_m[:, hovers] - np.array([[40.0], [0.0]]))).max() < 0.5
    assert speed_mps[hovers].max() < 0.2
    assert np.ptp(time_s[(speed_mps < 0.2) & (place_m[1] < 1.0)]) == pytest.approx(pause.end_s - pause.begin_s, abs=1.5)
    assert worst(flown, "max") < 0.5
    assert flown["path"]["leader"]["across_m"]["max"] < 0.4
    assert abs(float(place_m[0, -1]) - 40.0) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("delay_ms", [0, 300])
@pytest.mark.parametrize("distance_m", [10, 40])
def test_lanes_are_flown_whole_in_shape(delay_ms, distance_m, tmp_path):
    ends = [[0, 120], [120, 0]]
    waypoints = [[north, lane * distance_m, 30] for lane in range(3) for north in ends[lane % 2]]
    flown = gcs_formation.run(keys(waypoints, delay_ms=delay_ms), clock="virtual", out=tmp_path / "run").to_dict()
    assert worst(flown, "rms") < 0.1
    assert worst(flown, "max") < 0.35
    assert flown["path"]["leader"]["across_m"]["max"] < 0.25
    assert flown["path"]["leader"]["off_legs_m"] < 0.1
    assert flown["safety"]["min_separation_m"] > 12.0


@pytest.mark.slow
@pytest.mark.parametrize("delay_ms", [0, 300])
def test_corners_are_flown_through(delay_ms, tmp_path):
    waypoints = [[0, 0, 30], [120, 0, 30], [120, 100, 35], [220, 100, 30]]
    flown = gcs_formation.run(keys(waypoints, delay_ms=delay_ms), clock="virtual", out=tmp_path / "run").to_dict()
    assert worst(flown, "rms") < 0.06
    assert worst(flown, "max") < 0.2
    assert flown["path"]["leader"]["across_m"]["max"] < 0.15


@pytest.mark.slow
def test_orders_are_carried_out_between_stops_and_not_at_them(tmp_path):
    orders = [
        {"at_s": 4, "order": "speed 3"},
        {"at_s": 8, "order": "speed 0"},
        {"at_s": 16, "order": "speed 4"},
        {"at_s": 27, "order": "heading 200"},
    ]
    scenario = keys(CORNER, path={"stops": [{"waypoint": 1, "hold_s": 10}]}, orders=orders, duration_s=80)
    flown = gcs_formation.run(scenario, clock="virtual", out=tmp_path / "run").to_dict()
    events = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
    said = [each["text"] for each in events if each["kind"] == "order"]
    assert said[:3] == ["speed 3: accepted", "speed 0: accepted", "speed 4: accepted"]
    assert said[3].startswith("heading 200: refused: found a stop of its path")
    assert worst(flown, "max") < 0.5
    time_s, place_m, _ = leader(tmp_path / "run")
    assert place_m[1, time_s < 60.0].max() > 25.0


@pytest.mark.slow
@pytest.mark.parametrize("at_s", [6, 13, 20])
def test_a_successor_goes_on_from_where_the_leader_was_lost(at_s, tmp_path):
    """On the leg to a stop, at it, and as the formation turns."""
    faults = [{"at_s": at_s, "vehicles": [1], "kind": "crash"}]
    scenario = keys([[0, 0, 30], [40, 0, 30], [40, 130, 30]], path={"stops": STOP}, faults=faults, duration_s=90)
    flown = gcs_formation.run(scenario, clock="virtual", out=tmp_path / "run").to_dict()
    _, place_m, _ = leader(tmp_path / "run")
    later = place_m[1] > 80.0
    assert np.abs(place_m[0, later] - 40.0).max() < 1.0
    assert place_m[1].max() > 120.0
    assert flown["safety"]["min_separation_m"] > 3.0

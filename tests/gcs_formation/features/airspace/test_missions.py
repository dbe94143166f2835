"""Missions as people fly them, flown whole: along their legs, at their heights, inside their fences, in shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import gcs_formation
from flight_model.arrays import Array, Complex, Indices
from flight_model.fence_geometry import Flyers, positions_along
from flight_model.legs.path import LegsPath
from formation_scenario import load_scenario
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.wind_triangle import drift
from tests.gcs_formation.features.airspace.missions import fenced_keys_of
from tests.missions import FLOWN

HZ = 25.0
OFF_LEGS_M = 1.0
OUTSIDE_HEIGHTS_M = 1.0
RMS_M = 0.1
SAMPLE_M = 1.0
BEHIND, AHEAD = 60, 150
"""Samples of the path around the last one in which the next position's nearest is looked for."""


def nearest(way: Complex, places: Complex) -> Indices:
    """Return the index of each place's nearest sample of a way, going along it: it may cross itself."""
    found, at = [], 0
    for place in places.tolist():
        first = max(at - BEHIND, 0)
        at = first + int(np.abs(way[first : at + AHEAD] - place).argmin())
        found.append(at)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("name", FLOWN)
def test_a_mission_is_flown_along_its_legs_at_its_heights_inside_its_fence(name: str, tmp_path: Path) -> None:
    keys = fenced_keys_of(name, links={"default": {"delay_ms": 300}})
    scenario = load_scenario(keys)
    path, waypoints = scenario.written_path, np.array(scenario.path.waypoints_m)
    assert isinstance(path, LegsPath)
    summary = gcs_formation.run(keys, clock="virtual", out=tmp_path / "run")
    assert summary.figures["safety"]["violations"] == 0
    table = pq.read_table(tmp_path / "run" / "timeseries.parquet")
    column: dict[str, Array] = {
        each: table.column(each).to_numpy() for each in table.column_names if each not in ("phase", "leader")
    }
    flown = (column["mission_time_s"] >= 0.0) & (np.array(table.column("phase").to_pylist()) == "flying")

    leader = flown & (column["vehicle"] == 1)
    at_m = np.arange(0.0, path.length_m, SAMPLE_M)
    points = path.at(at_m)
    way = points.north_m + 1j * points.east_m
    places, height_m = (column["true_north_m"] + 1j * column["true_east_m"])[leader], column["true_height_m"][leader]
    index = nearest(way, places)
    off_m = np.abs(((places - way[index]) * np.exp(-1j * points.course_rad[index])).imag)
    straight = np.zeros(index.size, dtype=np.bool_)
    for _, begin_m, end_m in path.straights_m:
        straight |= (at_m[index] >= begin_m) & (at_m[index] <= end_m)
    assert off_m[straight].max() < OFF_LEGS_M

    leg = np.clip(np.searchsorted(path.waypoints_at_m, at_m[index], side="right") - 1, 0, len(waypoints) - 2)
    both = np.stack((waypoints[leg, 2], waypoints[leg + 1, 2]))
    assert np.maximum(height_m - both.max(axis=0), both.min(axis=0) - height_m).max() < OUTSIDE_HEIGHTS_M

    assert scenario.fence is not None
    assert scenario.fence.sides is not None
    everyone = np.stack((column["true_north_m"], column["true_east_m"]), axis=-1)[flown]
    assert scenario.fence.sides.inside_m(everyone).min() > 0.0
    for vehicle in (2, 3, 4):
        follower = flown & (column["vehicle"] == vehicle)
        for axis in "xyz":
            assert np.sqrt(np.mean(column[f"error_{axis}_m"][follower] ** 2)) < RMS_M


@pytest.mark.parametrize("name", FLOWN)
def test_all_slots_of_a_planned_mission_are_inside_its_fence(name: str) -> None:
    scenario = load_scenario(fenced_keys_of(name))
    path = scenario.written_path
    at_m = np.arange(-scenario.run_in_m, path.length_m, scenario.path.begin_mps / HZ)
    points = path.at(at_m)
    assert scenario.fence is not None
    assert scenario.fence.sides is not None
    forward_m, right_m, _ = slot_schedule(scenario)[0].positions_m.T
    way = points.north_m, points.east_m, points.course_rad
    places = positions_along(way, Flyers(forward_m, right_m, np.ones(4)), drift(scenario))
    assert scenario.fence.sides.inside_m(places).min() > 25.0

"""Flights over hills: each vehicle keeps clear of the ground below it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import gcs_formation
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.timeseries import flying
from tests.flights.conftest import Fly

HILLY = Path(__file__).parents[2] / "configs" / "hills.yaml"
HILLS = [
    {"name": "steep hill", "north_m": 900, "east_m": 60, "height_m": 70, "radius_m": 180},
    {"name": "ridge aside", "north_m": 500, "east_m": -140, "height_m": 45, "radius_m": 90, "length_m": 300},
]


@pytest.mark.slow
def test_leader_and_followers_keep_the_clearance_over_a_hill_steeper_than_they_climb(fly: Fly, tmp_path: Path) -> None:
    """At 22 m/s the ground rises by 5.2 m/s; climbs are limited to 3 m/s, and links take 300 ms each way."""
    summary = fly(
        duration_s=75,
        start={"in_air": True, "run_in_s": 12},
        path={"speed_mps": 22, "waypoints_m": [[0, 0, 70], [2000, 0, 70]]},
        terrain={"clearance_m": 60, "hills": HILLS},
        formation={"shape": "line", "spacing_m": 60},
        links={"default": {"delay_ms": 300}},
        safety={"clearance_m": 58},
    )
    assert summary.breaches == ()
    assert 58.0 < summary.to_dict()["safety"]["min_clearance_m"] < 61.0
    columns = read_parquet(tmp_path / "run" / "timeseries.parquet")
    flown = flying(columns)
    to_side = flown & (columns["vehicle"] == 2)
    np.testing.assert_allclose(columns["clearance_m"] + columns["ground_height_m"], columns["true_height_m"])
    assert columns["slot_up_m"][to_side].max() > 5.0  # for the ridge, above which the leader needn't rise
    assert columns["slot_up_m"][to_side].min() >= -1e-6
    assert np.nanmax(np.abs(columns["error_z_m"][flown])) < 1.0


@pytest.mark.slow
def test_shapes_and_leaders_change_over_hills_with_everybody_clear_of_ground_and_each_other(tmp_path: Path) -> None:
    """Slots that change places are lifted over each other in addition to the ground's lift."""
    changes = [{"at_s": 62, "shape": "line"}, {"at_s": 130, "shape": "circle"}, {"at_s": 190, "leader": 2}]
    flown = gcs_formation.run(
        HILLY, clock="virtual", out=tmp_path / "run", duration_s=235, expect=[], formation__changes=changes
    )
    begun = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
    assert sum(event["kind"] == "formation" for event in begun) == 3
    assert not any(event["kind"] == "postponed" for event in begun)
    safety = flown.to_dict()["safety"]
    assert safety["min_separation_m"] >= 15.0
    assert safety["min_clearance_m"] >= 58.0


@pytest.mark.slow
def test_behind_a_leader_that_takes_over_on_a_slope_none_is_commanded_another_height_at_once(
    fly: Fly, tmp_path: Path
) -> None:
    """The successor, 60 m to the side, is lifted for a ridge there; a climb may be up to 0.3 m per tick.

    A height is sent once the integral of what it differs from the last one exceeds 0.2 m s: in such a climb after 4
    ticks, 0.1 s × (0.3 + 0.6 + 0.9 + 1.2) m, so that steps add up those of the ticks for which nothing was sent.
    """
    ridge = {"name": "ridge", "north_m": 500, "east_m": -60, "height_m": 45, "radius_m": 50, "length_m": 500}
    fly(
        duration_s=38,
        start={"in_air": True, "run_in_s": 12},
        path={"speed_mps": 22, "waypoints_m": [[0, 0, 70], [2500, 0, 70]]},
        terrain={"clearance_m": 60, "hills": [ridge, HILLS[0] | {"north_m": 1100}]},
        formation={"shape": "line", "spacing_m": 60},
        links={"default": {"delay_ms": 300}},
        faults=[{"at_s": 25, "vehicles": [1], "kind": "crash"}],
    )
    columns = read_parquet(tmp_path / "run" / "timeseries.parquet")
    follower = columns["vehicle"] == 2
    leads = (columns["vehicle"] == 3) & columns["leads"].astype(bool)
    begun_s = columns["mission_time_s"][leads].min()
    around = np.abs(columns["mission_time_s"] - begun_s) < 5.0
    assert 27.0 < begun_s < 30.0
    for vehicle in (2, 3):
        commanded_m = columns["setpoint_height_m"][around & (columns["vehicle"] == vehicle)]
        steps_m = np.diff(commanded_m)
        sent = np.flatnonzero(steps_m)
        held_ticks = np.diff(sent, prepend=-1)
        assert np.all(np.abs(steps_m[sent]) < 0.5 + 0.3 * np.minimum(held_ticks, 4))
    late = columns["mission_time_s"] > begun_s
    assert columns["clearance_m"][late & (columns["vehicle"] != 1)].min() > 59.0
    assert np.nanmax(np.abs(columns["error_z_m"][late & follower])) < 0.3

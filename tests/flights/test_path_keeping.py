"""Whole flights of configs/paper.yaml whose leader keeps to its path: in bends, after a gust, in turbulence."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
import pytest

from benchmarks import PAPER, both_directions, flown
from benchmarks.headlines import draws
from gcs_formation.record.path_distance import path_distances
from gcs_formation.report import load_run

LONE: dict[str, Any] = {"vehicles": [{"id": 1, "role": "leader"}], "disturbances": [], "expect": []}


@pytest.mark.slow
@pytest.mark.parametrize("delay_ms", [0.0, 300.0])
def test_a_leader_in_bends_at_nine_tenths_of_its_turn_rate_is_on_its_path(delay_ms: float) -> None:
    keys = LONE | {"path__waypoints_m": draws.tight(Random(1), 90.0, 0.225), "links": both_directions(delay_ms)}
    with flown(PAPER, **keys, duration_s=90) as summary:
        assert summary.to_dict()["path"]["leader"]["across_m"]["max"] < 0.3


@pytest.mark.slow
def test_twenty_seconds_after_a_step_of_wind_the_leader_is_back_and_none_left_its_slot() -> None:
    gust = [{"at_s": 20, "velocity_mps": [0, 5, 0]}]
    with flown(PAPER, duration_s=60, disturbances=gust, links=both_directions(300.0), expect=[]) as summary:
        run, figures = load_run(summary.run_dir), summary.to_dict()
    across_m = path_distances(run.scenario, run.flown.vehicles, ())["leader"].across_m
    assert np.abs(across_m[run.time_s > 40.0]).max() < 1.0
    errors = [each[axis]["steady_max"] for each in figures["followers"].values() for axis in ("error_x_m", "error_y_m")]
    assert max(error for error in errors if error is not None) < 0.3


@pytest.mark.slow
def test_in_turbulence_of_a_wind_of_seven_metres_a_second_the_leader_is_a_metre_off() -> None:
    turbulence = [{"at_s": 0, "kind": "dryden", "wind_6m_mps": 7}]
    with flown(PAPER, duration_s=120, disturbances=turbulence, expect=[]) as summary:
        found = summary.to_dict()["path"]["leader"]
    assert found["across_m"]["rms"] < 1.2
    assert found["height_m"]["rms"] < 1.2

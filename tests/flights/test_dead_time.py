"""Vehicles whose autopilots act late: what is known of it is predicted over, what isn't shows as an error."""

from __future__ import annotations

import numpy as np
import pytest

from gcs_formation.testing.flight_plan import Formation

DEAD_S = 0.3
BEND = [[0, 0, 100], [500, 0, 100], [1100, 260, 110], [1500, 700, 110]]


@pytest.fixture
def worst_m(tmp_path):
    """Fly a turn and a climb over 0.3 s each way with this dead time believed; return the largest lateral error."""

    def of(believed_s: float, true_s: float) -> float:
        model = {"model": {"dead_time_s": believed_s}, "true_model": {"dead_time_s": true_s}}
        keys = {
            "duration_s": 45,
            "vehicles": {"count": 3, **model},
            "start": {"in_air": True, "run_in_s": 10},
            "finish": {"loiter_s": 0},
            "formation": {"shape": "diamond", "spacing_m": 30},
            "path": {"speed_mps": 22, "kind": "legs", "waypoints_m": BEND},
            "links": {"default": {"delay_ms": 300}},
        }
        flown = Formation((), tmp_path)(keys).fly()
        series = flown.series(3)
        return float(np.nanmax(np.abs(series["error_y_m"][series["mission_time_s"] > 18.0])))

    return of


@pytest.mark.slow
def test_a_known_dead_time_costs_nothing_and_an_unknown_one_metres_in_a_turn(worst_m):
    assert worst_m(DEAD_S, DEAD_S) < worst_m(0.0, 0.0) + 0.05
    assert worst_m(0.0, DEAD_S) > 0.4

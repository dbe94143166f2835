"""Turns in place at stops, inside a fence."""

import pytest

from formation_scenario import ScenarioError, load_scenario
from formation_scenario.fence_distances import fence_distances

SQUARE = [[0, 0, 30], [150, 0, 30], [150, 100, 30], [0, 100, 30]]


def stopping(fence):
    return load_scenario(
        {
            "vehicles": {"count": 4, "model": "arducopter", "autopilot": "arducopter"},
            "formation": {"shape": "diamond", "spacing_m": 12},
            "start": {"run_in_s": 10},
            "path": {"kind": "legs", "speed_mps": 5.0, "waypoints_m": SQUARE, "stops": [{"waypoint": 1}]},
            "safety": {"separation_m": 3, "clearance_m": 5, "fence": {"corners_m": fence}},
        }
    )


def test_slots_that_swing_in_a_turn_in_place_stay_inside_the_fence():
    """The trailing slot is 24 m behind; as the leader turns at the corner it swings to the west of the first leg."""
    wide = stopping([[-150, -60], [-150, 300], [210, 300], [210, -60]])
    nearest = min(each.least_m for each in fence_distances(wide))
    assert nearest == pytest.approx(60.0 - 24.0, abs=0.1)
    with pytest.raises(ScenarioError, match="outside the fence"):
        stopping([[-150, -18], [-150, 300], [210, 300], [210, -18]])

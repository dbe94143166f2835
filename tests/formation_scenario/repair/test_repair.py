"""What `check --repair` makes of missions that can't be flown: `check` is content with it, in one round."""

import math
from itertools import product
from typing import Any

import numpy as np
import pytest
import yaml

from formation_scenario.repair import repair
from tests.formation_scenario.repair.missions import loaded, mission

COMPETITION = [[0, 0, 60], [600, 300, 110], [900, 1200, 200], [300, 1500, 80], [-800, 1700, 120], [0, 0, 60]]
DENSE = [[400 * math.sin(2 * t), 600 * t, 100 + 2 * math.sin(40 * t)] for t in np.linspace(0, 3, 60).tolist()]
HILL = {"clearance_m": 60, "hills": [{"north_m": 1500, "east_m": 0, "height_m": 150, "radius_m": 400}]}
MISSIONS: dict[str, dict[str, Any]] = {
    "competition": {"path": COMPETITION},
    "triangle": {"path": [[0, 0, 100], [700, 0, 100], [350, 606, 100], [0, 0, 100]]},
    "zigzag": {"path": [[0, 0, 100], [1500, 0, 100], [100, 60, 100], [1500, 120, 100]]},
    "there and back": {"path": [[0, 0, 100], [2000, 0, 100], [0, 0, 100]]},
    "dense": {"path": DENSE},
    "steep": {"path": [[0, 0, 50], [300, 0, 200], [600, 0, 60], [900, 200, 250], [2500, 200, 250]]},
    "below the clearance": {"path": [[0, 0, 50], [1500, 0, 2], [3000, 500, 50], [4500, 500, -20], [6000, 0, 60]]},
    "too fast": {"path": COMPETITION, "speed_mps": 31},
    "too wide": {"path": COMPETITION, "formation": {"spacing_m": 150}},
    "too close": {"path": COMPETITION, "formation": {"spacing_m": 3}},
    "ahead of the leader": {"path": COMPETITION, "formation": {"shape": "circle", "frame": "follower_heading"}},
    "twice the same": {"path": [[0, 0, 100], [0, 0, 100], [1000, 0, 100], [1000, 0.2, 100], [2000, 1500, 100]]},
    "every point twice": {"path": [point for point in COMPETITION for _ in range(4)]},
    "across a gale": {"path": COMPETITION, "wind": {"velocity_mps": [0, 23, 0]}},
    "a hill": {"path": [[0, 0, 50], [2000, 0, 60], [5000, 0, 60]], "terrain": HILL},
    "multirotors": {
        "path": [[0, 0, 40], [100, 0, 40], [100, 50, 80], [0, 50, 10], [0, 0, 2]],
        "speed_mps": 12,
        "vehicles": {"count": 3, "model": "arducopter"},
        "formation": {"spacing_m": 8},
    },
}

LONG = {"dense", "across a gale"}
OFTEN = {
    ("spline", "competition"),
    *(("legs", name) for name in MISSIONS if name not in LONG),
}
"""What a push repairs; the night repairs all of them as both kinds of path."""


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        pytest.param(kind, name, marks=[] if (kind, name) in OFTEN else [pytest.mark.slow])
        for kind, name in product(("spline", "legs"), MISSIONS)
    ],
)
def test_check_is_content_with_a_repaired_mission_at_once(kind: str, name: str) -> None:
    found = repair(mission(kind, **MISSIONS[name]))
    assert not found.left
    assert loaded(found)
    assert bool(found.changes) == bool(found.problems)
    assert all(problem.would_do for problem in found.problems if "more places" not in problem.found)


def test_one_waypoint_too_low_is_raised_by_what_it_lacks_and_nothing_else_changes() -> None:
    low: list[list[float]] = [[0, 0, 50], [2000, 0, 3], [4000, 0, 50]]
    found = repair(mission("legs", low, safety={"clearance_m": 20}))
    (change,) = found.changes
    assert str(change) == "path.waypoints_m.1: moved 17.0 m up, from [2000, 0, 3] to [2000, 0, 20.02]"
    assert loaded(found).path.waypoints_m == ((0, 0, 50), (2000, 0, 20.02), (4000, 0, 50))


def test_a_leg_too_steep_by_little_moves_one_of_its_ends_by_little() -> None:
    """3 m/s at 22 m/s are 136 m in 1000 m, less 6 m for its rounding."""
    found = repair(mission("legs", [[0, 0, 100], [2000, 0, 100], [3000, 0, 235], [3500, 0, 235], [5000, 0, 150]]))
    (change,) = found.changes
    assert change.waypoint == 1
    assert 103.0 < loaded(found).path.waypoints_m[1][2] < 108.0


def test_the_key_says_what_may_be_changed_and_in_which_order() -> None:
    steep = [[0, 0, 100], [2000, 0, 100], [3000, 0, 230], [5000, 0, 230]]
    by = {order: repair(mission("legs", steep, repair={"order": [order]})) for order in ("points", "speed", "circles")}
    assert all(not each.left for each in by.values())
    assert {each.key.rpartition(".")[0] for each in by["points"].changes} == {"path.waypoints_m"}
    assert [each.key for each in by["speed"].changes] == ["path.speed_mps"]
    assert [each.key for each in by["circles"].changes] == ["path.climb"]
    assert 20.0 <= loaded(by["speed"]).path.begin_mps < 22.0


def test_where_nothing_helps_the_limit_in_the_way_is_named() -> None:
    steep = [[0, 0, 100], [1000, 0, 250]]
    found = repair(mission("spline", steep, repair={"order": ["frame"]}))
    assert not found.flies
    assert "up to 3 m/s, vehicle 1's climb_max_mps" in str(found.left[0])
    assert found.problems[0].would_do == "nothing was found; in the way: up to 3 m/s, vehicle 1's climb_max_mps"


def test_speeds_and_circles_stay_with_their_legs_and_waypoints_when_one_is_left_out() -> None:
    path: list[list[float]] = [[0, 0, 100], [0.5, 0, 100], [2000, 0, 100], [4000, 0, 100], [6000, 0, 100]]
    keys = mission("legs", path)
    keys["path"] |= {"speed_mps": [18, 20, 22, 24], "circles": [{"waypoint": 3, "turns": 1}]}
    found = loaded(repair(keys))
    assert found.path.speed_mps == (20, 22, 24)
    assert [each.waypoint for each in found.path.circles] == [2]


def test_a_mission_that_flies_stays_as_it_is() -> None:
    keys = mission("legs", [[0, 0, 100], [3000, 0, 100]])
    found = repair(keys)
    assert not found.changes
    assert yaml.safe_load(found.text()) == keys

"""What `check --repair` makes of missions that leave their fence: `check` is content with it, in one round."""

from typing import Any

import pytest

from formation_scenario.repair import repair
from tests.formation_scenario.repair.missions import loaded, mission

FENCE = [[-350, -350], [-350, 1300], [1250, 1300], [1250, -350]]
LANES: list[list[float]] = [[north, 100 * lane, 100] for lane in range(6) for north in ((0, 900), (900, 0))[lane % 2]]
LAWN_MOWER: dict[str, Any] = {"path": LANES, "safety": {"fence": {"corners_m": FENCE}}}
OUTSIDE: dict[str, Any] = {
    "path": [[0, 0, 100], [900, 0, 100], [1500, 900, 100], [0, 1000, 100]],
    "safety": {"fence": {"corners_m": FENCE}},
}
OUTSIDE_ITS_HEIGHTS: dict[str, Any] = {
    "path": [[0, 0, 100], [1500, 0, 160], [3000, 0, 100]],
    "safety": {"fence": {"height_max_m": 120, "height_min_m": 90}},
}


@pytest.mark.parametrize(
    ("kind", "keys"),
    [
        pytest.param("spline", LAWN_MOWER, id="spline lawn-mower"),
        pytest.param("legs", LAWN_MOWER, id="legs lawn-mower"),
        pytest.param("spline", OUTSIDE, id="spline outside", marks=pytest.mark.slow),
        pytest.param("legs", OUTSIDE, id="legs outside", marks=pytest.mark.slow),
        pytest.param("spline", OUTSIDE_ITS_HEIGHTS, id="spline outside its heights", marks=pytest.mark.slow),
        pytest.param("legs", OUTSIDE_ITS_HEIGHTS, id="legs outside its heights"),
    ],
)
def test_check_is_content_with_a_repaired_mission_at_once(kind: str, keys: dict[str, Any]) -> None:
    found = repair(mission(kind, **keys))
    assert not found.left
    assert loaded(found)
    assert bool(found.changes) == bool(found.problems)
    assert all(problem.would_do for problem in found.problems if "more places" not in problem.found)


def test_a_waypoint_outside_the_fence_moves_inwards_by_little_more_than_it_is_outside() -> None:
    fence = {"fence": {"corners_m": [[-900, -900], [-900, 4000], [3000, 4000], [3000, -900]]}}
    path = [[0, 0, 100], [2000, 0, 100], [3100, 1500, 100], [2000, 3000, 100], [0, 3000, 100]]
    found = repair(mission("legs", path, safety=fence))
    (change,) = found.changes
    assert change.waypoint == 2
    moved = loaded(found).path.waypoints_m[2]
    assert 2600.0 < moved[0] < 3000.0
    assert moved[1:] == (1500.0, 100.0)

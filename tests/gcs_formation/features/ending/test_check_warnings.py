"""What `check` says about the circles at a flight's planned end within its fence."""

from __future__ import annotations

import pytest

from formation_scenario import load_scenario
from gcs_formation.features.ending.check_warnings import final_circles
from tests.flights.conftest import scenario


@pytest.mark.parametrize(("max_m", "told"), [(684.0, True), (685.0, False)])
def test_circles_above_the_fence_are_reported_with_the_highest(max_m: float, told: bool) -> None:
    """40 vehicles at 100 m, whose circles overlap horizontally, circle 15 m above each other: up to 685 m."""
    formation = {"shape": "circle", "spacing_m": 15}
    keys = scenario(vehicles={"count": 40}, formation=formation, safety={"fence": {"height_max_m": max_m}})
    said = "vehicles circle one above the other, up to 685 m; 684 m are allowed (safety.fence.height_max_m)"
    assert list(final_circles(load_scenario(keys))) == [f"path at 660 m, the flight's end: {said}"] * told


def test_multirotors_that_hover_where_they_are_need_no_height() -> None:
    keys = scenario(vehicles={"count": 12, "autopilot": "arducopter"}, formation={"shape": "circle", "spacing_m": 15})
    path = {"speed_mps": 5, "waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 0, 100]]}
    assert list(final_circles(load_scenario(keys | {"path": path, "safety": {"fence": {"height_max_m": 105}}}))) == []

"""What `check` says about the circles at a flight's planned end within its fence."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from formation_scenario import load_scenario
from gcs_formation.features.ending.check_warnings import STEP_S, _climbed_m, final_circles
from gcs_formation.vehicle.reported_motion import ReportedMotion
from tests.flights.conftest import scenario


@pytest.mark.parametrize(("max_m", "told"), [(684.0, True), (685.0, False)])
def test_circles_above_the_fence_are_reported_with_the_highest(max_m: float, told: bool) -> None:
    """40 vehicles at 100 m, whose circles overlap horizontally, circle 15 m above each other: up to 685 m."""
    formation = {"shape": "circle", "spacing_m": 15}
    keys = scenario(vehicles={"count": 40}, formation=formation, safety={"fence": {"height_max_m": max_m}})
    said = "vehicles circle one above the other, up to 685 m; 684 m are allowed (safety.fence.height_max_m)"
    assert list(final_circles(load_scenario(keys))) == [f"path at 660 m, the flight's end: {said}"] * told


@pytest.mark.parametrize(("begin_m", "climb_mps", "goal_m"), [(100.0, 0.0, 145.0), (100.0, -2.0, 130.0)])
def test_vehicles_climb_to_their_circles_no_faster_than_they_can(
    begin_m: float, climb_mps: float, goal_m: float
) -> None:
    """They come to their heights in the time that the climb takes and a few time constants."""
    model = load_scenario(scenario()).vehicles[0].model.autopilot()
    begin = ReportedMotion(0.0, 0.0, 0.0, begin_m, 22.0, 0.0, climb_mps, begin_m)
    settled_s = (goal_m - begin_m) / model.climb_max_mps + 6.0 * (model.tau_ha_s + model.tau_hb_s)
    heights_m = _climbed_m(model, begin, goal_m, 1 + math.ceil(settled_s / STEP_S))
    assert heights_m[0] == begin_m
    assert heights_m[-1] == pytest.approx(goal_m, abs=0.5)
    assert max(after - before for before, after in pairwise(heights_m)) <= model.climb_max_mps * STEP_S + 1e-9


def test_multirotors_that_hover_where_they_are_need_no_height() -> None:
    keys = scenario(vehicles={"count": 12, "autopilot": "arducopter"}, formation={"shape": "circle", "spacing_m": 15})
    path = {"speed_mps": 5, "waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 0, 100]]}
    assert list(final_circles(load_scenario(keys | {"path": path, "safety": {"fence": {"height_max_m": 105}}}))) == []

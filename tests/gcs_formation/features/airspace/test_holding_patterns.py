"""Holding patterns before the path stay inside the fence."""

from __future__ import annotations

import math
import re

import pytest

from flight_model.fence_geometry import CHECKED_M
from formation_scenario import load_scenario
from gcs_formation import from_scenario
from gcs_formation.app.check_links import cramped_pattern
from gcs_formation.features.airspace.keys import Fence
from gcs_formation.guidance.leader_guidance import SETTLE_S, LeaderGuidance
from tests.flights.conftest import scenario

SPEED = 22.0


def fenced(south_m: float, west_m: float, east_m: float) -> LeaderGuidance:
    """Return the same in a fence that is wide enough in the north, after so many rounds that they are longest."""
    corners = ((south_m, west_m), (6000.0, west_m), (6000.0, east_m), (south_m, east_m))
    planned = load_scenario(scenario())
    safety = planned.safety.model_copy(update={"fence": Fence(corners_m=corners)})
    leads = from_scenario.leader_guidance(planned.model_copy(update={"safety": safety}))
    leads.rounds = 9
    return leads


@pytest.mark.parametrize("times", [0.5, 0.75, 1, 2, 3, 4])
def test_the_straight_before_the_path_is_as_long_as_the_fence_has_room_for(times: float) -> None:
    """The turn onto it reaches farther; the outermost slot, 30 m outside and behind, stays 25 m inside the fence."""
    before_m, radius_m = times * SETTLE_S * SPEED, fenced(-9000.0, -2000.0, 2000.0).hold_radius_m()
    outermost_m = before_m + math.hypot(radius_m + 30.0, 30.0)
    leads = fenced(-(outermost_m + CHECKED_M), -2000.0, 2000.0)
    way = leads.holding_pattern(leads.path.at(-44.0), 0.0, 0.0)
    assert way.at(way.length_m).north_m == pytest.approx(-before_m)
    steps = [way.at(way.length_m * step / 500).north_m for step in range(501)]
    assert min(steps) == pytest.approx(-before_m - radius_m, abs=1.0)


@pytest.mark.parametrize("wind_east_mps", [-8.0, 0.0, 8.0])
@pytest.mark.parametrize("side", [1, -1])
def test_a_holding_pattern_is_flown_on_the_side_where_the_fence_has_room(side: int, wind_east_mps: float) -> None:
    west_m, east_m = (-200.0, 2000.0) if side > 0 else (-2000.0, 200.0)
    leads = fenced(-2000.0, west_m, east_m)
    way = leads.holding_pattern(leads.path.at(-44.0), 0.0, wind_east_mps)
    steps = [side * way.at(way.length_m * step / 100).east_m for step in range(101)]
    assert min(steps) > -1.0
    assert max(steps) > leads.hold_radius_m()


@pytest.mark.parametrize("wind_mps", [0.0, 8.0])
def test_a_pattern_without_room_in_the_fence_is_warned_of_and_has_it_in_one_as_much_wider(
    wind_mps: float,
) -> None:
    def said(wider_m: float) -> str | None:
        south, west, north, east = -500 - wider_m, -400 - wider_m, 9500 + wider_m, 400 + wider_m
        fence = {"corners_m": [[south, west], [north, west], [north, east], [south, east]]}
        path = {"waypoints_m": [[0, 0, 200], [9000, 0, 200]]}
        keys = {"vehicles": {"count": 4}, "path": path, "start": {"in_air": True}, "safety": {"fence": fence}}
        return cramped_pattern(load_scenario(keys | {"wind": {"velocity_mps": [0, wind_mps, 0]}}))

    found = re.search(
        r"no room for a holding pattern before the path .* vehicles are turned away; (\d+) m more", str(said(0.0))
    )
    assert found is not None
    assert said(int(found[1])) is None
    assert said(0.9 * int(found[1])) is not None

"""Heights of circles over ground: the fast search finds what an exhaustive one finds."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from formation_scenario.surroundings import Hill
from formation_scenario.terrain import ElevationGrid, Ground, Hills
from gcs_formation.fleet.circle_heights import AROUND_M, GroundFloor
from tests.flights.conftest import scenario

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 30.0)
RANDOM = np.random.default_rng(5)
FAR = st.floats(-4000.0, 4000.0)
HILLS = [
    {"north_m": 800, "east_m": 150, "height_m": 90, "radius_m": 200},
    {"north_m": 1500, "east_m": -400, "height_m": -60, "radius_m": 300, "shape": "cosine"},
    {"north_m": 2500, "east_m": 300, "height_m": 120, "radius_m": 250, "length_m": 900, "bearing_deg": 60},
]


def elevations() -> ElevationGrid:
    """Return a grid of 90 m steps, 5 km across, with voids."""
    values = RANDOM.uniform(0.0, 300.0, (60, 60))
    values[RANDOM.random(values.shape) < 0.1] = np.nan
    return ElevationGrid(values, 35.0 + 0.025, 125.0 - 0.025, 1 / 1200, 1 / 1200, ORIGIN)


GROUNDS: list[Ground] = [Hills(20.0, [Hill.model_validate(each) for each in HILLS]), elevations()]


@pytest.mark.parametrize("ground", GROUNDS, ids=["hills", "file"])
@given(north_m=FAR, east_m=FAR, around_m=st.floats(0.0, 500.0), seed=st.integers(0, 2**32 - 1))
def test_no_ground_around_a_place_is_higher_than_its_bound(ground, north_m, east_m, around_m, seed) -> None:
    draw = np.random.default_rng(seed)
    away, bearing = around_m * np.sqrt(draw.random(200)), draw.uniform(0.0, math.tau, 200)
    around = ground.height(north_m + away * np.cos(bearing), east_m + away * np.sin(bearing))
    (bound_m,) = ground.bound_m(np.array([north_m]), np.array([east_m]), around_m)
    assert np.nan_to_num(around, nan=-np.inf).max() <= bound_m


HIGH = {"speed_mps": 22, "waypoints_m": [[0, 0, 300], [4000, 0, 300]]}
over_hills = cache(lambda: load_scenario(scenario(terrain={"clearance_m": 30, "hills": HILLS}, path=HIGH)))


@given(begins=st.lists(st.tuples(FAR, FAR), min_size=1, max_size=12))
def test_the_highest_circle_is_the_highest_of_all(begins: list[tuple[float, float]]) -> None:
    floor = GroundFloor(over_hills())
    assert floor.highest(begins) == max(floor.top(*each) for each in begins)


def test_circles_that_are_far_from_the_highest_ground_are_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    terrain = {"clearance_m": 30, "hills": HILLS[:1]}
    floor = GroundFloor(load_scenario(scenario(terrain=terrain, path=HIGH)))
    looked, top = list[float](), floor.top
    monkeypatch.setattr(floor, "top", lambda north_m, east_m: looked.append(north_m) or top(north_m, east_m))
    begins = [(north_m, 150.0) for north_m in np.arange(-3000.0, 3000.0, 100.0).tolist()]
    assert floor.highest(begins).height_m == pytest.approx(120.0, abs=0.5)
    assert all(abs(north_m - 800.0) <= AROUND_M + 20.0 for north_m in looked)

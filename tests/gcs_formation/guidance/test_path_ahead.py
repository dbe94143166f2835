"""Points of the path ahead: as far apart as the ground is checked, from where the leader is."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.spline import SplinePath
from gcs_formation.guidance.path_ahead import path_ahead

BENDS = SplinePath([[300, -200, 100], [1300, -200, 100], [2300, 500, 100], [3300, 500, 100]])


@pytest.mark.parametrize(("ahead_m", "count"), [(0.0, 1), (1.0, 2), (164.0, 2), (166.0, 3), (330.0, 3), (331.0, 4)])
def test_on_a_straight_they_are_165_metres_apart_up_to_what_is_asked_for(ahead_m: float, count: int) -> None:
    straight = SplinePath([[300, -200, 100], [3300, -200, 100]])
    assert path_ahead(straight, -700.0, ahead_m) == [pytest.approx((165.0 * each, 0.0)) for each in range(count)]


@settings(max_examples=15, deadline=None)
@given(st.floats(-500.0, 3000.0), st.floats(0.0, 1500.0), st.floats(0.0, 700.0))
def test_a_longer_path_has_the_same_points_and_each_is_on_the_route(
    begin_m: float, ahead_m: float, more_m: float
) -> None:
    points, here = path_ahead(BENDS, begin_m, ahead_m), BENDS.at(begin_m)
    assert path_ahead(BENDS, begin_m, ahead_m + more_m)[: len(points)] == points
    assert 165.0 * (len(points) - 1) >= ahead_m - 1e-6
    there = BENDS.at(begin_m + 165.0 * (len(points) - 1))
    assert (here.north_m + points[-1][0], here.east_m + points[-1][1]) == pytest.approx((there.north_m, there.east_m))
    assert all(math.hypot(*point) <= 165.0 * each + 1e-6 for each, point in enumerate(points))

"""Route tracking: projection onto a route."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.spline import SplinePath
from gcs_formation.guidance.tracking import nearest, project


@given(st.floats(-200.0, 3400.0), st.floats(-100.0, 100.0), st.floats(-60.0, 60.0))
def test_a_place_beside_a_path_is_projected_onto_its_foot(s: float, right_m: float, ahead_m: float) -> None:
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 120]])
    foot = path.at(s)
    north_m = foot.north_m - right_m * math.sin(foot.course_rad)
    east_m = foot.east_m + right_m * math.cos(foot.course_rad)
    assert project(path, north_m, east_m, s + ahead_m) == pytest.approx(s, abs=1e-3)


@given(st.floats(-500.0, 3500.0), st.floats(-800.0, 1500.0), st.floats(0.0, 2800.0), st.floats(10.0, 700.0))
def test_no_point_between_two_distances_is_nearer_than_the_nearest(
    north_m: float, east_m: float, from_m: float, length_m: float
) -> None:
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 120]])

    def away_m(distance_m: float) -> float:
        return math.dist((north_m, east_m), (path.at(distance_m).north_m, path.at(distance_m).east_m))

    found_m = nearest(path, north_m, east_m, from_m, from_m + length_m)
    assert from_m <= found_m <= from_m + length_m
    assert away_m(found_m) <= min(away_m(from_m + length_m * share / 40) for share in range(41)) + 1e-6

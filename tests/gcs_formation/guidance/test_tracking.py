"""Route tracking: projection onto a route."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.spline import SplinePath
from gcs_formation.guidance.tracking import project


@given(st.floats(-200.0, 3400.0), st.floats(-100.0, 100.0), st.floats(-60.0, 60.0))
def test_a_place_beside_a_path_is_projected_onto_its_foot(s: float, right_m: float, ahead_m: float) -> None:
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 120]])
    foot = path.at(s)
    north_m = foot.north_m - right_m * math.sin(foot.course_rad)
    east_m = foot.east_m + right_m * math.cos(foot.course_rad)
    assert project(path, north_m, east_m, s + ahead_m) == pytest.approx(s, abs=1e-3)

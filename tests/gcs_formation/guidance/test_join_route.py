"""The route to the path's start: continuous, ends at the right place and course, never tighter than allowed."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.curve import PathPoint
from gcs_formation.guidance.join_route import join

place = st.floats(-3000, 3000)
course = st.floats(-math.pi, math.pi)


@given(place, place, course, course, st.floats(60, 300))
def test_ends_where_and_as_it_should(
    north: float, east: float, course_in: float, course_out: float, radius: float
) -> None:
    end = PathPoint(north, east, 120.0, course_out)
    route = join(PathPoint(0, 0, 50, course_in), end, radius, 0.1)
    last = route.at(route.length_m)
    assert (last.north_m, last.east_m) == pytest.approx((north, east), abs=1e-5)
    assert math.remainder(last.course_rad - course_out, math.tau) == pytest.approx(0, abs=1e-6)


@given(place, place, course, course)
def test_is_run_by_arc_length_without_jumps(north: float, east: float, course_in: float, course_out: float) -> None:
    route = join(PathPoint(0, 0, 50, course_in), PathPoint(north, east, 120, course_out), 150.0, 0.1)
    for k in range(50):
        here, there = (route.at(route.length_m * k / 50 + d) for d in (0.0, 0.5))
        assert math.hypot(there.north_m - here.north_m, there.east_m - here.east_m) == pytest.approx(0.5, abs=1e-3)
        assert abs(there.curvature_1pm) <= 1 / 150.0 + 1e-12
        assert (there.curvature_rate_1pm2, there.slope_rate_1pm) == (0.0, 0.0)


def test_straight_ahead_is_straight() -> None:
    route = join(PathPoint(0, 0, 100, 0.3), PathPoint(1000 * math.cos(0.3), 1000 * math.sin(0.3), 100, 0.3), 150.0, 0.1)
    assert route.length_m == pytest.approx(1000.0)


def test_height_changes_no_faster_than_the_slope() -> None:
    route = join(PathPoint(0, 0, 50, 0.0), PathPoint(2000, 0, 120, 0.0), 150.0, 0.1)
    assert [route.at(s).height_m for s in (0, 100, 700, 1500)] == pytest.approx([50, 60, 120, 120])

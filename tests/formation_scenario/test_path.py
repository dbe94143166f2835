import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline, make_interp_spline

from flight_model.path import PathError
from flight_model.spline import SplinePath

legs = st.tuples(st.floats(-1.2, 1.2), st.floats(30.0, 3000.0), st.floats(-30.0, 30.0))


@st.composite
def waypoint_lists(draw):
    course = draw(st.floats(-np.pi, np.pi))
    waypoints = [(0.0, 0.0, 100.0)]
    for turn, length, climb in draw(st.lists(legs, min_size=1, max_size=8)):
        course += turn
        north, east, height = waypoints[-1]
        waypoints.append((north + length * np.cos(course), east + length * np.sin(course), height + climb))
    return waypoints


def sampled(path: SplinePath, count: int = 400):
    s = np.linspace(0.0, path.length_m, count)
    return s, path.at(s)


@given(waypoint_lists())
def test_the_basis_functions_sum_to_one(waypoints):
    chords = np.hypot(*np.diff(np.array(waypoints)[:, :2], axis=0).T)
    spline = make_interp_spline(np.append(0.0, np.cumsum(chords)), waypoints, k=3, bc_type="natural")
    count = len(spline.c)
    assert len(spline.t) == (count - 1) + 3 + 2  # n + q + 2 knots for n + 1 points of degree q
    ones = BSpline(spline.t, np.ones(count), 3)
    np.testing.assert_allclose(ones(np.linspace(0.0, chords.sum(), 200)), 1.0, atol=1e-12)


@given(waypoint_lists())
def test_the_path_passes_through_its_waypoints_in_order(waypoints):
    path = SplinePath(waypoints)
    nodes, around = path.at(path.nodes_m), 0.0
    for north, east, height in waypoints:
        s = path.nodes_m[np.hypot(nodes.north_m - north, nodes.east_m - east).argmin()]
        point = path.at(float(s))
        np.testing.assert_allclose((point.north_m, point.east_m, point.height_m), (north, east, height), atol=1e-6)
        assert s >= around
        around = s


@given(waypoint_lists())
def test_the_parameter_is_horizontal_arc_length(waypoints):
    path = SplinePath(waypoints)
    s, _ = sampled(path, 100)
    before, after = path.at(s[1:-1] - 1e-3), path.at(s[1:-1] + 1e-3)
    rate = np.hypot(after.north_m - before.north_m, after.east_m - before.east_m) / 2e-3
    np.testing.assert_allclose(rate, 1.0, atol=2e-6)


@given(waypoint_lists())
def test_arc_length_is_that_of_a_fine_polygon(waypoints):
    path = SplinePath(waypoints)
    _, points = sampled(path, 20_000)
    polygon = np.hypot(np.diff(points.north_m), np.diff(points.east_m)).sum()
    assert polygon == pytest.approx(path.length_m, rel=1e-5)
    assert path.length_m >= np.hypot(waypoints[-1][0], waypoints[-1][1]) - 1e-6


@given(waypoint_lists(), st.floats(0.02, 0.98))
def test_each_derivative_is_the_change_of_what_it_derives(waypoints, share):
    path = SplinePath(waypoints)
    middle = 0.5 * (path.nodes_m[1:] + path.nodes_m[:-1])
    s = float(middle[int(share * len(middle))])
    step = 1e-3 * float(np.diff(path.nodes_m).min())
    before, here, after = path.at(s - step), path.at(s), path.at(s + step)
    scale = max(abs(here.curvature_1pm), 1e-3)
    turn = np.angle(np.exp(1j * (after.course_rad - before.course_rad)))
    assert turn / (2 * step) == pytest.approx(here.curvature_1pm, abs=1e-4 * scale + 1e-12 / step)
    climb = (after.height_m - before.height_m) / (2 * step)
    assert climb == pytest.approx(here.slope, abs=1e-6 + 1e-12 / step)
    rate = (after.curvature_1pm - before.curvature_1pm) / (2 * step)
    assert rate == pytest.approx(here.curvature_rate_1pm2, abs=1e-2 * scale / path.nodes_m[1] + 1e-12)
    slope_rate = (after.slope - before.slope) / (2 * step)
    assert slope_rate == pytest.approx(here.slope_rate_1pm, abs=1e-6 + 1e-12 / step)


def test_waypoints_of_a_circle_give_its_curvature():
    radius, angles = 800.0, np.linspace(0.0, 1.5 * np.pi, 90)
    circle = np.column_stack((radius * np.sin(angles), radius * (1 - np.cos(angles)), np.full(90, 120.0)))
    path = SplinePath(circle)
    # The ends' curvature is zero, so the end legs are a little shorter than their arcs.
    assert 1.5 * np.pi * radius * (1 - 2e-6) < path.length_m < 1.5 * np.pi * radius
    inner = path.at(np.linspace(0.1, 0.9, 500) * path.length_m)
    np.testing.assert_allclose(inner.curvature_1pm, 1 / radius, rtol=1e-3)  # a right turn is positive
    left = SplinePath(circle * [1, -1, 1]).at(np.linspace(0.1, 0.9, 500) * path.length_m)
    np.testing.assert_allclose(left.curvature_1pm, -1 / radius, rtol=1e-3)


def test_two_waypoints_are_a_straight_line():
    path = SplinePath([[0, 0, 100], [300, 400, 150]])
    assert path.length_m == pytest.approx(500.0)
    _, points = sampled(path)
    np.testing.assert_allclose(points.course_rad, np.arctan2(400, 300))
    np.testing.assert_allclose(points.curvature_1pm, 0.0, atol=1e-12)
    np.testing.assert_allclose(points.slope, 0.1, atol=1e-12)


def test_three_waypoints_turn_smoothly():
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 120]])
    assert path.at(0.0).curvature_1pm == pytest.approx(0.0, abs=1e-9)
    assert path.at(path.length_m).curvature_1pm == pytest.approx(0.0, abs=1e-9)
    assert path.at(path.length_m / 2).curvature_1pm > 0.0


@given(waypoint_lists(), st.floats(1e-3, 5000.0))
def test_beyond_its_ends_the_path_goes_straight_and_level(waypoints, beyond):
    path = SplinePath(waypoints)
    for edge, s in ((0.0, -beyond), (path.length_m, path.length_m + beyond)):
        end, point = path.at(edge), path.at(s)
        ahead = s - edge
        expected = (end.north_m + ahead * np.cos(end.course_rad), end.east_m + ahead * np.sin(end.course_rad))
        np.testing.assert_allclose((point.north_m, point.east_m), expected, atol=1e-6)
        assert (point.height_m, point.course_rad) == (end.height_m, end.course_rad)
        assert point.values()[4:] == (0.0, 0.0, 0.0, 0.0)


@given(waypoint_lists(), st.lists(st.floats(-0.5, 1.5), min_size=1, max_size=9))
def test_an_array_gives_what_its_elements_give(waypoints, shares):
    path = SplinePath(waypoints)
    s = np.array(shares) * path.length_m
    for name, column in path.at(s)._asdict().items():
        single = [getattr(path.at(float(one)), name) for one in s]
        np.testing.assert_allclose(column, single, rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("waypoints", "waypoint"),
    [
        ([[0, 0, 0], [0, 0, 50]], 1),
        ([[0, 0, 0], [9, 0, 0], [9, 0.9, 0]], 2),
        ([[0, 0, 0], [9, 0, 0], [0, 0, 0]], 1),
    ],
)
def test_waypoints_without_a_leg_between_them_are_refused(waypoints, waypoint):
    with pytest.raises(PathError) as refused:
        SplinePath(waypoints)
    assert refused.value.waypoint == waypoint

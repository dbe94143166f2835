"""The signed distance to a fence's areas, against winding numbers and distances to densely sampled edges."""

from __future__ import annotations

import numpy as np
import pytest

from flight_model.arrays import Array, Mask
from flight_model.fence_geometry import Circle, FenceArea, FenceAreas, Polygon

STAR = np.array([[0, 1000], [150, 300], [900, 500], [250, 0], [700, -800], [0, -200], [-800, -700], [-300, 100]], float)
WIDE = np.array([[-1200, -1200], [1200, -1100], [1300, 1200], [-1100, 1300]], float)
OUT = Circle(np.array([300.0, 200.0]), 180.0)
IN = Circle(np.array([100.0, 0.0]), 700.0)
KEPT_OUT = Polygon(np.array([[-600, -600], [-200, -650], [-400, -100]], float))
SAMPLES = 4000
SAMPLED_M = 2.0
"""Accuracy of distances to edges that are known by so many points, the very corners apart."""


def winding(polygon: Array, points: Array) -> Array:
    """Return how often (N,) a polygon winds around points (N, 2): the sum of the angles under which edges are seen."""
    seen = polygon[None] - points[:, None]
    angle = np.arctan2(seen[..., 1], seen[..., 0])
    turn = np.roll(angle, -1, axis=1) - angle
    return np.abs(np.round(((turn + np.pi) % (2 * np.pi) - np.pi).sum(axis=1) / (2 * np.pi)))


def inside(area: FenceArea, points: Array) -> Mask:
    if isinstance(area.shape, Polygon):
        return winding(area.shape.corners_m, points) > 0
    return np.asarray(((points - area.shape.centre_m) ** 2).sum(axis=1) < area.shape.radius_m**2)


def edge(area: FenceArea) -> Array:
    """Return points (K, 2) of an area's edge."""
    if isinstance(area.shape, Circle):
        angle = np.linspace(0.0, 2.0 * np.pi, SAMPLES)
        return area.shape.centre_m + area.shape.radius_m * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    corners = area.shape.corners_m
    share = np.linspace(0.0, 1.0, SAMPLES // len(corners))[:, None, None]
    along: Array = corners + share * (np.roll(corners, -1, axis=0) - corners)
    return along.reshape(-1, 2)


def allowed(fence: FenceAreas, points: Array) -> Mask:
    """Return whether vehicles may be at points (N, 2)."""
    within = [inside(each, points) for each in fence.areas if each.inclusion]
    without = [~inside(each, points) for each in fence.areas if not each.inclusion]
    into = (np.any if fence.any_inclusion else np.all)(within, axis=0) if within else np.ones(len(points), dtype=bool)
    return np.asarray(into & np.all(without, axis=0)) if without else np.asarray(into)


def fence(*areas: tuple[Polygon | Circle, bool], any_inclusion: bool = False) -> FenceAreas:
    named = (
        FenceArea(shape, inclusion, f"safety.fence.areas.{index}") for index, (shape, inclusion) in enumerate(areas)
    )
    return FenceAreas(tuple(named), any_inclusion)


FENCES = {
    "a star": fence((Polygon(STAR), True)),
    "a circle": fence((IN, True)),
    "keep out of a star": fence((Polygon(STAR), False)),
    "a circle in a polygon": fence((Polygon(WIDE), True), (OUT, False)),
    "all of everything": fence((Polygon(WIDE), True), (IN, True), (OUT, False), (KEPT_OUT, False)),
    "one of two": fence((Polygon(STAR), True), (IN, True), (OUT, False), any_inclusion=True),
}


@pytest.mark.parametrize("name", FENCES)
def test_the_distance_is_that_to_the_nearest_edge_and_positive_where_vehicles_may_be(name: str) -> None:
    found, points = FENCES[name], np.random.default_rng(4).uniform(-1500.0, 1500.0, (300, 2))
    within_m, may = found.inside_m(points), allowed(found, points)
    assert np.array_equal(within_m > 0.0, may)
    # The edge of what is allowed: those points of areas' edges next to which both is found.
    edges = np.concatenate([edge(each) for each in found.areas])
    beside = [allowed(found, edges + step) for step in 0.5 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1.0]])]
    border = edges[np.any(beside, axis=0) & ~np.all(beside, axis=0)]
    true_m = np.sqrt(((points[:, None] - border[None]) ** 2).sum(axis=-1).min(axis=1))
    assert np.all(np.abs(within_m) <= true_m + 0.1)
    exact = (may & (not found.any_inclusion)) | (len(found.areas) == 1)
    assert exact.sum() > 5 or found.any_inclusion
    assert within_m[exact] == pytest.approx(np.where(may, true_m, -true_m)[exact], abs=SAMPLED_M)


def test_the_area_named_is_the_one_whose_edge_is_nearest() -> None:
    found = FENCES["all of everything"]
    named = {(300.0, 200.0): "areas.2", (-400.0, -400.0): "areas.3", (2000.0, 0.0): "areas.1", (780.0, 0.0): "areas.1"}
    for point, key in named.items():
        assert found.nearest(np.array(point)).key == f"safety.fence.{key}", point


def test_of_inclusions_of_which_one_is_enough_the_nearer_one_is_named() -> None:
    other = Circle(np.array([3000.0, 0.0]), 500.0)
    found = fence((IN, True), (other, True), any_inclusion=True)
    assert found.inside_m(np.array([3000.0, 0.0])) == pytest.approx(500.0)
    assert [found.nearest(np.array([north_m, 0.0])).key[-1] for north_m in (900.0, 2400.0)] == ["0", "1"]
    assert [str(each) for each in FENCES["a circle in a polygon"].areas] == ["inclusion polygon", "exclusion circle"]


def test_shapes_too_far_to_matter_change_nothing_and_unknown_points_stay_unknown() -> None:
    rng = np.random.default_rng(9)
    lakes: list[Polygon | Circle] = [
        Circle(rng.uniform(-2000.0, 2000.0, 2), float(rng.uniform(20.0, 300.0))) for _ in range(30)
    ]
    woods: list[Polygon | Circle] = [
        Polygon(rng.uniform(-2000.0, 2000.0, 2) + rng.uniform(-300.0, 300.0, (5, 2))) for _ in range(30)
    ]
    found = fence((Polygon(WIDE), True), *((shape, False) for shape in (*lakes, *woods)))
    points = rng.uniform(-1500.0, 1500.0, (20, 10, 2))
    points[3, 4] = np.nan
    each = [area.allowed_m(points) for area in found.areas]
    assert np.array_equal(found.inside_m(points), np.min(each, axis=0), equal_nan=True)
    one_by_one = [[found.inside_m(point) for point in row] for row in points]
    assert np.array_equal(np.array(one_by_one), np.min(each, axis=0), equal_nan=True)
    assert np.isnan(fence((lakes[0], False)).inside_m(points[3])[4])
    assert found.inside_m(np.zeros((0, 2))).shape == (0,)

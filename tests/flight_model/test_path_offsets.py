import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.path_offsets import Bounds, ClearanceOffset, min_offset, sample_distances
from formation_scenario.surroundings import Hill
from formation_scenario.terrain import Hills

BOUNDS = Bounds(slope=0.095, curvature_1pm=7.7e-4)
NOTHING = np.zeros(0)
heights = st.tuples(st.floats(0.0, 4000.0), st.floats(-60.0, 60.0), st.floats(100.0, 500.0))


def test_no_need_no_offset():
    distances_m = sample_distances(0.0, 50)
    assert not min_offset(0.0, np.full(distances_m.shape, -1.0), 0 * distances_m, BOUNDS, NOTHING).control_m.any()


def test_a_spike_is_cleared_by_the_steepest_slopes_and_the_sharpest_bends():
    """By hand: height H takes H/m + m/k on either side, point-symmetric about its half: the area is H times that."""
    distances_m = sample_distances(0.0, 200)
    offset = min_offset(0.0, np.where(distances_m == 2000.0, 60.0, 0.0), 0 * distances_m, BOUNDS, NOTHING)
    half_m = 60.0 / BOUNDS.slope + BOUNDS.slope / BOUNDS.curvature_1pm
    value, slope, _ = offset.at(2000.0 + half_m * np.array([-1.03, -0.5, 0.0, 0.5, 1.03]))
    assert value == pytest.approx([0.0, 30.0, 60.0, 30.0, 0.0], abs=0.5)
    assert slope == pytest.approx(BOUNDS.slope * np.array([0.0, 1.0, 0.0, -1.0, 0.0]), abs=0.01)
    assert offset.at(np.arange(0.0, 4000.0))[0].sum() == pytest.approx(60.0 * half_m, rel=0.01)


@settings(max_examples=30)
@given(st.lists(heights, max_size=8), st.floats(-0.03, 0.03))
def test_whatever_the_hills_the_offset_clears_them_within_its_bounds(hills, own_slope):
    ground = Hills(0.0, [Hill(north_m=n, east_m=0.0, height_m=h, radius_m=r) for n, h, r in hills])
    distances_m, finer = sample_distances(0.0, 200), np.arange(0.0, 4000.0, 1.0)
    needed = ground.height(distances_m, 0 * distances_m) - 20.0 - own_slope * distances_m
    offset = min_offset(0.0, needed, np.full(distances_m.shape, own_slope), BOUNDS, NOTHING)
    value, slope, curvature = offset.at(finer)
    assert offset.short_m == pytest.approx(0.0, abs=1e-6)
    assert (value >= ground.height(finer, 0 * finer) - 20.0 - own_slope * finer - 0.03).all()
    assert value.min() >= -1e-6
    assert np.abs(slope + own_slope).max() <= BOUNDS.slope + 1e-6
    assert np.abs(curvature).max() <= BOUNDS.curvature_1pm + 1e-8
    assert slope == pytest.approx(np.gradient(value, finer), abs=5e-4)


def test_an_offset_goes_on_where_it_was_and_says_what_is_missing():
    distances_m = sample_distances(0.0, 100)
    needed = np.where(distances_m > 200.0, 100.0, 0.0)
    begun = np.array([4.0, 5.0, 6.0])
    offset = min_offset(0.0, needed, 0 * distances_m, BOUNDS, begun)
    np.testing.assert_array_equal(offset.control_m[:3], begun)
    assert 60.0 < offset.short_m < 100.0
    assert (offset.at(distances_m)[0] >= needed - offset.short_m - 1e-6).all()


def test_an_offset_that_begins_low_and_steep_goes_on_so_and_comes_up_to_nothing_within_the_bounds():
    distances_m = sample_distances(0.0, 100)
    begun = np.array([-10.0, -12.5, -15.0])  # steeper than the bounds allow
    offset = min_offset(0.0, 0 * distances_m - 1.0, 0 * distances_m, BOUNDS, begun)
    np.testing.assert_array_equal(offset.control_m[:3], begun)
    _, slope, curvature = offset.at(np.arange(60.0, 2000.0))
    eased_m = (0.125 - BOUNDS.slope) / BOUNDS.curvature_1pm
    assert np.abs(slope[int(eased_m) + 20 :]).max() <= BOUNDS.slope + 1e-6
    assert np.abs(curvature).max() <= BOUNDS.curvature_1pm + 1e-8
    assert offset.at(distances_m)[0].max() < 0.5
    assert offset.at(np.array([800.0]))[0] == pytest.approx([0.0], abs=1e-6)


@given(st.lists(st.floats(-60.0, 60.0), min_size=4, max_size=9), st.floats(-100.0, 300.0))
def test_one_distance_gives_the_same_bits_as_an_array_of_them(control_m, distance_m):
    offset = ClearanceOffset(20.0, np.array(control_m))
    assert offset.at_one(distance_m) == tuple(float(each[0]) for each in offset.at(np.array([distance_m])))

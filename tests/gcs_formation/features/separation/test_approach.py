"""The instants at which manoeuvres are checked, and predicted positions of vehicles that fly on unchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcs_formation.features.separation.approach import MinimumDistance, may_come_near, sample_times
from gcs_formation.features.separation.traffic import free_heights
from tests.gcs_formation.features.separation.encounters import KEPT_M, Vehicles, picture, wanted


@pytest.mark.parametrize(
    ("first_s", "horizon_s", "times_s"),
    [
        (0.3, 6.0, (0.0, 0.3, 0.8, 1.3, 1.8, 2.3, 2.8, 3.3, 3.8, 4.8, 5.8, 6.8)),
        (0.5, 2.0, (0.0, 0.5, 1.0, 1.5, 2.5)),
    ],
)
def test_manoeuvres_are_looked_at_by_half_seconds_and_then_by_seconds_beyond_the_horizon(
    first_s: float, horizon_s: float, times_s: tuple[float, ...]
) -> None:
    np.testing.assert_allclose(sample_times(first_s, horizon_s), times_s)


def test_the_wind_carries_those_who_go_on_as_they_are() -> None:
    vehicles = Vehicles([[0, 0, 100, 22, 0.5, 0]])
    state = vehicles.state
    state.wind_north_mps[:], state.wind_east_mps[:] = 3.0, -4.0
    made = picture(vehicles, state, wanted(vehicles, 0.0))
    expected = [[22 * np.cos(0.5) + 3.0], [22 * np.sin(0.5) - 4.0]]
    np.testing.assert_allclose(made.velocity_mps, expected)


def test_two_that_are_commanded_keep_less_than_from_others_and_nothing_from_themselves() -> None:
    vehicles = Vehicles([[0, 0, 100, 22, 0, 0], [0, 50, 100, 22, 0, 0], [0, 90, 100, 22, 0, 0]], [True, True, False])
    made = picture(vehicles, vehicles.state, wanted(vehicles, 0.0))
    made = replace(made, slots_m=np.diag((7.5, 0.0, 100.0)), timing_s=np.array((0.1, 0.2, 0.4)))
    minimum = made.minimum(np.array((0, 0, 1)), np.array((1, 2, 2)))
    np.testing.assert_allclose(minimum.distance_m, (6.0, KEPT_M, KEPT_M))
    np.testing.assert_allclose(minimum.timing_s, (0.3, 0.5, 0.6))
    twice = replace(made, vehicles=np.array((0, 1, 1)))
    assert not np.any(twice.minimum(np.array((1,)), np.array((2,))))


def test_the_heights_beside_others_are_taken_nearest_first_on_ones_own_side_and_never_below_the_floor() -> None:
    """1 m more than the kept distance, plus what passing speed with a timing error costs: 10 m/s times 0.2 s."""
    rows: list[list[float]] = [[0, 0, 100, 22, 0, 0], [0, 50, 98, 22, 0, 0], [0, 90, 21, 32, 0, 0]]
    vehicles = Vehicles(rows, delay_s=0.5)
    made = picture(vehicles, vehicles.state, wanted(vehicles, 0.0))
    others, ends_m = np.array((1, 2)), np.array((98.0, 21.0))
    heights = [109.0, 87.0, 34.0]  # 21 - 13 would be below the floor
    assert free_heights(made, 0, others, ends_m, 0.0).tolist() == pytest.approx(heights)
    assert free_heights(made, 0, others, ends_m, -1.0).tolist() == pytest.approx([87.0, 109.0, 34.0])


@pytest.mark.parametrize(
    ("floor_m", "heights_m"), [(31.9, [109.0, 87.0, 32.0]), (32.0, [109.0, 87.0, 32.0]), (32.1, [109.0, 87.0])]
)
def test_a_height_at_the_floor_is_free_and_none_below_it(floor_m: float, heights_m: list[float]) -> None:
    """11 m above one at 21 m; to pass below it would be at 10 m."""
    rows: list[list[float]] = [[0, 0, 100, 22, 0, 0], [0, 50, 98, 22, 0, 0], [0, 90, 21, 22, 0, 0]]
    vehicles = Vehicles(rows, floor_m=floor_m)
    made = picture(vehicles, vehicles.state, wanted(vehicles, 0.0))
    assert free_heights(made, 0, np.array((1, 2)), np.array((98.0, 21.0)), 0.0).tolist() == heights_m


@pytest.mark.parametrize(("east_m", "near"), [(11.9, True), (12.1, False)])
def test_a_timing_error_counts_at_the_speed_of_the_fastest_of_ones_ways(east_m: float, near: bool) -> None:
    """One stands or flies 8 m north in 2 s: 10 m, and 0.5 s at 4 m/s."""
    ours, theirs = np.zeros((2, 2, 2)), np.array((((4.0,), (4.0,)), ((east_m,), (east_m,))))
    ours[0, 1, 1] = 8.0
    minimum = MinimumDistance(np.array([10.0]), np.array([0.5]))
    assert may_come_near(ours, theirs, minimum, np.array((0.0, 2.0))).tolist() == [near]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("along", [0, 1])
def test_one_that_comes_to_where_another_has_been_is_not_near_it(along: int, sign: float) -> None:
    """It follows 80 m behind; what both cover in a second is 60 m apart."""
    times_s, ours, theirs = np.arange(5.0), np.zeros((2, 5, 1)), np.zeros((2, 5, 1))
    ours[along, :, 0] = sign * 20.0 * (times_s - 4.0)
    theirs[along, :, 0] = sign * 20.0 * times_s
    minimum = MinimumDistance(np.array([59.0]), np.array([0.0]))
    assert may_come_near(ours, theirs, minimum, times_s).tolist() == [False]

"""Vehicles choose one after another, the last first, each against the trajectories already chosen."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcs_formation.features.separation.conflict_resolution import resolve
from tests.gcs_formation.features.separation.encounters import Vehicles, picture, wanted


@pytest.mark.parametrize(
    ("second_m", "side"),
    [
        pytest.param(121.5, [0.0, -1.0, -1.0], id="the last one as it began, the other one outside"),
        pytest.param(145.0, [0.0, 1.0, -1.0], id="both as they began"),
    ],
)
def test_where_only_one_of_two_can_pass_between_others_it_is_the_last(second_m: float, side: list[float]) -> None:
    """Two followers above each other meet one vehicle each: 1 m below the first, and 1 m above the second.

    They have begun to pass on the inside, 11 m from those that they meet, where the one would be 1.5 m above the other.
    """
    rows: list[list[float]] = [
        [0, -900, 100, 22, 0, 0],
        [0, 0, 100, 22, 0, 0],
        [0, 0, second_m, 22, 0, 0],
        [400, 0, 99, 22, math.pi, 0],
        [400, 0, second_m + 1.0, 22, math.pi, 0],
    ]
    vehicles = Vehicles(rows, commanded=[True] * 3 + [False] * 2)
    decided = resolve(picture(vehicles, vehicles.state, wanted(vehicles, 0.0)), np.array((0.0, 1.0, -1.0, 0.0, 0.0)))
    assert decided.side[:3].tolist() == side
    inside_m, outside_m = 99.0 + 11.0, 99.0 - 11.0
    expected = [inside_m if side[1] > 0.0 else outside_m, second_m + 1.0 - 11.0]
    assert decided.setpoints.height_m[1:3].tolist() == pytest.approx(expected)

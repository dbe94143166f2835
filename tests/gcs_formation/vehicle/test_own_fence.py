"""Geofences by ArduPilot's FENCE_ and PX4's GF_ parameters."""

from __future__ import annotations

import math

import pytest

from gcs_formation.vehicle.own_fence import ardupilot_fence, px4_fence

ON = {"FENCE_ENABLE": 1, "FENCE_ACTION": 1, "FENCE_ALT_MAX": 120, "FENCE_ALT_MIN": 20, "FENCE_RADIUS": 800}


@pytest.mark.parametrize(
    ("kinds", "bounds"),
    [
        (1, (-math.inf, 120, math.inf)),
        (2, (-math.inf, math.inf, 800)),
        (8, (20, math.inf, math.inf)),
        (15, (20, 120, 800)),
        (4, (-math.inf, math.inf, math.inf)),  # polygons
    ],
)
def test_an_ardupilot_s_fence_has_the_kinds_that_are_on(kinds: int, bounds: tuple[float, float, float]) -> None:
    fence = ardupilot_fence(ON | {"FENCE_TYPE": kinds})
    assert fence is not None
    assert fence[:3] == bounds


@pytest.mark.parametrize("off", [{"FENCE_ENABLE": 0}, {"FENCE_ACTION": 0}])
def test_one_that_is_off_or_only_reports_bounds_nothing(off: dict[str, float]) -> None:
    assert ardupilot_fence(ON | {"FENCE_TYPE": 15} | off) is None


def test_a_px4_s_distances_of_0_bound_nothing() -> None:
    fence = px4_fence({"GF_ACTION": 2, "GF_MAX_VER_DIST": 0, "GF_MAX_HOR_DIST": 500})
    assert fence is not None
    assert fence[:3] == (-math.inf, math.inf, 500)
    assert px4_fence({"GF_ACTION": 1, "GF_MAX_VER_DIST": 50, "GF_MAX_HOR_DIST": 500}) is None

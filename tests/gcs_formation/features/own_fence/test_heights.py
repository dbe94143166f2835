"""Commanded heights stay within the geofence that a vehicle has itself: beyond it, it would go home."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant
from flight_model.slot import Vector3
from gcs_formation.control.setpoint import AS_DECIDED
from gcs_formation.features.own_fence.feature import FEATURE
from gcs_formation.recorder import Tick, VehicleLink

NOW = Instant(0)
FENCE_M = (30.0, 120.0)


def bounded(height_m: float, fence_m: tuple[float, float] | None = FENCE_M, *, active: bool = True) -> Tick:
    """Return the tick after a command of 22 m/s, 0.4 rad and a height to the second of two vehicles."""
    tick = Tick(NOW, 0.0, "flying", 0, [VehicleLink(NOW)] * 2, [0.0] * 2, [0.0] * 2, [True, active])
    tick.setpoints = [(21.0, 0.3, 200.0), (22.0, 0.4, height_m)]
    each = [SimpleNamespace(index=n, autopilot=SimpleNamespace(heights_m=own)) for n, own in enumerate((None, fence_m))]
    cycle: Any = SimpleNamespace(each=each, tick=tick)
    (stage,) = FEATURE.stages(cycle)
    stage.run(cycle)
    return tick


@pytest.mark.parametrize(("height_m", "flown_m"), [(150.0, 120.0), (10.0, 30.0)])
def test_a_height_beyond_it_is_replaced_by_its_bound_and_nothing_else_is(height_m: float, flown_m: float) -> None:
    tick = bounded(height_m)
    assert tick.setpoints == [(21.0, 0.3, 200.0), (22.0, 0.4, flown_m)]
    assert tick.replaced == [AS_DECIDED, (False, False, True)]


@pytest.mark.parametrize("height_m", [30.0, 75.0, 120.0])
def test_heights_within_it_stay(height_m: float) -> None:
    tick = bounded(height_m)
    assert tick.setpoints[1] == (22.0, 0.4, height_m)
    assert tick.replaced[1] == AS_DECIDED


def test_so_do_those_of_one_without_a_fence_and_of_one_that_isnt_commanded() -> None:
    left: list[Vector3] = [bounded(150.0, None).setpoints[1], bounded(150.0, active=False).setpoints[1]]
    assert left == [(22.0, 0.4, 150.0)] * 2

"""In which formations a vehicle whose height isn't known endangers another: slots above one another."""

from __future__ import annotations

import math

import pytest

from flight_model.slot import UNKNOWN, Vector3
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.telemetry_health.monitor import TelemetryHealth
from tests.gcs_formation.features.telemetry_health.test_what_is_flown_and_said import Station

SAFE_M = 12.0


@pytest.mark.parametrize(
    ("slots_m", "stacked"),
    [
        ([UNKNOWN, (-30.0, 20.0, 0.0), (-30.0, -20.0, 0.0)], False),
        ([UNKNOWN, (-30.0, 20.0, 0.0), (-30.0, 28.0, 40.0)], True),
        ([UNKNOWN, (-30.0, 20.0, 0.0), (-5.0, 5.0, 40.0)], True),
        ([UNKNOWN, (-9.0, 9.0, 0.0)], False),
        ([(-30.0, 20.0, 0.0), (-5.0, 5.0, 40.0)], False),
    ],
)
def test_slots_are_stacked_that_are_too_near_over_the_ground_to_another_or_the_leader(
    slots_m: list[Vector3], stacked: bool
) -> None:
    """The leader's own slot is NaN; in the last list it isn't among them."""
    watches = TelemetryHealth({}, [], [], SetpointHistory(10.0), lambda *_: None, SAFE_M)
    watches.slots_m = slots_m
    assert math.hypot(5.0, 5.0) < SAFE_M < math.hypot(9.0, 9.0)
    assert watches._stacked() == stacked


@pytest.mark.parametrize(("way_m", "stacked"), [(11.9, True), (12.1, False)])
@pytest.mark.parametrize("way", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_one_whose_height_is_frozen_is_unfit_within_12_m_of_the_leader_whichever_way(
    way: tuple[float, float], way_m: float, stacked: bool
) -> None:
    """It says that it climbs at 1 m/s: found after a metre, and again once the long sum, 10 (1 - 0.99^n), is at 4 m."""
    station = Station()
    station.monitor.slots_m = [UNKNOWN, (way_m * way[0], way_m * way[1], 40.0)]
    for number in range(120):
        station.examine(off_m=(0.0, 0.0, -0.1 * max(0, number - 40)))
    assert station.flight.vehicle.unfit == ("its height doesn't move by its velocity" if stacked else "")

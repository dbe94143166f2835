"""Positions that are older on arrival than the link explains."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.messages.telemetry import Attitude, GlobalPositionInt
from flight_model.earth import GeodeticOrigin
from flight_model.slot import UNKNOWN
from formation_scenario import load_scenario
from gcs_formation.estimation.sample import Sample
from gcs_formation.features.telemetry_health.vehicle_health import Commanded, VehicleHealth
from gcs_formation.vehicle.telemetry import Telemetry

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
PATH = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [2000, 0, 100]]}
MODEL = load_scenario({"vehicles": {"count": 1}, "path": PATH}).vehicles[0].model.autopilot()
NOISE: Any = SimpleNamespace(noise=SimpleNamespace(by_quantity=(0.0,) * 6), state=None)


@pytest.mark.parametrize(("attitudes_late_s", "unfit"), [(0.0, "its positions come 2.5 s late"), (2.0, ""), (2.5, "")])
def test_positions_are_late_where_attitudes_come_on_time(attitudes_late_s: float, unfit: str) -> None:
    """All that a slow simulator says is as old, by a clock that was measured before it slowed down."""
    seen = Telemetry(ORIGIN)
    links = {"clock": SimpleNamespace(one_way_s=0.0), "jitter": SimpleNamespace(jitter_s=0.0)}
    vehicle: Any = SimpleNamespace(telemetry=seen, sampler=SimpleNamespace(airspeed_check=None), **links)
    health = VehicleHealth(vehicle, MODEL)
    for tick in range(60):
        now_s = 5.0 + tick / 10
        stamp_s = now_s - 2.5
        seen.store(Attitude(now_s - attitudes_late_s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        lat_rad, lon_rad, alt_m = ORIGIN.from_ned(22.0 * stamp_s, 0.0, -100.0)
        seen.store(GlobalPositionInt(stamp_s, lat_rad, lon_rad, alt_m, 100.0, 22.0, 0.0, 0.0, 0.0))
        assert seen.motion is not None
        motion, now = seen.motion, after(Instant(0), now_s)
        place_m = motion.north_m, motion.east_m, motion.height_m
        sample = Sample(after(now, -2.5), *place_m, 22.0, 0.0, 0.0, 22.0, 0.0)
        health.examine(sample, NOISE, Commanded(math.nan, UNKNOWN, stops=False), now, leads=False)
    assert health.unfit == unfit

"""Positions and heights that jump: flown as before, by the telemetry that takes the jump out and what comes next."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.messages.telemetry import Attitude, GlobalPositionInt
from flight_model.slot import UNKNOWN
from gcs_formation.estimation.sample import Sample
from gcs_formation.features.telemetry_health.vehicle_health import Commanded, VehicleHealth
from gcs_formation.vehicle.telemetry import Telemetry
from tests.gcs_formation.features.telemetry_health.test_late_positions import MODEL, NOISE, ORIGIN

SPEED_MPS, HEIGHT_M = 22.0, 100.0


class Flying:
    """A fixed wing that flies north at one height, and what is flown by."""

    def __init__(self) -> None:
        self.seen, self.now_s, self.stamp_s = Telemetry(ORIGIN), 5.0, 5.0
        links = {"clock": SimpleNamespace(one_way_s=0.0), "jitter": SimpleNamespace(jitter_s=0.0)}
        vehicle: Any = SimpleNamespace(telemetry=self.seen, sampler=SimpleNamespace(airspeed_check=None), **links)
        self.health = VehicleHealth(vehicle, MODEL)

    def off_m(self, seconds: float, jump_m: tuple[float, float, float] = (0.0, 0.0, 0.0), rate: float = 1.0) -> float:
        """Tell positions off the true ones by `jump_m`, north, east and up; return how far off it is flown at most.

        `rate`: at which its stamps run.
        """
        off_m = 0.0
        for _ in range(round(10.0 * seconds)):
            self.now_s += 0.1
            self.stamp_s += 0.1 * rate
            now, truth = after(Instant(0), self.now_s), (SPEED_MPS * self.now_s, 0.0, HEIGHT_M)
            north_m, east_m, up_m = (true + jump for true, jump in zip(truth, jump_m, strict=True))
            self.seen.store(Attitude(self.stamp_s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
            lat_rad, lon_rad, alt_m = ORIGIN.from_ned(north_m, east_m, -up_m)
            reported = GlobalPositionInt(self.stamp_s, lat_rad, lon_rad, alt_m, up_m, SPEED_MPS, 0.0, 0.0, 0.0)
            self.seen.store(reported)
            assert self.seen.motion is not None
            place_m = self.seen.motion.north_m, self.seen.motion.east_m, self.seen.motion.height_m
            sample = Sample(after(Instant(0), self.stamp_s), *place_m, SPEED_MPS, 0.0, 0.0, SPEED_MPS, 0.0)
            flown = self.health.examine(sample, NOISE, Commanded(HEIGHT_M, UNKNOWN, stops=False), now, leads=False)
            off_m = max(off_m, math.dist(truth, (flown.north_m, flown.east_m, flown.height_m)))
        return off_m


@pytest.mark.parametrize("jump_m", [(20.0, 0.0, 0.0), (0.0, -25.0, 0.0), (0.0, 0.0, 14.0), (0.0, 0.0, -14.0)])
def test_what_has_jumped_is_flown_as_before_until_it_jumps_back(jump_m: tuple[float, float, float]) -> None:
    flying = Flying()
    assert flying.off_m(5.0) < 0.1
    assert flying.off_m(20.0, jump_m) < 1.0
    assert flying.seen.displaced_m == pytest.approx([-each for each in jump_m], abs=1.0)
    (quantity,) = {quantity for quantity, _, _ in flying.health.changes(after(Instant(0), flying.now_s))}
    assert quantity == ("height" if jump_m[2] else "position")
    assert not flying.health.unfit
    assert flying.off_m(20.0) < 1.0
    assert flying.seen.displaced_m == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("rate", [1.3, 0.7])
def test_what_seems_to_move_wrongly_by_stamps_of_another_rate_is_no_fault_of_positions(rate: float) -> None:
    flying = Flying()
    flying.off_m(8.0)
    flying.off_m(20.0, rate=rate)
    found = {quantity for quantity, _, _ in flying.health.changes(after(Instant(0), flying.now_s))}
    assert found == {"stamps"}
    assert flying.seen.displaced_m == (0.0, 0.0, 0.0)

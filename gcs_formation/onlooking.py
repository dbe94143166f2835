"""What is recorded while nobody is commanded: where everyone is by their own telemetry."""

from __future__ import annotations

import math
from collections.abc import Mapping

from airlink.clock import Instant, seconds_between
from airlink.identity import VehicleId
from gcs_formation.recorder import Tick
from gcs_formation.vehicle.vehicle import Vehicle


def look_on(tick: Tick, vehicles: Mapping[VehicleId, Vehicle], columns: Mapping[VehicleId, int], now: Instant) -> Tick:
    """Fill in a blank tick and return it: the newest positions as told, and their ages."""
    tick.active[:] = False
    for identity, column in columns.items():
        vehicle, seen = vehicles[identity], vehicles[identity].telemetry
        if seen.motion is None:
            continue
        motion, heading_rad = seen.motion, seen.attitude.yaw_rad if seen.attitude else math.nan
        place = motion.north_m, motion.east_m, motion.height_m, motion.climb_mps
        tick.state.table[:, column] = (*place, seen.airspeed_mps, heading_rad, math.nan, math.nan)
        if vehicle.clock.samples:
            tick.age_s[column] = seconds_between(vehicle.clock.to_instant(motion.stamp_s), now)
    return tick

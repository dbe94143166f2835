"""Rules for the place on the Earth and the air around it, for scenarios whose every key holds by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator

from airlink.geodesy import SEMI_MAJOR_M
from formation_scenario.errors import Problem
from formation_scenario.model import Scenario
from formation_scenario.source import Source

MAX_DISTANCE_M = 1e6
MAX_LATITUDE_DEG = 89.0
"""Metres a degree of longitude are no more than a few beyond."""
MAX_HEIGHT_M = 30_000.0


def places(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield the first waypoint that lies where north, east and height don't describe a place near the Earth."""
    origin = scenario.origin
    for index, (north_m, east_m, height_m) in enumerate(scenario.path.waypoints_m):
        distance_m = math.hypot(north_m, east_m)
        latitude_deg = origin.lat_deg + math.degrees(north_m / SEMI_MAJOR_M)
        found = allowed = ""
        if distance_m > MAX_DISTANCE_M:
            found, allowed = f"a waypoint {distance_m:.3g} m from the origin", f"up to {MAX_DISTANCE_M:g} m"
        elif abs(latitude_deg) > MAX_LATITUDE_DEG:
            found, allowed = f"a waypoint at latitude {latitude_deg:.1f}°", f"up to {MAX_LATITUDE_DEG:g}°"
        elif abs(height_m + origin.alt_m) > MAX_HEIGHT_M:
            found, allowed = f"a waypoint {height_m:.3g} m high", f"up to {MAX_HEIGHT_M:g} m above sea level"
        if found:
            yield source.problem(("path", "waypoints_m", index), f"found {found}", allowed)
            return


def wind(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield a wind against which somebody makes no way at all."""
    speed_mps = math.hypot(*scenario.wind.velocity_mps[:2])
    slowest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.speed_max_mps)
    if speed_mps >= slowest.model.speed_max_mps:
        allowed = f"less than {slowest.model.speed_max_mps:g} m/s, vehicle {slowest.vehicle_id}'s speed_max_mps"
        yield source.problem(("wind", "velocity_mps"), f"found a wind of {speed_mps:.3g} m/s", allowed)

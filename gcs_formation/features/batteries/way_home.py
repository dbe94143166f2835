"""How long the way home takes in the wind."""

from __future__ import annotations

import math
from typing import Final

from flight_model.flight_state import FlightState

LANDING_S: Final = 60.0
"""Time over home until it is down, s."""
MIN_MPS: Final = 1.0
"""Speed over ground towards home below which it isn't reached."""


def way_home_s(state: FlightState, home_m: tuple[float, float], airspeed_mps: float, *, hovers: bool = False) -> float:
    """Return how long a vehicle takes to fly home and land, s; infinite if it can't get there against the wind.

    Args:
        state: where it is, and the wind.
        home_m: its home, north and east of the origin, m.
        airspeed_mps: at which it flies there; of a vehicle that hovers the speed over ground.
        hovers: whether it is a multirotor.
    """
    north_m, east_m = home_m[0] - state.north_m, home_m[1] - state.east_m
    away_m = math.hypot(north_m, east_m)
    speed_mps = airspeed_mps
    if away_m > 0.0 and not hovers:
        along_mps = (state.wind_north_mps * north_m + state.wind_east_mps * east_m) / away_m
        across_mps = (state.wind_east_mps * north_m - state.wind_north_mps * east_m) / away_m
        if abs(across_mps) > airspeed_mps:
            return math.inf  # it is carried past its home, whatever its heading
        speed_mps = math.sqrt(airspeed_mps**2 - across_mps**2) + along_mps
    return away_m / speed_mps + LANDING_S if speed_mps >= MIN_MPS else math.inf

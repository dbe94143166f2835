# Compiled by mypyc: it runs every tick.

"""The velocity over ground that a multirotor should have by what it was commanded: a witness that no message alters."""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import AutopilotModel, respond_hovering
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3

UNKNOWN: Final = math.nan
GAP_S: Final = 1.0
"""After a longer interval it begins again at the velocity reported."""


class CommandedVelocity:
    """Follows the commands of one multirotor by its model."""

    def __init__(self, model: AutopilotModel) -> None:
        """Start without a velocity."""
        self._model, self._stamp_ns = model, 0
        self._state = FlightState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def take(self, stamp_ns: int, commanded: Vector3, velocity_mps: tuple[float, float], *, stops: bool) -> list[float]:
        """Return the velocity north and east at a stamp, m/s; NaN while nothing is commanded.

        Args:
            stamp_ns: on the vehicle's clock.
            commanded: speed, heading and height that act then; NaN if there are none.
            velocity_mps: as reported, with which it begins.
            stops: whether it was commanded to stop.
        """
        speed_mps, heading_rad = commanded[0], commanded[1]
        if stops:
            speed_mps, heading_rad = 0.0, 0.0
        if math.isnan(speed_mps) or math.isnan(heading_rad):
            self._stamp_ns = 0
            return [UNKNOWN, UNKNOWN]
        elapsed_s = (stamp_ns - self._stamp_ns) * 1e-9
        if self._stamp_ns == 0 or not 0.0 <= elapsed_s <= GAP_S:
            north_mps, east_mps = velocity_mps
            self._state.airspeed_mps = math.hypot(north_mps, east_mps)
            self._state.heading_rad = math.atan2(east_mps, north_mps)
        elif elapsed_s > 0.0:
            respond_hovering(self._state, self._model, speed_mps, heading_rad, math.nan, elapsed_s)
        self._stamp_ns = stamp_ns
        north_mps, east_mps = self._state.ground_mps()
        return [north_mps, east_mps]

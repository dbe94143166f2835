"""How a vehicle beside the path moves against it: what its way onto the path goes on with when it takes the lead."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from flight_model.autopilot import AutopilotModel, FlightState, within
from flight_model.curve import PathPoint
from flight_model.displacement import Rise
from flight_model.slot import LEADS_FROM_MPS
from gcs_formation.guidance.tracking import LEAST_MPS

MOST_ASIDE_RAD: Final = math.radians(30.0)
"""Up to which angle to the path a way onto it continues a vehicle's own."""


class Abreast(NamedTuple):
    """A place beside a point of the path."""

    point: PathPoint
    right_m: float
    up_m: float

    def rise(self, state: FlightState, commanded_m: float, model: AutopilotModel, speed_mps: float) -> Rise:
        """Return how a vehicle's height, climb, and the climb commanded of it differ from the path's.

        Args:
            state: the vehicle's.
            commanded_m: the height that it follows; NaN where there is none.
            model: the vehicle's.
            speed_mps: along the path.
        """
        climb_mps, lag_s, other_s = state.climb_mps, model.tau_ha_s, model.tau_hb_s
        most_mps2 = model.climb_max_mps / (2.0 * (lag_s + other_s))
        to_climb_m = 0.0 if math.isnan(commanded_m) else commanded_m - state.height_m
        change_mps2 = (to_climb_m - (lag_s + other_s) * climb_mps) / (lag_s * other_s)
        change_mps2 = min(max(change_mps2, -most_mps2), most_mps2)
        # Per metre of the path: on the inside of a bend, the vehicle covers less distance than the path.
        along_mps = max(speed_mps, LEAST_MPS) / (1.0 - self.point.curvature_1pm * self.right_m)
        slope = climb_mps / along_mps - self.point.slope
        return Rise(self.up_m, slope, change_mps2 / along_mps**2 - self.point.slope_rate_1pm)

    def slope_aside(self, state: FlightState) -> float:
        """Return how far a vehicle gets to the right for each metre of the path; 0 of one that creeps."""
        north_mps, east_mps = state.ground_mps()
        if math.hypot(north_mps, east_mps) < LEADS_FROM_MPS:
            return 0.0
        off_rad = math.remainder(math.atan2(east_mps, north_mps) - self.point.course_rad, math.tau)
        along = 1.0 - self.point.curvature_1pm * self.right_m
        return along * math.tan(within(off_rad, -MOST_ASIDE_RAD, MOST_ASIDE_RAD))

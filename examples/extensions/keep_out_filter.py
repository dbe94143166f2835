"""A setpoint filter: an obstacle rule of one's own. Who heads for a cylinder is turned to the nearer side of it.

A vehicle turns with a time constant, so that the radius has room in it.
"""

import math

from pydantic import BaseModel, Field

from gcs_formation.extend import Cycle, SetpointFilter, Vehicle, register_filter


@register_filter("keep_out")  # extensions: {keep_out: {north_m: 1500, east_m: 20, radius_m: 60}}
class KeepOut(SetpointFilter):
    """Turns headings to the tangent of a circle around an obstacle."""

    class Keys(BaseModel):
        """`extensions.keep_out`."""

        north_m: float
        east_m: float
        radius_m: float = Field(gt=0.0)
        look_ahead_s: float = Field(default=20.0, gt=0.0)

    def apply(self, cycle: Cycle) -> None:
        """Turn those who would come too near."""
        for vehicle in cycle.vehicles:
            heading_rad = self._tangent_rad(vehicle)
            if heading_rad is not None:
                vehicle.replace(heading_rad=heading_rad)
                cycle.event("keep_out", "turned away from the obstacle", vehicle)

    def _tangent_rad(self, vehicle: Vehicle) -> float | None:
        """Return the heading along the nearer tangent; None for a vehicle whose way doesn't lead near."""
        keys, state = self.keys, vehicle.state
        north_m, east_m = keys.north_m - state.north_m, keys.east_m - state.east_m
        away_m = math.hypot(north_m, east_m)
        if away_m > keys.radius_m + keys.look_ahead_s * state.airspeed_mps:
            return None
        bearing_rad = math.atan2(east_m, north_m)
        off_rad = math.remainder(vehicle.setpoint.heading_rad - bearing_rad, math.tau)
        clear_rad = math.asin(min(keys.radius_m / away_m, 1.0))  # inside it: across the bearing, until outside again
        return None if abs(off_rad) >= clear_rad else bearing_rad + math.copysign(clear_rad, off_rad)

"""A disturbance: a column of rising air at a place."""

import math

from pydantic import BaseModel, Field

from gcs_formation.extend import AirDisturbance, AirPoint, register_disturbance


@register_disturbance("thermal")  # disturbances: [{kind: thermal, at_s: 0, parameters: {north_m: 800}}]
class Thermal(AirDisturbance):
    """Air that rises fastest in the middle of a column."""

    class Keys(BaseModel):
        """`parameters` beside `kind`."""

        north_m: float
        east_m: float = 0.0
        radius_m: float = Field(default=120.0, gt=0.0)
        up_mps: float = 2.0

    def velocity_mps(self, at: AirPoint) -> tuple[float, float, float]:
        """Return the air's velocity north, east and down."""
        away = math.hypot(at.north_m - self.keys.north_m, at.east_m - self.keys.east_m) / self.keys.radius_m
        return 0.0, 0.0, -self.keys.up_mps * math.exp(-(away**2))

"""A disturbance: gusts as ArduPilot's simulator has them with SIM_WIND_TURB.

Its vertical gusts keep 0.98 of themselves from one of 1200 steps a second to the next: a time constant of 0.042 s, and
as standard deviation the parameter's value. Its horizontal ones take another direction at each step, and hardly move an
aircraft. Source: libraries/SITL/SIM_Aircraft.cpp, Aircraft::update_wind.
"""

import math

from pydantic import BaseModel, Field

from gcs_formation.extend import AirDisturbance, AirPoint, register_disturbance


@register_disturbance("rough_air")  # disturbances: [{kind: rough_air, at_s: 0, vehicles: all}]
class RoughAir(AirDisturbance):
    """First-order Gauss-Markov vertical velocity, each vehicle's own."""

    class Keys(BaseModel):
        """`parameters` beside `kind`."""

        sigma_mps: float = Field(default=1.0, ge=0.0)
        correlation_s: float = Field(default=0.042, gt=0.0)

    share = math.nan

    def velocity_mps(self, at: AirPoint) -> tuple[float, float, float]:  # noqa: ARG002 - it is the same everywhere
        """Return the air's velocity north, east and down."""
        drawn = float(self.random.standard_normal())
        kept = math.exp(-self.dt_s / self.keys.correlation_s)
        self.share = drawn if math.isnan(self.share) else kept * self.share + math.sqrt(1.0 - kept**2) * drawn
        return 0.0, 0.0, self.keys.sigma_mps * self.share

"""A guidance of the leader: pure pursuit of a point ahead on its route, by a lateral acceleration of 2 V² sin(eta) / L.

S. Park, J. Deyst and J. How, "A New Nonlinear Guidance Logic for Trajectory Tracking", AIAA 2004-4900.
"""

import math

from pydantic import BaseModel, Field

from gcs_formation.extend import GuidedLeader, LeaderGuidance, register_guidance


@register_guidance("pursuit")  # path: {guidance: {type: pursuit, parameters: {period_s: 12}}}
class Pursuit(LeaderGuidance):
    """Turns towards the point that is one distance L ahead; speed and height are the usual ones."""

    class Keys(BaseModel):
        """`path.guidance.parameters`."""

        period_s: float = Field(default=12.0, gt=2.0, le=60.0)

    def steer(self, leader: GuidedLeader) -> tuple[float, float, float]:
        """Return speed m/s, heading rad and height m."""
        state, speed_mps = leader.state, max(leader.speed_mps, 1.0)
        north_mps = state.airspeed_mps * math.cos(state.heading_rad) + state.wind_north_mps
        east_mps = state.airspeed_mps * math.sin(state.heading_rad) + state.wind_east_mps
        ahead = leader.route(leader.distance_m + 0.17 * self.keys.period_s * speed_mps)
        north_m, east_m = ahead.north_m - state.north_m, ahead.east_m - state.east_m
        eta_rad = math.atan2(east_m, north_m) - math.atan2(east_mps, north_mps)
        eta_rad = max(-math.pi / 2, min(math.pi / 2, math.remainder(eta_rad, math.tau)))
        turn_rps = 2.0 * math.hypot(north_mps, east_mps) * math.sin(eta_rad) / math.hypot(north_m, east_m)
        turn_rps = max(-leader.turn_rate_max_rps, min(leader.turn_rate_max_rps, turn_rps))
        # By (7) a heading that is tau_psi times the turn rate ahead is turned at that rate.
        return leader.usual.speed_mps, state.heading_rad + leader.tau_psi_s * turn_rps, leader.usual.height_m

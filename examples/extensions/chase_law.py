"""A law over all followers at once: each flies to its slot, more gently the farther behind the slowest of them is."""

from collections.abc import Mapping, Sequence

from pydantic import BaseModel, Field

from gcs_formation.extend import FollowerSlot, FormationLaw, register_formation_law


@register_formation_law("chase")  # law.type: chase
class Chase(FormationLaw):
    """Speed by the error along, heading by the error across, height by the error in height."""

    class Keys(BaseModel):
        """`law.parameters`."""

        along_radps: float = Field(default=0.3, gt=0.0, le=1.0)
        across_rad_per_m: float = Field(default=0.02, gt=0.0, le=0.1)
        intercept_max_rad: float = Field(default=0.8, gt=0.0, le=1.0)

    def setpoints(self, followers: Sequence[FollowerSlot], dt_s: float) -> Mapping[int | str, Sequence[float]]:
        """Return speed m/s, heading rad and height m by follower."""
        del dt_s
        behind_m = max((each.error_m[0] for each in followers), default=0.0)
        share = 1.0 / (1.0 + max(behind_m, 0.0) / 100.0)
        found = dict[int | str, Sequence[float]]()
        for each in followers:
            along_m, across_m, below_m = each.error_m
            intercept_rad = max(
                -self.keys.intercept_max_rad, min(self.keys.intercept_max_rad, self.keys.across_rad_per_m * across_m)
            )
            speed_mps = each.leader.airspeed_mps + share * self.keys.along_radps * along_m
            found[each.id] = speed_mps, each.leader.heading_rad + intercept_rad, each.state.height_m + below_m
        return found

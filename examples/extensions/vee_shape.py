"""A shape: two arms that open by an angle, stepped up or down."""

import math
from collections.abc import Iterator

from pydantic import BaseModel, Field

from gcs_formation.extend import Shape, register_shape


@register_shape("vee")  # formation.shape: vee
class Vee(Shape):
    """Followers left and right in turn; from the leader to the first, and on along each arm, it is the spacing."""

    class Keys(BaseModel):
        """`formation.parameters`."""

        half_deg: float = Field(default=35.0, ge=30.0, le=80.0)
        step_up_m: float = 0.0

    def slots(self, followers: int, spacing_m: float) -> Iterator[tuple[float, float, float]]:
        """Yield forward, right and up of the leader, m."""
        back_m = spacing_m * math.cos(math.radians(self.keys.half_deg))
        out_m = spacing_m * math.sin(math.radians(self.keys.half_deg))
        for place in range(followers):
            along, side = place // 2 + 1, 1 if place % 2 else -1
            yield -along * back_m, side * along * out_m, along * self.keys.step_up_m

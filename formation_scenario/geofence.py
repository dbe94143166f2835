"""What the core asks of keys, which a feature brings, that say where vehicles must stay: paths are planned inside."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from flight_model.fence_geometry import FenceAreas

OUTER: Final = "safety.fence.corners_m"
"""The key of the area that is the fence itself; messages call others by what they are."""
NO_LIMITS: Final = (-math.inf, math.inf)
"""The lowest and the highest height where none is limited, m."""


class Geofence:
    """Keys of a volume in which vehicles must stay: areas to stay in or out of, and heights."""

    @property
    def sides(self) -> FenceAreas | None:
        """Its polygons and circles; None without any."""
        raise NotImplementedError

    @property
    def heights_m(self) -> tuple[float, float]:
        """The lowest and the highest height; infinite without a limit."""
        raise NotImplementedError

    @property
    def rally_positions_m(self) -> tuple[tuple[float, float, float], ...]:
        """Rally points: north, east and height above the origin, m."""
        raise NotImplementedError

    def outside_m(self, north_m: float, east_m: float, height_m: float) -> float:
        """Return how far outside a position is, m; 0 inside."""
        (lowest_m, highest_m), lateral_m = self.heights_m, 0.0
        if self.sides is not None:
            lateral_m = max(0.0, -float(self.sides.inside_m(np.array((north_m, east_m)))))
        return math.hypot(lateral_m, max(0.0, height_m - highest_m, lowest_m - height_m))

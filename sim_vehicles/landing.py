"""AUTOLAND: descend on a circle at the start of the final approach, then fly straight home in the take-off direction.

Source: ArduPilot documentation, "AUTOLAND Mode". Unlike a real one, circles are always clockwise, and there
is no flare.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_vehicles.motion import Motion

LINED_UP_RAD = math.radians(10.0)
AT_HEIGHT_M = 3.0
LOOK_AHEAD_M = 60.0
"""Look-ahead distance along the approach line, from abreast of the vehicle."""
BELOW_GROUND_M = 3.0
"""How far below the ground the glide slope is continued, because the height lags."""


class Approach(NamedTuple):
    """The final approach to home: the touch-down point, the direction, and the length and height at its start."""

    north_m: float
    east_m: float
    direction_rad: float
    length_m: float
    height_m: float
    lead_m: float
    """Distance by which the height setpoint leads the glide slope, to make up for the height's lag."""

    def circle(self, radius_m: float) -> tuple[float, float]:
        """Return the centre, north and east, m, of the clockwise circle tangent to the approach at its start."""
        cos, sin = math.cos(self.direction_rad), math.sin(self.direction_rad)
        north_m = self.north_m - self.length_m * cos - radius_m * sin
        return north_m, self.east_m - self.length_m * sin + radius_m * cos

    def begins(self, motion: Motion) -> bool:
        """Return whether a vehicle on that circle is low enough and aligned with the approach."""
        course_rad = math.atan2(motion.velocity_east_mps, motion.velocity_north_mps)
        off_rad = math.remainder(course_rad - self.direction_rad, math.tau)
        low = abs(motion.height_m - self.height_m) < AT_HEIGHT_M
        return low and abs(off_rad) < LINED_UP_RAD and abs(self._aside_m(motion)) < LOOK_AHEAD_M

    def guide(self, motion: Motion) -> tuple[float, float]:
        """Return the course back to the approach line, rad, and the height of the glide slope, m."""
        share = (self._to_go_m(motion) - self.lead_m) / self.length_m
        course_rad = self.direction_rad - math.atan(self._aside_m(motion) / LOOK_AHEAD_M)
        return course_rad, max(share * self.height_m, -BELOW_GROUND_M)

    def _to_go_m(self, motion: Motion) -> float:
        north_m, east_m = self.north_m - motion.north_m, self.east_m - motion.east_m
        return north_m * math.cos(self.direction_rad) + east_m * math.sin(self.direction_rad)

    def _aside_m(self, motion: Motion) -> float:
        """Return how far right of the line it is."""
        north_m, east_m = motion.north_m - self.north_m, motion.east_m - self.east_m
        return east_m * math.cos(self.direction_rad) - north_m * math.sin(self.direction_rad)

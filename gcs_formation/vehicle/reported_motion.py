"""Position and velocity as a vehicle reported them."""

from __future__ import annotations

import math

from mypy_extensions import mypyc_attr


@mypyc_attr(acyclic=True)
class ReportedMotion:
    """Position and velocity at one time of the vehicle's clock: NED from the origin, height upwards."""

    def __init__(
        self,
        stamp_s: float,
        north_m: float,
        east_m: float,
        height_m: float,
        north_mps: float,
        east_mps: float,
        climb_mps: float,
        above_home_m: float,
    ) -> None:
        """Take the stamp, position, velocity and height above home."""
        self.stamp_s = stamp_s
        self.north_m = north_m
        self.east_m = east_m
        self.height_m = height_m
        self.north_mps = north_mps
        self.east_mps = east_mps
        self.climb_mps = climb_mps
        self.above_home_m = above_home_m
        self.heading_rad: float = math.nan
        """Of the nose, NaN where it isn't known."""

"""One slot of a formation, and the direction of the axis along which slots are defined, on plain numbers."""

from __future__ import annotations

import math
from typing import Final

CHANNELS: Final = ("speed", "heading", "height")
"""The controlled quantities, each with a loop of its own."""
HEIGHT: Final = 2
"""Index of the height among them."""
Vector3 = tuple[float, float, float]
"""Values for forward, right and up, or for the channels."""
UNKNOWN: Vector3 = (math.nan, math.nan, math.nan)
"""An unknown value, or a setpoint that wasn't sent."""
HOVER_MPS: Final = 0.3
"""Ground speed at which course and heading have equal weight."""
LEADS_FROM_MPS: Final = 2.0
"""Ground speed of a leader from which its course is its slots' axis; below, its heading gains weight."""
NOSE_SHARE: Final = 10.0
"""Increase of the heading's weight per m/s below that speed."""


def all_finite(values: Vector3) -> bool:
    """Return whether none of three values is NaN or infinite."""
    total = values[0] + values[1] + values[2]
    return total - total == 0.0


class Slot:
    """A slot's position and motion from the leader, in its frame: forward, right and up, in m, m/s and m/s²."""

    __slots__ = (
        "forward_m",
        "forward_mps",
        "forward_mps2",
        "right_m",
        "right_mps",
        "right_mps2",
        "up_m",
        "up_mps",
        "up_mps2",
    )

    def __init__(self, position_m: list[float], velocity_mps: list[float], acceleration_mps2: list[float]) -> None:
        """Take forward, right and up of each."""
        self.forward_m, self.right_m, self.up_m = position_m[0], position_m[1], position_m[2]
        self.forward_mps, self.right_mps, self.up_mps = velocity_mps[0], velocity_mps[1], velocity_mps[2]
        self.forward_mps2, self.right_mps2 = acceleration_mps2[0], acceleration_mps2[1]
        self.up_mps2 = acceleration_mps2[2]

    def turned(self, axis_rad: float, turn_rps: float, bend_rps2: float) -> Slot:
        """Return a slot fixed to north and east as seen along axes at `axis_rad`, which turn, at a changing rate."""
        cos, sin = math.cos(axis_rad), math.sin(axis_rad)
        x, y = self.forward_m * cos + self.right_m * sin, self.right_m * cos - self.forward_m * sin
        vx, vy = self.forward_mps * cos + self.right_mps * sin, self.right_mps * cos - self.forward_mps * sin
        ax, ay = self.forward_mps2 * cos + self.right_mps2 * sin, self.right_mps2 * cos - self.forward_mps2 * sin
        swing = turn_rps * turn_rps
        return Slot(
            [x, y, self.up_m],
            [vx + turn_rps * y, vy - turn_rps * x, self.up_mps],
            [
                ax + 2.0 * turn_rps * vy + bend_rps2 * y - swing * x,
                ay - 2.0 * turn_rps * vx - bend_rps2 * x - swing * y,
                self.up_mps2,
            ],
        )

    def raised(self, up_m: float, up_mps: float, up_mps2: float) -> Slot:
        """Return the slot raised by a height, with its rate and its change of rate."""
        return Slot(
            [self.forward_m, self.right_m, self.up_m + up_m],
            [self.forward_mps, self.right_mps, self.up_mps + up_mps],
            [self.forward_mps2, self.right_mps2, self.up_mps2 + up_mps2],
        )


def hovering_course(yaw_rad: float, north_mps: float, east_mps: float, nose_mps: float = HOVER_MPS) -> float:
    """Return a hovering vehicle's direction: its course, with the heading weighted as a ground speed of `nose_mps`."""
    return math.atan2(east_mps + nose_mps * math.sin(yaw_rad), north_mps + nose_mps * math.cos(yaw_rad))


def slot_axis(yaw_rad: float, north_mps: float, east_mps: float) -> float:
    """Return the direction of the axis along which a leader's slots are defined.

    It is the course of a moving leader. For a standing one the heading dominates, so a gust or a stop that moves it
    backwards doesn't reverse the axis.
    """
    slow_mps = max(0.0, LEADS_FROM_MPS - math.hypot(north_mps, east_mps))
    return hovering_course(yaw_rad, north_mps, east_mps, HOVER_MPS + NOSE_SHARE * slow_mps)

"""Directions of a multirotor: it flies any way, whatever its nose points to, and may drift while it stands."""

from __future__ import annotations

import math
from typing import Final

STANDS_MPS: Final = 0.3
"""A ground speed whose course counts as much as the nose's direction."""
LEADS_FROM_MPS: Final = 2.0
"""Ground speed from which a leader's slots go by its course; slower ones more and more by its nose."""
NOSE_SHARE: Final = 10.0
"""By how much more the nose counts for each m/s that a leader is slower than that."""


def course(yaw_rad: float, north_mps: float, east_mps: float, nose_mps: float = STANDS_MPS) -> float:
    """Return the direction that it flies in; a slow one's nose counts too, as much as a ground speed of `nose_mps`."""
    return math.atan2(east_mps + nose_mps * math.sin(yaw_rad), north_mps + nose_mps * math.cos(yaw_rad))


def axis(yaw_rad: float, north_mps: float, east_mps: float) -> float:
    """Return the direction of the axis that a leader's slots are counted from.

    It is the course of one that flies; a gust or a stop that moves one that stands backwards doesn't turn it round.
    """
    slow_mps = max(0.0, LEADS_FROM_MPS - math.hypot(north_mps, east_mps))
    return course(yaw_rad, north_mps, east_mps, STANDS_MPS + NOSE_SHARE * slow_mps)

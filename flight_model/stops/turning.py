"""How long a formation turns in place: its slots swing around the leader, no faster than vehicles can follow."""

from __future__ import annotations

import math
from typing import Final

from flight_model.path_offsets import PEAK_CHANGE, PEAK_RATE

SHARE: Final = 0.5
"""Share of the speed and acceleration limits that slots use in a turn in place; the rest is left to the law."""
NOSE_RADPS: Final = 0.5
"""Fastest turn in place: vehicles yaw at 1 rad/s."""
MIN_S: Final = 2.0
"""Shortest turn, and how long followers are given to end theirs."""


def turn_s(by_rad: float, reach_m: float, speed_mps: float, accel_mps2: float) -> float:
    """Return the duration of a minimum-jerk turn in place.

    Args:
        by_rad: the angle.
        reach_m: distance of the farthest slot from the leader.
        speed_mps: highest speed of the slowest vehicle.
        accel_mps2: largest acceleration of the weakest one.
    """
    size_rad, reach_m = abs(by_rad), max(reach_m, 1.0)
    max_radps = min(NOSE_RADPS, SHARE * speed_mps / reach_m, math.sqrt(SHARE * accel_mps2 / reach_m))
    return max(
        MIN_S, PEAK_RATE * size_rad / max_radps, math.sqrt(PEAK_CHANGE * size_rad * reach_m / SHARE / accel_mps2)
    )

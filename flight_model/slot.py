"""One slot of a formation, on plain numbers."""

from __future__ import annotations

import math

Triple = tuple[float, float, float]
"""Of forward, right and up; or of the channels speed, heading and height."""
NOTHING: Triple = (math.nan, math.nan, math.nan)


class Slot:
    """A slot's place and motion in the leader's frame: forward, right and up, in m, m/s and m/s²."""

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

    def __init__(self, place_m: list[float], velocity_mps: list[float], acceleration_mps2: list[float]) -> None:
        """Take forward, right and up of each."""
        self.forward_m, self.right_m, self.up_m = place_m[0], place_m[1], place_m[2]
        self.forward_mps, self.right_mps, self.up_mps = velocity_mps[0], velocity_mps[1], velocity_mps[2]
        self.forward_mps2, self.right_mps2 = acceleration_mps2[0], acceleration_mps2[1]
        self.up_mps2 = acceleration_mps2[2]

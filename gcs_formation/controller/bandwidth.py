"""The bandwidth of the law's loops, which follows what is wanted so slowly that no setpoint jumps."""

from __future__ import annotations

import math
from typing import Final

from flight_model.slot import CHANNELS

GAINS_CHANGE_S: Final = 1.0
"""Time constant with which the loops' bandwidth follows a change, so that no setpoint jumps."""


class Bandwidth:
    """Shares of the full bandwidth, (C, 3)."""

    def __init__(self, count: int, dt_s: float) -> None:
        """Begin with the full one."""
        self.shares = [[1.0] * len(CHANNELS) for _ in range(count)]
        self._change = 1.0 - math.exp(-dt_s / GAINS_CHANGE_S)

    def follow(self, wanted: list[list[float]]) -> None:
        """Move the shares towards those wanted, with a time constant of `GAINS_CHANGE_S`."""
        for index, shares in enumerate(self.shares):
            goals = wanted[index]
            for channel in range(len(CHANNELS)):
                share = shares[channel]
                if share != goals[channel]:
                    shares[channel] = share + self._change * (goals[channel] - share)

"""How much of its delay margin a loop uses, and how far its bandwidth must be reduced to use less."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gcs_formation.stability.lag_margin import lag_margin
from gcs_formation.stability.loops import Loop, delay_margin
from gcs_formation.stability.prediction import predicted_mismatch_margin

DEVIATIONS = 2.0
"""The mismatch, in standard deviations of the round trip."""
STEP_S = 0.05
"""Mismatch margins are computed for whole multiples of this delay."""
BANDWIDTHS = tuple(np.geomspace(1.0, 0.1, 33).tolist())
"""The shares to which the bandwidth may be reduced."""


LAGS_NOTED = 0.05
"""Lags that are less off, as a share of themselves, count as right."""


class LoopDelay(NamedTuple):
    """Measured delay of a loop closed over the link, s."""

    mean_s: float
    """Round trip, sampling and hold included."""
    scatter_s: float
    """Standard deviation of the round trip."""


class Usage:
    """Share of their least margin that loops with a common bandwidth use.

    Without prediction, it is the loop's whole delay over the delay margin. With prediction, it is the scatter of the
    delay about the value that the prediction bridges, over the mismatch margin of the predicted loop there.
    """

    def __init__(self, loops: Sequence[Loop], *, predicted: bool) -> None:
        """Take the loops at their full bandwidth."""
        self._loops = loops
        self._predicted = predicted
        self._margins_s: dict[tuple[float, int], float] = {}

    def of(self, delay: LoopDelay, bandwidth: float = 1.0) -> float:
        """Return the share of the margin in use at a share of the bandwidth, NaN before the delay is known."""
        if math.isnan(delay.mean_s):
            return math.nan
        if not self._predicted:
            return _share(delay.mean_s, self.margin_s(delay.mean_s, bandwidth))
        mismatch_s = DEVIATIONS * delay.scatter_s
        return _share(mismatch_s, self.margin_s(delay.mean_s, bandwidth)) if mismatch_s > 0.0 else 0.0

    def of_lags(self, delay: LoopDelay, off: float) -> float:
        """Return the share of their margin against wrong lags that loops with prediction use.

        `off` is by what share of itself a lag isn't the model's. Without prediction nothing goes by the model.
        """
        if not self._predicted or off < LAGS_NOTED or math.isnan(delay.mean_s):
            return 0.0
        delay_s = round(delay.mean_s / STEP_S) * STEP_S
        return _share(off, min((lag_margin(loop, delay_s) for loop in self._loops), default=math.inf))

    def bandwidth(self, delay: LoopDelay, most: float) -> float:
        """Return the greatest of `BANDWIDTHS` at which no more than `most` of the margin is used; the least if none.

        Margins grow as the bandwidth falls.
        """
        index = bisect_left(BANDWIDTHS, True, key=lambda bandwidth: self.of(delay, bandwidth) <= most)
        return BANDWIDTHS[min(index, len(BANDWIDTHS) - 1)]

    def margin_s(self, delay_s: float, bandwidth: float = 1.0) -> float:
        """Return the least margin of the loops: of delay, or against mismatch about `delay_s`."""
        step = round(delay_s / STEP_S) if self._predicted else 0
        key = bandwidth, step
        if key not in self._margins_s:
            slowed = [loop.slowed(bandwidth) for loop in self._loops]
            of_each = (
                (predicted_mismatch_margin(loop, step * STEP_S).least() for loop in slowed)
                if self._predicted
                else (delay_margin(loop.open_loop()) for loop in slowed)
            )
            self._margins_s[key] = min(of_each, default=math.inf)
        return self._margins_s[key]


def _share(delay_s: float, margin_s: float) -> float:
    return delay_s / margin_s if margin_s > 0.0 else math.inf

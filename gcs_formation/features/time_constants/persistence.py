# Compiled by mypyc: it runs every tick.

"""For how long residuals stay correlated, so that they count as fewer."""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import squared

BATCH_S: Final = 1.0
"""Interval between fits. Tuned: s; 0.5 to 3; shown by `pytest tests/gcs_formation/features/time_constants`."""
ALIKE_S: Final = 60.0
"""Time constant of the memory of `Persistence`. Tuned: s; 30 to 180; shown by `pytest
tests/gcs_formation/features/time_constants`."""
STILL_ALIKE: Final = math.exp(-BATCH_S / ALIKE_S)
PRIOR_BATCHES: Final = 6.0
"""Prior number of successive batches whose residuals are correlated. Also the largest number that the mismatch uses:
residuals that are correlated for longer may come from wrong time constants. Tuned: batches; 3 to 12; shown by `pytest
tests/gcs_formation/features/time_constants`."""
PRIOR_WORTH: Final = 5.0
"""Weight of that prior, in pairs of batches. Tuned: pairs; 2 to 10; shown by `pytest
tests/gcs_formation/features/time_constants`."""


class Persistence:
    """For how many batches residuals stay correlated: turbulence moves a vehicle for longer than a batch.

    From von Neumann's ratio of successive batches' means: rho = 1 - steps / (2 size), both sums of squares.
    """

    def __init__(self, resolution: float) -> None:
        """Begin with independent residuals of the size of `resolution`."""
        self._before: float = math.nan
        self._count: float = 0.0
        self._mean: float = 0.0
        self._size: float = squared(resolution)
        self._steps: float = 2.0 * self._size

    def add_batch(self, mean: float) -> None:
        """Take the mean of a batch's residuals; NaN where it has none."""
        if not math.isnan(mean - self._before):
            self._count = STILL_ALIKE * self._count + 1.0
            off = mean - self._mean
            self._mean += off / self._count
            self._size = STILL_ALIKE * self._size + off * (mean - self._mean)
            self._steps = STILL_ALIKE * self._steps + squared(mean - self._before)
        self._before = mean

    @property
    def variance(self) -> float:
        """Variance of batches' means: at first that of the resolution, which counts as one batch."""
        return self._size / (self._count + 1.0)

    @property
    def batches(self) -> float:
        """Number of successive batches with the information of one of independent residuals: (1 + rho) / (1 - rho)."""
        seen = max(1.0, 4.0 * self._size / self._steps - 1.0)
        return (PRIOR_WORTH * PRIOR_BATCHES + self._count * seen) / (PRIOR_WORTH + self._count)

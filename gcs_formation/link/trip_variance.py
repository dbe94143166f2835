"""How much one round trip tells of a vehicle's clock: the variance of the offset that its midpoint shows.

Delays up and down that vary independently leave their difference as uncertain as their sum, however long it is. So
normal round trips all weigh alike, by a quarter of their variance; one that is longer than their jitter was held up
on one way, and is off by up to half of it. The wait for the loop that answers is known by the round trip's length as
far as it is what makes it vary.
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import i64

from flight_model.autopilot_model import squared

RESOLUTION_S: Final = 0.5e-3
"""Standard deviation of a sample of a round trip that doesn't vary. Tuned: s; 0.2e-3 to 1e-3; shown by `pytest
tests/gcs_formation/link`."""
FEW: Final = 8
"""Number of round trips from which on their variance is known. Tuned: round trips; 4 to 16; shown by `pytest
tests/gcs_formation/link`."""
MANY: Final = 64
"""Number of round trips over which it is a mean. Tuned: round trips; 32 to 256; shown by `pytest
tests/gcs_formation/link`."""
UNKNOWN_S: Final = 0.1
"""Standard deviation assumed for fewer than `FEW`; large, so that these get little weight. Tuned: s; 0.05 to 0.5; shown
by `pytest tests/gcs_formation/link`."""
OUTLYING: Final = 3.0
"""A round trip is an outlier beyond this multiple of their standard deviation. Tuned: standard deviations; 2.5 to 5;
shown by `pytest tests/gcs_formation/link`."""


class TripVariance:
    """The variance of one link's round trips, with the answering loop's wait."""

    def __init__(self, loop_s: float) -> None:
        """Start without round trips; `loop_s`: period of the loop that answers."""
        self.wait_s2: float = squared(loop_s) / 12.0
        """Variance of the wait, which is uniformly distributed, s²."""
        self.trips_s2: float = 0.0
        """Variance of the round trips, s²; of an outlier's deviation the part that is plausible."""
        self._known: i64 = 0

    @property
    def jitter_s2(self) -> float:
        """Variance of both delays together, s²."""
        return self.trips_s2 - self.wait_s2

    @property
    def mean_s2(self) -> float:
        """Variance of the mean of the samples over which the round trips' variance was taken, s²."""
        return self.trips_s2 / 4.0 / float(max(1, self._known))

    def sample_s2(self, excess_s: float, count: i64, deviation_s: float, robust_s: float) -> float:
        """Take a round trip; return the variance of its sample of the offset, s².

        Args:
            excess_s: what it is longer than the median of the recent ones.
            count: how many these are.
            deviation_s: their standard deviation.
            robust_s: the same by their median deviation.
        """
        if count < FEW:
            return squared(RESOLUTION_S) + squared(UNKNOWN_S) / 4.0
        if not self._known:
            self.trips_s2 = squared(deviation_s)
        outlier_s2 = squared(OUTLYING) * max(self.trips_s2, squared(robust_s))
        if self._known < MANY:
            self._known += 1
        weight = 1.0 / (float(self._known) + float(FEW) - 1.0)
        self.trips_s2 += (min(squared(excess_s), outlier_s2) - self.trips_s2) * weight
        # An upper bound: a variance of few round trips that is too small by chance would fix the clock for minutes.
        bound_s2 = self.trips_s2 * (1.0 + 2.0 / math.sqrt(float(self._known) + float(FEW)))
        link_s2 = 0.0 if bound_s2 <= self.wait_s2 else bound_s2 - squared(self.wait_s2) / bound_s2
        late_s2 = squared(excess_s) if excess_s > 0.0 and squared(excess_s) > outlier_s2 else 0.0
        return squared(RESOLUTION_S) + (link_s2 + late_s2) / 4.0

"""The jitter of a link's telemetry.

Source: RFC 3550, section 6.4.1, "interarrival jitter".
"""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS, Instant

SHARE: Final = 1 / 16
"""Weight of each new difference in the running mean. Tuned: share; 1/64 to 1/8; shown by `pytest
tests/gcs_formation/link`."""


class JitterMeter:
    """Running mean of the absolute change in transit time from sample to sample.

    For independent, normally distributed delays it is 2/sqrt(pi) standard deviations. No common clock is needed; the
    vehicle's clock drift is removed.
    """

    def __init__(self) -> None:
        """Start without a sample."""
        self.jitter_s = math.nan
        """NaN before the second sample."""
        self._sent_s, self._arrived = math.nan, Instant(0)
        """Stamp and arrival of the last sample; NaN before the first."""

    def drop_sample(self) -> None:
        """Start without a sample again: the clock of the stamps is another."""
        self.jitter_s, self._sent_s = math.nan, math.nan

    def observe(self, stamp_s: float, arrived: Instant, drift: float) -> None:
        """Take a sample: its stamp on the vehicle's clock, which gains `drift` seconds a second, and its arrival."""
        if not math.isnan(self._sent_s):
            change_s = abs((arrived - self._arrived) / NANOSECONDS - (stamp_s - self._sent_s) / (1.0 + drift))
            known_s = 0.0 if math.isnan(self.jitter_s) else self.jitter_s
            self.jitter_s = known_s + SHARE * (change_s - known_s)
        self._sent_s, self._arrived = stamp_s, arrived

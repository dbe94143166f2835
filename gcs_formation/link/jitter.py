"""Interarrival jitter of a vehicle's telemetry. Source: RFC 3550, sections 6.4.1 and A.8."""

from __future__ import annotations

import math

from airlink.clock import Instant, seconds_between

SHARE = 1 / 16
"""Weight of each new difference."""


class JitterMeter:
    """Running mean of the absolute change in transit time from sample to sample.

    For independent, normally distributed delays it is 2/sqrt(pi) standard deviations. It needs no common clock; the
    vehicle's clock drift is removed.
    """

    def __init__(self) -> None:
        """Start without a sample."""
        self.jitter_s = math.nan
        """NaN before the second sample."""
        self._last: tuple[float, Instant] | None = None

    def observe(self, stamp_s: float, arrived: Instant, drift: float) -> None:
        """Take a sample: its stamp on the vehicle's clock, which gains `drift` s a second on ours, and its arrival."""
        if self._last is not None:
            sent_s, before = self._last
            change_s = abs(seconds_between(before, arrived) - (stamp_s - sent_s) / (1.0 + drift))
            known_s = 0.0 if math.isnan(self.jitter_s) else self.jitter_s
            self.jitter_s = known_s + SHARE * (change_s - known_s)
        self._last = stamp_s, arrived

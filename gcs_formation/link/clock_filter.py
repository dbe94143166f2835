"""A Kalman filter of a clock's offset and drift.

Source: Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.2 and 6.2.
"""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS, Instant, nanoseconds
from flight_model.autopilot_model import squared

OFFSET_NOISE: Final = 1e-4
"""Random walk of any clock's offset. Tuned: s/√s; 1e-5 to 1e-3; shown by `python -m benchmarks.clock_limits`."""
DRIFT_NOISE: Final = 2e-6
"""Random walk of any clock's drift. Tuned: 1/√s; 1e-7 to 1e-5; shown by `python -m benchmarks.clock_limits`."""
CRYSTAL_OFFSET_NOISE: Final = 1e-6
"""Random walk of a crystal's offset. Tuned: s/√s; 1e-7 to 1e-5; shown by `python -m benchmarks.clock_limits`."""
CRYSTAL_DRIFT_NOISE: Final = 2e-8
"""Random walk of a crystal's drift: it changes by 0.2 ppm in 100 s, with its temperature. Tuned: 1/√s; 5e-9 to 1e-7;
shown by `python -m benchmarks.clock_limits`."""


class ClockFilter:
    """A Kalman filter of a clock's offset and drift."""

    def __init__(
        self, prior_drift: float, offset_noise: float = OFFSET_NOISE, drift_noise: float = DRIFT_NOISE
    ) -> None:
        """Start with the standard deviation of the clock's drift.

        `offset_noise` (s) and `drift_noise` are the random walks of offset and drift, per square root of a second.
        """
        self.offset_s: float = math.nan
        """The vehicle's clock minus ours, at `reference`."""
        self.drift: float = 0.0
        """Rate of change of the offset."""
        self._prior_drift, self._offset_noise, self._drift_noise = prior_drift, offset_noise, drift_noise
        self.reference = Instant(0)
        """The instant that `offset_s` refers to."""
        self._p00: float = 1.0
        self._p01: float = 0.0
        self._p11: float = squared(prior_drift)
        """Covariance of offset and drift."""

    def predict(self, at: Instant) -> float:
        """Return the offset at an instant, s."""
        return self.offset_s + self.drift * (at - self.reference) / NANOSECONDS

    def initialise(self, at: Instant, sample_s: float, variance: float) -> None:
        """Restart with a clock's first sample, whose variance is in s²."""
        self.drift, self._p11 = 0.0, squared(self._prior_drift)
        self.step(at, sample_s, variance)

    def step(self, at: Instant, sample_s: float, variance: float) -> None:
        """Set the offset to that of a clock that has stepped; its drift is kept."""
        self.offset_s, self.reference = sample_s, at
        self._p00, self._p01 = variance, 0.0

    def begin_line(self, at: Instant, offset_s: float, drift: float, deviation_s: float, span_s: float) -> None:
        """Restart with a line fitted over `span_s`; `deviation_s`: standard deviation of its end, s."""
        self.offset_s, self.drift, self.reference = offset_s, drift, at
        self._p00 = squared(deviation_s)
        self._p01, self._p11 = self._p00 / span_s, 2.0 * self._p00 / squared(span_s)

    def correct(self, at: Instant, sample_s: float, variance: float) -> float:
        """Take a sample of the offset, s; return its log-likelihood up to a constant.

        A sample older than the newest one is compared with the offset predicted for its own time.
        """
        self.advance(at)
        total = self._p00 + variance
        innovation_s = sample_s - self.predict(at)
        gain0, gain1 = self._p00 / total, self._p01 / total
        self.offset_s += gain0 * innovation_s
        self.drift += gain1 * innovation_s
        self._p11 -= gain1 * self._p01
        self._p00 *= 1.0 - gain0
        self._p01 *= 1.0 - gain0
        return (0.0 - math.log(total) - squared(innovation_s) / total) / 2.0

    def to_instant(self, clock_s: float) -> Instant:
        """Return the instant on our clock at which the vehicle's clock showed a time, s."""
        at_reference_s = self.reference / NANOSECONDS + self.offset_s
        return Instant(self.reference + nanoseconds((clock_s - at_reference_s) / (1 + self.drift)))

    def age_s(self, clock_s: float, now: Instant) -> float:
        """Return how long before `now` the vehicle's clock showed a time, s."""
        since_s = (now - self.reference) / NANOSECONDS
        return since_s - (clock_s - self.reference / NANOSECONDS - self.offset_s) / (1 + self.drift)

    @property
    def offset_variance(self) -> float:
        """Variance of the offset, s²."""
        return self._p00

    @property
    def drift_deviation(self) -> float:
        """Standard deviation of the drift."""
        return math.sqrt(max(0.0, self._p11))

    def advance(self, to: Instant) -> None:
        """Propagate the filter to an instant; earlier instants are ignored."""
        if to <= self.reference:
            return
        elapsed_s = (to - self.reference) / NANOSECONDS
        self.offset_s += self.drift * elapsed_s
        self.reference = to
        grown = elapsed_s * (2.0 * self._p01 + elapsed_s * self._p11)
        self._p00 = self._p00 + grown + squared(self._offset_noise) * elapsed_s
        self._p01 += elapsed_s * self._p11
        self._p11 += squared(self._drift_noise) * elapsed_s

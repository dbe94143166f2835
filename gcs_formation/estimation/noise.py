"""How noisy each vehicle's telemetry is, estimated in flight.

White noise of variance r in a sample makes the increments that the model doesn't explain alternate: successive ones
have a covariance of -r. Gusts and lags that differ from the model's give increments that are uncorrelated or follow
each other in sign, so they aren't taken for noise (autocovariance method: Bélanger, Automatica 10, 1974).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gcs_formation.arrays import Array, Indices, Mask, within

QUANTITIES = ("position", "height", "velocity", "climb", "airspeed", "heading")
"""What has a noise of its own. North and east count as one quantity."""
ROWS = np.array((0, 0, 1, 2, 2, 3, 4, 5))
"""The quantity of each row of a sample."""
FIRST_ROWS = np.array((0, 2, 3, 5, 6, 7))
"""The first row of each quantity."""
RESOLUTION = np.array((0.003, 0.001, 0.003, 0.003, 0.0001, 0.00002))
"""Least standard deviations, m, m/s and rad: rounding by 1e-7 degrees, 1 mm and 1 cm/s; the last two are floats."""
UNDECLARED = np.array((0.3, 0.3, 0.1, 0.1, 0.3, 0.01))
"""Where nothing is declared: the noise that a real autopilot's estimates begin with here."""
MOST = np.array((30.0, 30.0, 5.0, 5.0, 10.0, 0.5))
"""Largest standard deviations; what is noisier isn't telemetry of a flight in formation."""
MEMORY = 100.0
"""Samples over which the mean is taken."""
FIRST_MEMORY = 20.0
"""The same at the start, of a vehicle's first sample."""
CLIPPED_AT = 2.0
"""Standard deviations at which an increment counts no more than that: an outlier isn't noise."""


class Declared(NamedTuple):
    """What the vehicles' noise is said to be: standard deviations (6, C) in the order of `QUANTITIES`."""

    sigma: Array
    least: Array
    """Lower bounds of the estimates."""
    stated: Mask | bool = True
    """(C,) whether the scenario says so."""


class NoiseEstimate:
    """Estimates of C vehicles' noise."""

    def __init__(self, declared: Declared) -> None:
        """Start from what is declared."""
        self._declared = declared
        self._variance = declared.sigma**2
        count = declared.sigma.shape[1]
        self._before = np.zeros((len(ROWS), count))
        self._samples = np.zeros(count)

    @property
    def sigma(self) -> Array:
        """Standard deviations, (6, C)."""
        return np.sqrt(self._variance)

    @property
    def ratios(self) -> Array:
        """Noise by what is declared, (6, C); 1 where nothing is declared, and before `MEMORY` samples."""
        judged = (self._declared.sigma > RESOLUTION[:, None]) & (self._samples >= MEMORY) & self._declared.stated
        return np.where(judged, self.sigma / self._declared.sigma, 1.0)

    def variances(self, which: Indices) -> Array:
        """Return the variances of samples of vehicles `which`, (8, N)."""
        return self._variance[:, which][ROWS]

    def begin(self, column: int) -> None:
        """Start a vehicle again from what is declared."""
        self._variance[:, column] = self._declared.sigma[:, column] ** 2
        self._before[:, column] = self._samples[column] = 0.0

    def learn(self, which: Indices, increments: Array, spread: Array) -> None:
        """Take the increments (8, N) of samples that the model doesn't explain.

        Args:
            which: (N,) columns.
            increments: innovation minus the residual of the sample before.
            spread: (8, N) variances of the innovations.
        """
        bound = CLIPPED_AT * np.sqrt(spread + self.variances(which))
        clipped = within(increments, -bound, bound)
        products = np.add.reduceat(-clipped * self._before[:, which], FIRST_ROWS) / np.bincount(ROWS)[:, None]
        self._before[:, which] = clipped
        self._samples[which] += 1.0
        share = 1.0 / np.minimum(self._samples[which] + FIRST_MEMORY, MEMORY)
        known = self._variance[:, which]
        learnt = known + share * (products - known)
        low, high = self._declared.least[:, which] ** 2, MOST[:, None] ** 2
        self._variance[:, which] = within(learnt, low, high)

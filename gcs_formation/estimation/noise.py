"""How noisy a vehicle's telemetry is seen to be.

White noise of variance r in a sample makes the increments that the model doesn't explain alternate: successive ones
have a covariance of -r. Gusts and lags that differ from the model's give increments that are uncorrelated or follow
each other in sign, so they aren't taken for noise (autocovariance method: Bélanger, Automatica 10, 1974).

A sample has eight values: north, east, height, their rates over ground, airspeed, heading.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.autopilot import squared, within

QUANTITIES: Final = ("position", "height", "velocity", "climb", "airspeed", "heading")
"""What has a noise of its own. North and east count as one quantity."""
ROWS: Final[tuple[int, ...]] = (0, 0, 1, 2, 2, 3, 4, 5)
"""The quantity of each value of a sample."""
VALUES: Final = len(ROWS)
COUNTS: Final[tuple[float, ...]] = (2.0, 1.0, 2.0, 1.0, 1.0, 1.0)
"""Values of each quantity."""
RESOLUTION = np.array((0.003, 0.001, 0.003, 0.003, 0.0001, 0.00002))
"""Least standard deviations, m, m/s and rad: rounding by 1e-7 degrees, 1 mm and 1 cm/s; the last two are floats."""
UNDECLARED = np.array((0.3, 0.3, 0.1, 0.1, 0.3, 0.01))
"""Where nothing is declared: the noise that a real autopilot's estimates begin with here."""
MOST: Final[tuple[float, ...]] = (30.0, 30.0, 5.0, 5.0, 10.0, 0.5)
"""Largest standard deviations; what is noisier isn't telemetry of a flight in formation."""
MEMORY: Final = 100.0
"""Samples over which the mean is taken."""
FIRST_MEMORY: Final = 20.0
"""The same at the start, of a vehicle's first sample."""
CLIPPED_AT: Final = 2.0
"""Standard deviations at which an increment counts no more than that: an outlier isn't noise."""


class Declared(NamedTuple):
    """What the vehicles' noise is said to be: standard deviations (6, C) in the order of `QUANTITIES`."""

    sigma: Array
    least: Array
    """Lower bounds of the estimates."""
    stated: Mask | bool = True
    """(C,) whether the scenario says so."""


class VehicleNoise:
    """The variances of one vehicle's telemetry."""

    __slots__ = ("_before", "_declared", "_least", "by_quantity", "samples", "values")

    def __init__(self, declared: list[float], least: list[float]) -> None:
        """Start from what is declared; both are variances in the order of `QUANTITIES`."""
        self._declared = declared
        self._least = least
        self.begin()

    def begin(self) -> None:
        """Start again from what is declared."""
        self.by_quantity = list(self._declared)
        self.values = [self.by_quantity[quantity] for quantity in ROWS]
        """Of each value of a sample."""
        self._before = [0.0] * VALUES
        self.samples = 0.0

    def learn(self, increments: list[float], spread: list[float]) -> None:
        """Take the increments of a sample's values that the model doesn't explain.

        Args:
            increments: innovation minus the residual of the sample before.
            spread: variances of the innovations.
        """
        products = [0.0] * len(QUANTITIES)
        for row in range(VALUES):
            bound = CLIPPED_AT * math.sqrt(spread[row] + self.values[row])
            clipped = within(increments[row], -bound, bound)
            products[ROWS[row]] -= clipped * self._before[row]
            self._before[row] = clipped
        self.samples += 1.0
        share = 1.0 / min(self.samples + FIRST_MEMORY, MEMORY)
        for quantity, known in enumerate(self.by_quantity):
            learnt = known + share * (products[quantity] / COUNTS[quantity] - known)
            self.by_quantity[quantity] = within(learnt, self._least[quantity], squared(MOST[quantity]))
        self.values = [self.by_quantity[quantity] for quantity in ROWS]


class NoiseEstimate:
    """The noise of C vehicles."""

    def __init__(self, declared: Declared) -> None:
        """Start from what is declared."""
        self._declared = declared
        variances, least = (declared.sigma**2).T.tolist(), (declared.least**2).T.tolist()
        self.each = [VehicleNoise(*both) for both in zip(variances, least, strict=True)]

    @property
    def sigma(self) -> Array:
        """Standard deviations, (6, C)."""
        return np.sqrt(np.array([each.by_quantity for each in self.each]).T)

    @property
    def ratios(self) -> Array:
        """Noise by what is declared, (6, C); 1 where nothing is declared, and before `MEMORY` samples."""
        samples = np.array([each.samples for each in self.each])
        judged = (self._declared.sigma > RESOLUTION[:, None]) & (samples >= MEMORY) & self._declared.stated
        return np.where(judged, self.sigma / self._declared.sigma, 1.0)

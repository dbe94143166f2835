# Compiled by mypyc: it runs every tick.

"""Interpolates between simulations by models of several time constants."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from librt.vecs import vec

RATIO_MAX: Final = 2.0
"""Fitted time constants are between the declared one divided by this and multiplied by it. Tuned: ratio; 1.5 to 3;
shown by `pytest tests/gcs_formation/features/time_constants`."""
BOUND: Final = math.log(RATIO_MAX)


class Nodes:
    """Interpolation between simulations: n Chebyshev points of [-BOUND, BOUND] for each of P parameters, 1 or 2."""

    def __init__(self, count: int, parameters: int) -> None:
        """Take the number n of points and the number P of parameters."""
        points = [BOUND * math.cos((2 * index + 1) * math.pi / (2 * count)) for index in range(count)]
        self.parameters = parameters
        self.at = [[one] for one in points] if parameters == 1 else [[one, two] for one in points for two in points]
        """(K, P) logarithms of the simulations' ratios; K is n to the power of P."""
        terms: list[list[float]] = np.linalg.inv(np.vander(points)).T.tolist()
        self._terms = vec[vec[float]]([vec[float](each) for each in terms])
        """(n, n) coefficients, the highest power's first, of the polynomials that are 1 at one point, 0 at the rest."""

    def weights(self, log_ratio: list[float]) -> vec[vec[float]]:
        """Return (P + 1, K): the weights of the simulations at `log_ratio` (P), and their derivatives."""
        first, by_first = self._one_parameter(log_ratio[0])
        if self.parameters == 1:
            return vec[vec[float]]([first, by_first])
        second, by_second = self._one_parameter(log_ratio[1])
        return vec[vec[float]]([_outer(first, second), _outer(by_first, second), _outer(first, by_second)])

    def _one_parameter(self, log_ratio: float) -> tuple[vec[float], vec[float]]:
        """Return the weights (n) for one parameter, and their derivatives."""
        size = len(self._terms)
        weights, slopes = vec[float]([0.0] * size), vec[float]([0.0] * size)
        for point in range(size):
            weight = slope = 0.0
            for term in self._terms[point]:
                slope = slope * log_ratio + weight
                weight = weight * log_ratio + term
            weights[point], slopes[point] = weight, slope
        return weights, slopes


def _outer(rows: vec[float], columns: vec[float]) -> vec[float]:
    """Return all products of two lists' numbers, those of the first of `rows` first."""
    return vec[float]([row * column for row in rows for column in columns])

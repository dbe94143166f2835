"""The delays of one direction of a link: a constant, and a variate of one of three distributions.

Source: tc-netem(8) for the Pareto distribution's shape.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import Final, Literal

Distribution = Literal["normal", "uniform", "pareto"]

_NORMAL = NormalDist()
_UNIFORM_HALF_WIDTH: Final = math.sqrt(3.0)
_PARETO_SHAPE: Final = 3.0
_PARETO_SCALE: Final = 2.0 / math.sqrt(3.0)
"""Smallest value of a Pareto variate of that shape with standard deviation 1."""
_PARETO_MEAN: Final = 1.5 * _PARETO_SCALE
_LARGEST_BELOW_1: Final = 1.0 - 2.0**-53
_SMALLEST: Final = 2.0**-60


def _uniform_cdf(x: float) -> float:
    return min(max((x / _UNIFORM_HALF_WIDTH + 1.0) / 2.0, 0.0), 1.0)


def _pareto_cdf(x: float) -> float:
    return 1.0 - (_PARETO_SCALE / max(x + _PARETO_MEAN, _PARETO_SCALE)) ** _PARETO_SHAPE


def _uniform_quantile(share: float) -> float:
    return (2.0 * share - 1.0) * _UNIFORM_HALF_WIDTH


def _pareto_quantile(share: float) -> float:
    return _PARETO_SCALE * (1.0 - share) ** (-1.0 / _PARETO_SHAPE) - _PARETO_MEAN


CDF: dict[str, Callable[[float], float]] = {"normal": _NORMAL.cdf, "uniform": _uniform_cdf, "pareto": _pareto_cdf}
"""Cumulative distribution functions of mean 0 and standard deviation 1."""
QUANTILE: dict[str, Callable[[float], float]] = {
    "normal": _NORMAL.inv_cdf,
    "uniform": _uniform_quantile,
    "pareto": _pareto_quantile,
}
"""Their inverses."""


class DelayDistribution:
    """Delays of `delay_s` plus a variate of mean 0 and standard deviation `jitter_s`.

    The distribution is truncated where the delay would be negative and renormalised, which raises the mean.
    """

    def __init__(self, delay_s: float, jitter_s: float, distribution: Distribution) -> None:
        """Take the delay and the jitter, s, both from 0."""
        self._delay_s, self._jitter_s = delay_s, jitter_s
        self._below_zero = CDF[distribution](-delay_s / jitter_s) if jitter_s > 0.0 else 0.0
        self._quantile = QUANTILE[distribution]

    def quantile_s(self, share: float) -> float:
        """Return the delay, s, that a `share` of all (0 to 1) doesn't exceed."""
        if self._jitter_s == 0.0:
            return self._delay_s
        among = self._below_zero + (1.0 - self._below_zero) * share
        variate = self._quantile(min(max(among, _SMALLEST), _LARGEST_BELOW_1))
        return max(0.0, self._delay_s + self._jitter_s * variate)

"""The lags that fit what was flown best, and how well they are known: least squares with a normal prior."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcs_formation.arrays import Array, Mask, within

RATIO_MAX = 2.0
"""A lag is found between the believed one divided and multiplied by this."""
BOUND = math.log(RATIO_MAX)
BELIEVED_SPREAD = 0.35
"""Standard deviation of the logarithm of a lag's ratio before anything is learnt: 40 %."""
CORRELATED_S = 1.0
"""Residuals this far apart count as independent."""
BATCH_S = 1.0
"""How often lags are fitted."""
STEP_MAX = 0.1
"""Largest change of a ratio's logarithm at a fit."""
LEAST_SPREAD = 0.02
"""What was seen first is forgotten once the ratio is known better than this: lags may change. Without excitation
nothing is learnt, and nothing forgotten."""
RECENT_S = 20.0
"""Memory of the misfit."""
SIGNIFICANT = 2.0
"""Standard deviations of the misfit that don't count."""


class Nodes(NamedTuple):
    """Interpolation between simulations: logarithms of their ratios, (K, P), and the polynomials' coefficients."""

    at: Array
    inverse: Array
    """(n, n) of one parameter's Vandermonde matrix, n to the power of P being K."""

    @classmethod
    def of(cls, count: int, parameters: int) -> Nodes:
        """Return `count` Chebyshev points of [-BOUND, BOUND] for each of 1 or 2 parameters."""
        points = BOUND * np.cos((2 * np.arange(count) + 1) * np.pi / (2 * count))
        at = np.stack(np.meshgrid(*[points] * parameters, indexing="ij"), axis=-1).reshape(-1, parameters)
        return cls(at, np.linalg.inv(np.vander(points, increasing=True)).astype(np.float64))

    def weights(self, log_ratio: Array) -> tuple[Array, Array]:
        """Return the weights (C, K) of the simulations at `log_ratio` (C, P), and their derivatives (C, P, K)."""
        powers = np.arange(len(self.inverse))
        each = log_ratio[..., None] ** powers @ self.inverse
        slopes = powers * log_ratio[..., None] ** np.maximum(powers - 1, 0) @ self.inverse
        if log_ratio.shape[1] == 1:
            return each[:, 0], slopes
        (first, second), (first_slope, second_slope) = each.swapaxes(0, 1), slopes.swapaxes(0, 1)
        pairs = (first, second), (first_slope, second), (first, second_slope)
        weights, by_first, by_second = (np.einsum("ci,cj->cij", a, b).reshape(len(a), -1) for a, b in pairs)
        return weights, np.stack((by_first, by_second), axis=1)


@dataclass
class Sums:
    """Sums over samples of the differences between K simulations and the telemetry."""

    count: Array
    """(C,)."""
    first: Array
    """(C, K)."""
    second: Array
    """(C, K, K)."""

    @classmethod
    def none(cls, columns: int, nodes: int) -> Sums:
        """Return the sums over no samples."""
        return cls(np.zeros(columns), np.zeros((columns, nodes)), np.zeros((columns, nodes, nodes)))

    def add(self, differences: Array, counted: Mask) -> None:
        """Add samples (B, C, K) where `counted` (B, C)."""
        kept = np.where(counted[..., None], differences, 0.0)
        self.count += counted.sum(axis=0)
        self.first += kept.sum(axis=0)
        by_column = kept.swapaxes(0, 1)
        self.second += by_column.swapaxes(1, 2) @ by_column

    def keep(self, share: Array | float) -> None:
        """Forget all but a share, a number or (C,)."""
        share = np.broadcast_to(share, self.count.shape)
        self.count *= share
        self.first *= share[:, None]
        self.second *= share[:, None, None]

    def scatter(self) -> Array:
        """Return the sums of products about the mean, (C, K, K)."""
        mean = self.first / np.maximum(self.count, 1.0)[:, None]
        return self.second - mean[:, :, None] * self.first[:, None, :]


class Fit(NamedTuple):
    """What samples say about logarithms of ratios near some values, without the prior."""

    pull: Array
    """(C, P) gradient of the log-likelihood."""
    information: Array
    """(C, P, P)."""

    @classmethod
    def of(cls, sums: Sums, weights: Array, slopes: Array, resolution: float, rate_hz: float) -> Fit:
        """Return the fit at the simulations' `weights` (C, K), whose derivatives are `slopes` (C, P, K)."""
        scatter = sums.scatter()
        misfit = (scatter @ weights[..., None])[..., 0]
        variance = (weights * misfit).sum(axis=1) / np.maximum(sums.count, 1.0) + resolution**2
        worth = 1.0 / (variance * max(1.0, CORRELATED_S * rate_hz))
        pull = -(slopes @ misfit[..., None])[..., 0] * worth[:, None]
        return cls(pull, slopes @ scatter @ slopes.swapaxes(1, 2) * worth[:, None, None])


class Channel:
    """Airspeed, heading or height of all vehicles: what was seen, and the P lags that fit it."""

    def __init__(self, nodes: Nodes, columns: int, resolution: float, rate_hz: float, *, in_use: bool) -> None:
        """Start with the believed lags.

        `rate_hz` is that of the telemetry; `in_use`: whether the lags found are, not the believed ones.
        """
        self.nodes = nodes
        self.log_ratio: Array = np.zeros((columns, nodes.at.shape[1]))
        """(C, P) of the lags to the believed ones."""
        self.spread: Array = np.full_like(self.log_ratio, BELIEVED_SPREAD)
        """(C, P) standard deviations of these."""
        self.misfit: Array = np.zeros(columns)
        """(C,) share by which lags seem to differ from those in use, beyond chance, in what was flown last."""
        self._resolution, self._rate_hz, self._in_use = resolution, rate_hz, in_use
        self._all, self._recent = (Sums.none(columns, len(nodes.at)) for _ in range(2))

    def learn(self, differences: Array, counted: Mask) -> None:
        """Take a batch of simulations minus telemetry, (B, C, K), where `counted` (B, C), and fit the lags anew."""
        apart = np.where(counted, np.abs(differences[..., 0] - differences[..., -1]), 0.0)
        excited = apart.max(axis=0, initial=0.0) > self._resolution
        self._recent.keep(math.exp(-BATCH_S / RECENT_S))
        self._recent.add(differences, counted)
        self._all.add(differences, counted & excited)
        weights, slopes = self.nodes.weights(self.log_ratio)
        self._judge(*((weights, slopes) if self._in_use else self.nodes.weights(np.zeros_like(self.log_ratio))))
        self._fit(weights, slopes)

    def _fit(self, weights: Array, slopes: Array) -> None:
        """Make a Gauss-Newton step towards the most likely lags, and forget what is more than enough."""
        fit = Fit.of(self._all, weights, slopes, self._resolution, self._rate_hz)
        believed = np.eye(slopes.shape[1]) / BELIEVED_SPREAD**2
        covariance = np.linalg.inv(fit.information + believed)
        wanted = (covariance @ (fit.pull - self.log_ratio / BELIEVED_SPREAD**2)[..., None])[..., 0]
        self.log_ratio = within(self.log_ratio + within(wanted, -STEP_MAX, STEP_MAX), -BOUND, BOUND)
        self.spread = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        most = np.diagonal(fit.information, axis1=1, axis2=2).max(axis=1)
        self._all.keep(np.minimum(1.0, 1.0 / (LEAST_SPREAD**2 * np.maximum(most, 1.0))))

    def _judge(self, weights: Array, slopes: Array) -> None:
        """Find by what common share the lags in use, those of `weights`, differ from those of the last flight."""
        sums, slope = self._recent, slopes.sum(axis=1)
        scatter = sums.scatter()
        by_slope = (scatter @ slope[..., None])[..., 0]
        excitation = np.maximum((slope * by_slope).sum(axis=1), 1e-12)
        shown, misfit = (weights * by_slope).sum(axis=1), np.einsum("ck,ckl,cl->c", weights, scatter, weights)
        left = np.maximum(misfit - shown**2 / excitation, 0.0) / np.maximum(sums.count, 1.0)
        chance = np.sqrt((left + self._resolution**2) * max(1.0, CORRELATED_S * self._rate_hz) / excitation)
        self.misfit = np.maximum(0.0, np.abs(shown) / excitation - SIGNIFICANT * chance)

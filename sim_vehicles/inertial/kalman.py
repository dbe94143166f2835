"""A Kalman filter of errors that are corrected as soon as they are estimated, so that its state is always zero."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from formation_scenario.arrays import Array


class Estimate(NamedTuple):
    """The result of a measurement."""

    errors: Array
    """(N,)"""
    innovation: Array
    """(M,) normalised and decorrelated: standard normal if the filter is consistent."""


class ErrorFilter:
    """The covariance of N errors."""

    def __init__(self, covariance: Array) -> None:
        """Start with a covariance (N, N)."""
        self.covariance = covariance

    def predict(self, dynamics: Array, noise_density: Array, period_s: float) -> None:
        """Propagate by `period_s`, short compared with the dynamics (N, N); `noise_density` is the diagonal (N,)."""
        step = dynamics * period_s
        transition = np.eye(len(step)) + step + step @ step / 2.0
        # Simpson's rule, to include how the dynamics spread the noise within the step.
        half = np.eye(len(step)) + step / 2.0 + step @ step / 8.0
        middle, end = (half * noise_density) @ half.T, (transition * noise_density) @ transition.T
        noise = (end + 4.0 * middle + np.diag(noise_density)) * period_s / 6.0
        self.covariance = transition @ self.covariance @ transition.T + noise

    def update(self, seen: Array, measured: Array, sigmas: Array) -> Estimate:
        """Process a measurement (M,) of `seen` (M, N) @ errors, with independent standard deviations (M,)."""
        across = self.covariance @ seen.T
        total = seen @ across + np.diag(sigmas**2)
        root = cholesky(total, lower=True)
        gain = cho_solve((root, True), across.T).T
        kept = np.eye(len(self.covariance)) - gain @ seen
        # Joseph's form stays symmetric and positive definite in spite of rounding.
        self.covariance = kept @ self.covariance @ kept.T + (gain * sigmas**2) @ gain.T
        return Estimate(gain @ measured, solve_triangular(root, measured, lower=True))

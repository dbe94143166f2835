"""Dryden's turbulence: the gusts that it adds to vehicles.

Source: MIL-F-8785C (1980), section 3.7.1.2. There u points along the horizontal motion through the air and w downwards;
v completes the axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flight_model.arrays import Array
from formation_scenario.surroundings import DrydenTurbulence

LEAST_AIRSPEED_MPS = 1.0
"""Lower bound of the airspeed: for a vehicle at rest a gust would last for ever."""
DRAWS_EACH = 5
BLOCK = 256
SQRT3 = math.sqrt(3.0)


def discretised(duration: Array) -> tuple[Array, Array]:
    """Return transition (..., 2, 2) and noise factor (..., 2, 2) of the lateral filter over `duration` times V / L.

    (1 + sqrt(3) T s) / (1 + T s)^2 as p' = (n - p) / T, q' = (p - q) / T with white noise n; the factor is the Cholesky
    one of the covariance that the noise adds meanwhile: both are exact. Stationary E p^2 = 1/2, E p q = E q^2 = 1/4.
    """
    d = np.asarray(duration, dtype=np.float64)
    kept, lost = np.exp(-d), -np.expm1(-2 * d)
    square = np.exp(-2 * d)
    pp, pq = lost / 2, lost / 4 - square * d / 2
    qq = lost / 4 - square * (d + d**2) / 2
    factor = np.zeros((*d.shape, 2, 2))
    factor[..., 0, 0] = np.sqrt(pp)
    factor[..., 1, 0] = pq / np.sqrt(pp)
    factor[..., 1, 1] = np.sqrt(np.maximum(qq - pq**2 / pp, 0.0))
    transition = np.zeros((*d.shape, 2, 2))
    transition[..., 0, 0] = transition[..., 1, 1] = kept
    transition[..., 1, 0] = kept * d
    return transition, factor


class DrydenGusts:
    """The gusts that N vehicles meet, each from random numbers of its own.

    The filters' states are normalised to unit variance, so that the gusts have the right rms velocities while airspeed
    and height change. They start in the stationary state.
    """

    def __init__(self, streams: Sequence[np.random.Generator], keys: DrydenTurbulence) -> None:
        """Draw the gusts of vehicle i from `streams[i]`, with the intensity of `keys`."""
        self._keys = keys
        self._random = streams
        self._drawn: Array = np.zeros((0, DRAWS_EACH, len(streams)))
        self._next = 0
        first = self._draw()
        self._along: Array = first[0]
        p = first[1:3] * math.sqrt(1 / 2)
        self._across: Array = np.stack((p, p / 2 + first[3:5] * math.sqrt(1 / 8)))

    def advance(self, airspeed_mps: Array, height_m: Array, dt_s: float) -> Array:
        """Advance by `dt_s` and return the gusts (3, N) forward, right and down, m/s."""
        sigma_mps, length_m = self._keys.scales(height_m)
        duration = dt_s * np.maximum(airspeed_mps, LEAST_AIRSPEED_MPS) / length_m
        noise = self._draw()
        kept = np.exp(-duration[0])
        self._along = kept * self._along + np.sqrt(-np.expm1(-2 * duration[0])) * noise[0]
        transition, factor = discretised(duration[1:])
        driven = np.stack((noise[1:3], noise[3:5]))
        self._across = np.einsum("anij,jan->ian", transition, self._across) + np.einsum("anij,jan->ian", factor, driven)
        right_down = SQRT3 * self._across[0] + (1 - SQRT3) * self._across[1]
        return sigma_mps * np.concatenate((self._along[None], right_down))

    def _draw(self) -> Array:
        """Return a step's normal variates, (5, N)."""
        if self._next == len(self._drawn):
            self._drawn = np.stack([each.standard_normal((BLOCK, DRAWS_EACH)) for each in self._random], axis=-1)
            self._next = 0
        self._next += 1
        return self._drawn[self._next - 1]

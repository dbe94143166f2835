"""Gusts with Dryden's spectra at each vehicle.

Source: MIL-F-8785C (1980), section 3.7.1.2. Its axis u points along the horizontal motion through the air and w
downwards; v completes the axes. Intensities and scale lengths are in `flight_model.turbulence`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from airlink.clock import Instant
from flight_model.arrays import Array
from formation_scenario.surroundings import DrydenTurbulence
from sim_vehicles.airframe.in_air import InAir
from sim_vehicles.board_clock import LOOP_S

MIN_AIRSPEED_MPS = 1.0
"""Lower bound of airspeed in gust filters: for a vehicle at rest a gust would never end."""
DRAWS_EACH = 5
BLOCK = 256
SQRT3 = math.sqrt(3.0)


def discretised(duration: Array) -> tuple[Array, Array]:
    """Return transition (..., 2, 2) and noise factor (..., 2, 2) of the lateral filter over `duration` times V / L.

    The filter (1 + sqrt(3) T s) / (1 + T s)^2 is p' = (n - p) / T, q' = (p - q) / T with white noise n. The factor is
    the Cholesky factor of the covariance of the integrated noise. Both are exact; in the stationary state E p^2 = 1/2,
    E p q = E q^2 = 1/4.
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
    """Gusts of N vehicles, each along its own flight through the air and from its own random numbers.

    The filters' states are normalised to unit variance, so that the gusts have the right rms velocities while airspeed
    and height change. They start in the stationary state.
    """

    def __init__(
        self,
        keys: DrydenTurbulence,
        hit: list[InAir],
        streams: Sequence[np.random.Generator],
        wind_mps: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Draw the gusts of `hit[i]` from `streams[i]`, with the intensity of `keys`.

        A multirotor's gusts are along and across the wind, a fixed wing's along and across its heading: a multirotor's
        course is arbitrary when it hardly moves.
        """
        self.keys, self._hit = keys, hit
        self.zero: Instant | None = None
        """From when times count; None: from mission time 0."""
        self._along_wind_rad = math.atan2(wind_mps[1], wind_mps[0])
        self._random = streams
        self._drawn: Array = np.zeros((0, DRAWS_EACH, len(streams)))
        self._next = 0
        first = self._draw()
        self._along: Array = first[0]
        p = first[1:3] * math.sqrt(1 / 2)
        self._across: Array = np.stack((p, p / 2 + first[3:5] * math.sqrt(1 / 8)))

    def share(self, mission_s: float) -> float:
        """Return the time instead of a share, so that gusts are updated at each instant."""
        return mission_s

    def add(self, share: float) -> None:  # noqa: ARG002 - gusts act in full
        """Advance the gusts by a cycle of the main loop, and add them to the vehicles' disturbances."""
        states = [body.state for body in self._hit]
        airspeed_mps, height_m = np.array([(each.airspeed_mps, each.height_m) for each in states]).T
        gusts_mps = self.advance(airspeed_mps, height_m, LOOP_S).T.tolist()
        for body, state, (forward, right, down) in zip(self._hit, states, gusts_mps, strict=True):
            axis_rad = self._along_wind_rad if body.model.may_hover else state.heading_rad
            cos, sin = math.cos(axis_rad), math.sin(axis_rad)
            body.disturb(forward * cos - right * sin, forward * sin + right * cos, down)

    def advance(self, airspeed_mps: Array, height_m: Array, dt_s: float) -> Array:
        """Advance by `dt_s` and return the gusts (3, N) forward, right and down, m/s."""
        sigma_mps, length_m = self.keys.scales(height_m)
        duration = dt_s * np.maximum(airspeed_mps, MIN_AIRSPEED_MPS) / length_m
        noise = self._draw()
        kept = np.exp(-duration[0])
        self._along = kept * self._along + np.sqrt(-np.expm1(-2 * duration[0])) * noise[0]
        transition, factor = discretised(duration[1:])
        driven = np.stack((noise[1:3], noise[3:5]))
        self._across = np.einsum("anij,jan->ian", transition, self._across) + np.einsum("anij,jan->ian", factor, driven)
        right_down = SQRT3 * self._across[0] + (1 - SQRT3) * self._across[1]
        return sigma_mps * np.concatenate((self._along[None], right_down))

    def _draw(self) -> Array:
        """Return one step's standard normal variates, (5, N)."""
        if self._next == len(self._drawn):
            self._drawn = np.stack([each.standard_normal((BLOCK, DRAWS_EACH)) for each in self._random], axis=-1)
            self._next = 0
        self._next += 1
        return self._drawn[self._next - 1]

"""A Kalman filter of each vehicle's noisy telemetry, through the autopilot model (7) and the setpoints that were sent.

Source: the extended Kalman filter of Gelb, "Applied Optimal Estimation" (1974), chapter 6, on FlightState's eight rows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from airlink.clock import NANOSECONDS
from gcs_formation.arrays import Array, Instants
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState
from gcs_formation.estimation.predictor import SetpointHistory

NORTH, EAST, HEIGHT, CLIMB, SPEED, HEADING, WIND_NORTH, WIND_EAST = range(8)
UNMODELLED = np.array((0.0, 0.0, 0.0, 0.05, 0.05, 0.003, 0.0, 0.0))
"""How far climb, airspeed (m/s) and heading (rad) stray from model (7) in a square root of a second."""
POLES_APART = 1e-3
"""Relative difference that equal time constants of the height are given, so that one closed form serves."""
UNKNOWN_WIND_MPS = 1.0
UNEXPLAINED = 60.0
"""Normalised innovation squared (8 degrees of freedom) beyond which the vehicle does something that the model doesn't:
it's flown by somebody else, or on the ground."""


@dataclass(frozen=True)
class Noise:
    """Noise of one vehicle's samples: standard deviations in SI units."""

    position_m: float
    velocity_mps: float
    airspeed_mps: float
    heading_rad: float
    wind_walk: float
    """Of the wind's change in a square root of a second, m/s."""

    @property
    def variances(self) -> Array:
        """Of (8,) north, east, height, their rates, airspeed and heading."""
        each = self.position_m, self.velocity_mps, self.airspeed_mps, self.heading_rad
        return np.repeat(each, (3, 3, 1, 1)) ** 2


class Fusion:
    """One vehicle's filter; `state` (8,) is FlightState's rows."""

    def __init__(self, noise: Noise, column: int, history: SetpointHistory, model: AutopilotModel) -> None:
        """Fuse the samples of `column` of the history, whose model is `model`, (C,) columns."""
        self._measured = np.diag(noise.variances)
        self._walk = UNMODELLED**2
        self._walk[WIND_NORTH:] = noise.wind_walk**2
        self._column = np.array([column], dtype=np.intp)
        self._history = history
        self._models = model
        self._take_lags()
        self.covariance: Array = self._unknown()
        """(8, 8) of the newest estimate's error."""

    def _take_lags(self) -> None:
        """Read the model anew: its lags are learnt in flight."""
        self._model = own = self._models.take(self._column)
        self._lags_s = float(own.tau_v_s[0]), float(own.tau_psi_s[0])
        slow_s, fast_s = sorted((float(own.tau_ha_s[0]), float(own.tau_hb_s[0])), reverse=True)
        self._poles_s = slow_s, min(fast_s, slow_s * (1.0 - POLES_APART))

    def begin(self) -> None:
        """Start from the present state, with the uncertainty of a single sample."""
        self.covariance = self._unknown()

    def update(self, state: Array, since: Instants, sample: Array, stamp: Instants) -> Array:
        """Return the state at `stamp`, (1,), from the one at `since` and a sample.

        Args:
            state: (8,) at `since`.
            since: (1,) its instant.
            sample: (8,) north, east, height, their rates, airspeed, heading.
            stamp: (1,) its instant, no earlier.
        """
        self._take_lags()
        elapsed_s = float(stamp[0] - since[0]) / NANOSECONDS
        before = FlightState.of(state[:, None])
        predicted = self._history.predict(before, since, stamp, self._column, self._model).table[:, 0]
        transition = self.transition(state, elapsed_s)
        covariance = transition @ self.covariance @ transition.T + np.diag(self._walk) * elapsed_s
        innovation, rows = _innovation(predicted, sample), _rows(predicted)
        spread = rows @ covariance @ rows.T + self._measured
        if innovation @ np.linalg.solve(spread, innovation) > UNEXPLAINED:
            covariance = self._unknown()
            spread = rows @ covariance @ rows.T + self._measured
        gain = np.linalg.solve(spread, rows @ covariance).T
        kept = np.eye(8) - gain @ rows
        self.covariance = kept @ covariance @ kept.T + gain @ self._measured @ gain.T
        fused = predicted + gain @ innovation
        fused[HEADING] = math.remainder(fused[HEADING], math.tau)
        return fused

    def _unknown(self) -> Array:
        """Return the covariance of a state known from one sample only, which says nothing about the wind."""
        north, east, height, _, _, climb, speed, heading = np.diag(self._measured)
        wind = UNKNOWN_WIND_MPS**2 if self._walk[WIND_NORTH] > 0 else 0.0
        return 100.0 * np.diag((north, east, height, climb, speed, heading, wind, wind))

    def transition(self, state: Array, elapsed_s: float) -> Array:
        """Return the derivative of the state `elapsed_s` later by the state now, (8, 8), at constant heading."""
        cos, sin = math.cos(state[HEADING]), math.sin(state[HEADING])
        (kept, turned), (speed_s, heading_s) = _decay(self._lags_s, elapsed_s)
        transition = np.eye(8)
        transition[NORTH, (SPEED, HEADING, WIND_NORTH)] = cos * speed_s, -state[SPEED] * sin * heading_s, elapsed_s
        transition[EAST, (SPEED, HEADING, WIND_EAST)] = sin * speed_s, state[SPEED] * cos * heading_s, elapsed_s
        transition[SPEED, SPEED], transition[HEADING, HEADING] = kept, turned
        slow_s, fast_s = self._poles_s
        (slow, fast), _ = _decay((slow_s, fast_s), elapsed_s)
        apart_s = slow_s - fast_s
        transition[HEIGHT, (HEIGHT, CLIMB)] = (slow_s * slow - fast_s * fast), slow_s * fast_s * (slow - fast)
        transition[CLIMB, (HEIGHT, CLIMB)] = fast - slow, slow_s * fast - fast_s * slow
        transition[HEIGHT : CLIMB + 1, HEIGHT : CLIMB + 1] /= apart_s
        return transition


def _decay(lags_s: tuple[float, float], elapsed_s: float) -> tuple[list[float], list[float]]:
    """Return the share of a difference that first-order lags leave, and its integral."""
    left = [math.exp(-elapsed_s / lag_s) for lag_s in lags_s]
    return left, [lag_s * (1.0 - each) for lag_s, each in zip(lags_s, left, strict=True)]


def _innovation(state: Array, sample: Array) -> Array:
    speed, heading = state[SPEED], state[HEADING]
    north_mps = speed * math.cos(heading) + state[WIND_NORTH]
    east_mps = speed * math.sin(heading) + state[WIND_EAST]
    expected = (*state[:CLIMB], north_mps, east_mps, state[CLIMB], speed, heading)
    innovation = sample - np.array(expected)
    innovation[-1] = math.remainder(innovation[-1], math.tau)
    return innovation


def _rows(state: Array) -> Array:
    """Return the derivative of a sample by the state, (8, 8)."""
    cos, sin = math.cos(state[HEADING]), math.sin(state[HEADING])
    rows = np.zeros((8, 8))
    rows[(0, 1, 2), (NORTH, EAST, HEIGHT)] = 1.0
    rows[3, (SPEED, HEADING, WIND_NORTH)] = cos, -state[SPEED] * sin, 1.0
    rows[4, (SPEED, HEADING, WIND_EAST)] = sin, state[SPEED] * cos, 1.0
    rows[(5, 6, 7), (CLIMB, SPEED, HEADING)] = 1.0
    return rows

"""The extended Kalman filter of a state's eight rows through model (7), and how noisy telemetry is seen to be.

White noise of variance r in a sample makes the increments that the model doesn't explain alternate: successive ones
have a covariance of -r. Gusts and lags that differ from the model's give increments that are uncorrelated or follow
each other in sign, so they aren't taken for noise (autocovariance method: Bélanger, Automatica 10, 1974).

Source: Gelb, "Applied Optimal Estimation" (1974), chapter 6. A sample is (8, N): north, east, height, their rates over
ground, airspeed, heading.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from flight_model.arrays import Array, Indices, Mask, within, wrap
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates

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
STATES = 8
NORTH, EAST, HEIGHT, CLIMB, SPEED, HEADING, WIND_NORTH, WIND_EAST = range(STATES)
GROUND_NORTH, GROUND_EAST, RISE, AIRSPEED, YAW = range(3, STATES)
"""Rows of a sample after its north, east and height."""
_EYE = np.eye(STATES)


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


class Estimate(NamedTuple):
    """States of N vehicles and how far they may be off."""

    table: Array
    """(8, N), FlightStates's rows."""
    covariance: Array
    """(N, 8, 8)."""


def transition(state: FlightStates, elapsed_s: Array, model: AutopilotModels) -> Array:
    """Return the derivative of the states `elapsed_s` (N,) later by the states now, (N, 8, 8), at constant heading."""
    cos, sin, speed = np.cos(state.heading_rad), np.sin(state.heading_rad), state.airspeed_mps
    kept = np.exp(-elapsed_s / model.air_lags_s)
    speed_s, heading_s = model.air_lags_s * (1.0 - kept)
    slow_s, fast_s = np.maximum(model.tau_ha_s, model.tau_hb_s), np.minimum(model.tau_ha_s, model.tau_hb_s)
    slow, fast = np.exp(-elapsed_s / slow_s), np.exp(-elapsed_s / fast_s)
    # With equal poles, the limit of exprel gives the double pole's form.
    between_s = elapsed_s * slow * scipy.special.exprel(elapsed_s / slow_s - elapsed_s / fast_s)
    derivative = np.zeros((elapsed_s.size, STATES, STATES))
    derivative[:] = _EYE
    derivative[:, NORTH, SPEED], derivative[:, EAST, SPEED] = cos * speed_s, sin * speed_s
    derivative[:, NORTH, HEADING], derivative[:, EAST, HEADING] = -speed * sin * heading_s, speed * cos * heading_s
    derivative[:, NORTH, WIND_NORTH] = derivative[:, EAST, WIND_EAST] = elapsed_s
    derivative[:, SPEED, SPEED], derivative[:, HEADING, HEADING] = kept
    derivative[:, HEIGHT, HEIGHT], derivative[:, HEIGHT, CLIMB] = slow + between_s / slow_s, between_s
    derivative[:, CLIMB, HEIGHT] = -between_s / (slow_s * fast_s)
    derivative[:, CLIMB, CLIMB] = fast - between_s / slow_s
    return derivative


def expected(state: FlightStates) -> Array:
    """Return the sample that vehicles in `state` would give, (8, N)."""
    ground_north = state.airspeed_mps * np.cos(state.heading_rad) + state.wind_north_mps
    ground_east = state.airspeed_mps * np.sin(state.heading_rad) + state.wind_east_mps
    return np.array((*state.place_m, ground_north, ground_east, state.climb_mps, *state.air_motion))


def innovation(sample: Array, state: FlightStates) -> Array:
    """Return the sample minus the expected one, (8, N)."""
    difference = sample - expected(state)
    difference[YAW] = wrap(difference[YAW])
    return difference


def sensitivity(state: FlightStates) -> Array:
    """Return the derivative of a sample by the state, (N, 8, 8)."""
    cos, sin, speed = np.cos(state.heading_rad), np.sin(state.heading_rad), state.airspeed_mps
    rows = np.zeros((cos.size, STATES, STATES))
    rows[:, (0, 1, 2), (NORTH, EAST, HEIGHT)] = 1.0
    rows[:, (GROUND_NORTH, GROUND_EAST), (WIND_NORTH, WIND_EAST)] = 1.0
    rows[:, (RISE, AIRSPEED, YAW), (CLIMB, SPEED, HEADING)] = 1.0
    rows[:, GROUND_NORTH, SPEED], rows[:, GROUND_NORTH, HEADING] = cos, -speed * sin
    rows[:, GROUND_EAST, SPEED], rows[:, GROUND_EAST, HEADING] = sin, speed * cos
    return rows


def diagonal(variances: Array) -> Array:
    """Return (N, 8, 8) diagonal matrices of (8, N) values."""
    return variances.T[:, :, None] * _EYE


def correct(predicted: Estimate, rows: Array, spread: Array, difference: Array, variances: Array) -> Estimate:
    """Return the estimate that a sample corrects.

    Args:
        predicted: the estimate before.
        rows: (N, 8, 8) of `sensitivity`.
        spread: (N, 8, 8) covariance of the innovation.
        difference: (8, N) the innovation.
        variances: (8, N) of the sample's noise.
    """
    gain = np.linalg.solve(spread, rows @ predicted.covariance).swapaxes(1, 2)
    table = predicted.table + (gain @ difference.T[:, :, None])[:, :, 0].T
    table[HEADING] = wrap(table[HEADING])
    kept = _EYE - gain @ rows
    noise = (gain * variances.T[:, None, :]) @ gain.swapaxes(1, 2)
    return Estimate(table, kept @ predicted.covariance @ kept.swapaxes(1, 2) + noise)

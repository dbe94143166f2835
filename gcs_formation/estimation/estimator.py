"""The state of every vehicle at its newest time stamp, on the station's clock: one Kalman filter each, on arrays.

It always runs: exact telemetry is the case of small noise. It predicts by model (7) through the setpoints that were
sent, weighs a sample by the noise that it has been seen to have, and gives little to a sample that isn't plausible.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from airlink.clock import NANOSECONDS, Instant, seconds_between
from flight_model.arrays import Array, Indices, Instants, Mask, any_of
from gcs_formation.estimation import kalman
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates
from gcs_formation.estimation.kalman import (
    AIRSPEED,
    GROUND_EAST,
    GROUND_NORTH,
    SPEED,
    STATES,
    WIND_NORTH,
    YAW,
    Declared,
    Estimate,
    NoiseEstimate,
)
from gcs_formation.estimation.predictor import SetpointHistory

LEAST_AIRSPEED_MPS = 1.0
"""What an airspeed below it is taken as: equations divide by it, and what flies has more."""
UNMODELLED = np.array((0.0, 0.0, 0.0, 0.05, 0.05, 0.003, 0.0, 0.0))[:, None]
"""How far climb, airspeed (m/s) and heading (rad) stray from model (7) in a square root of a second."""
UNTOLD = np.array((0.0, 0.0, 0.0, 1.0, 1.0, 0.3, 0.0, 0.0))[:, None]
"""The same of a vehicle that isn't told what to do by us."""
WITHOUT_WIND = 0.1
"""How far positions stray, m in a square root of a second, where the wind isn't observed."""
WIND_WALK = 0.02
"""Of the wind's change in a square root of a second, m/s, without gusts."""
GUST_RADPS = 1.0
"""Bandwidth of the wind's observation from which a gust is believed at once: a slower one is asked for where airspeed
lags or is off, and would show gusts that aren't there."""
GUST_SIGMAS = 4.0
"""Standard deviations of the wind that a sample tells beyond which it is a gust: believed, at once."""
IMPLAUSIBLE_SIGMAS = 3.0
"""Standard deviations beyond which a value of a sample counts less, by the square of the excess."""
IMPLAUSIBLE = np.array((0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.1))[:, None]
"""Added to them, m/s and rad: what a vehicle may do between two samples that the model doesn't know of."""
STRAY_MPS = 1.0
"""The same for the position, by the time between them."""
IMPLAUSIBLE_SAMPLES = 5
"""So many in a row aren't outliers: somebody else flies the vehicle. Its state begins anew from the newest."""
FORGOTTEN_S = 5.0
"""A state that is so old says nothing about the present one."""


class Sample(NamedTuple):
    """What a vehicle measured at one instant: ground velocity, and position north, east and up from the origin."""

    stamp: Instant
    north_m: float
    east_m: float
    height_m: float
    north_mps: float
    east_mps: float
    climb_mps: float
    airspeed_mps: float
    heading_rad: float


class StateEstimator:
    """The filters of C columns, one for each vehicle."""

    def __init__(self, declared: Declared, history: SetpointHistory, telemetry_hz: float, wind_radps: float) -> None:
        """Start with nothing known.

        Args:
            declared: the noise of the columns' telemetry.
            history: the setpoints that were sent to them.
            telemetry_hz: samples a second.
            wind_radps: the most that the wind's estimate follows anything but gusts; 0: the wind stays 0.
        """
        columns = declared.sigma.shape[1]
        self.noise = NoiseEstimate(declared)
        """Of every column's telemetry."""
        self._table = np.full((STATES, columns), np.nan)
        self._covariance = np.zeros((columns, STATES, STATES))
        self._residual = np.zeros((STATES, columns))
        self._stamps = np.zeros(columns, dtype=np.int64)
        self._implausible = np.zeros(columns, dtype=np.int64)
        self._history, self._telemetry_hz = history, telemetry_hz
        self._wind, self._wind_radps = wind_radps > 0, wind_radps

    @property
    def state(self) -> FlightStates:
        """The newest states; NaN where none has arrived yet."""
        return FlightStates.of(self._table.copy())

    @property
    def covariance(self) -> Array:
        """(C, 8, 8) of their errors."""
        return self._covariance.copy()

    @property
    def wind_sigma_mps(self) -> Array:
        """(C,) standard deviation of each component of the wind."""
        return np.sqrt(np.einsum("cii->c", self._covariance[:, WIND_NORTH:, WIND_NORTH:]) / 2)

    @property
    def stamps(self) -> Instants:
        """The time stamps of those states on the station's clock: (C,) instants."""
        return self._stamps.copy()

    @property
    def known(self) -> Mask:
        """Which columns have a state: (C,)."""
        known: Mask = np.logical_and.reduce(np.isfinite(self._table))
        return known

    def age_s(self, column: int, now: Instant) -> float:
        """Return how old a column's state is, in s; NaN when it has none."""
        if math.isnan(self._table[0, column]):
            return math.nan
        return seconds_between(Instant(int(self._stamps[column])), now)

    def forget(self, column: int) -> None:
        """Forget a vehicle that has restarted."""
        self._table[:, column] = np.nan
        self.noise.begin(column)

    def place(self, column: int, state: Array, stamp: Instant) -> None:
        """Set a column to (8,) values in the order of FlightStates."""
        self._table[:, column] = state
        self._stamps[column] = stamp

    def take(self, samples: Mapping[int, Sample], model: AutopilotModels, told: Mask) -> None:
        """Take the newest sample of each column that has one.

        Args:
            samples: by column.
            model: the autopilots, (C,) columns.
            told: (C,) which of them follow our setpoints.
        """
        if not samples:
            return
        which = np.fromiter(samples, dtype=np.intp, count=len(samples))
        stamps = np.array([sample.stamp for sample in samples.values()], dtype=np.int64)
        values = np.array([sample[1:] for sample in samples.values()]).T
        values[AIRSPEED] = np.maximum(values[AIRSPEED], LEAST_AIRSPEED_MPS)
        age_s = (stamps - self._stamps[which]) / NANOSECONDS
        follows = np.isfinite(self._table[0, which]) & (age_s <= FORGOTTEN_S) & (not self._history.empty)
        if any_of(~follows):
            self._begin(which[~follows], stamps[~follows], values[:, ~follows])
        if any_of(follows):
            which = which[follows]
            self._follow(which, np.maximum(stamps[follows], self._stamps[which]), values[:, follows], model, told)

    def _begin(self, which: Indices, stamps: Instants, values: Array) -> None:
        """Start columns from a single sample."""
        state, variances = self._state_of(values), self.noise.variances(which)
        wind = variances[GROUND_NORTH] + variances[AIRSPEED] + (values[AIRSPEED] ** 2) * variances[YAW]
        first = np.concatenate((variances[:3], variances[5:], np.array((wind, wind)) * self._wind))
        self._table[:, which], self._covariance[which] = state, kalman.diagonal(first)
        self._residual[:, which], self._implausible[which], self._stamps[which] = 0.0, 0, stamps

    def _state_of(self, values: Array) -> Array:
        """Return the states (8, N) that samples tell by themselves."""
        speed, heading = values[AIRSPEED:]
        wind = values[GROUND_NORTH : GROUND_EAST + 1] - speed * np.array((np.cos(heading), np.sin(heading)))
        return np.concatenate((values[:3], values[5:], wind * self._wind))

    def _follow(self, which: Indices, stamps: Instants, values: Array, model: AutopilotModels, told: Mask) -> None:
        """Correct the predicted states of columns by their samples."""
        model, variances = model.take(which), self.noise.variances(which)
        since, elapsed_s = self._stamps[which], (stamps - self._stamps[which]) / NANOSECONDS
        before = FlightStates.of(self._table[:, which])
        predicted = self._history.predict(before, since, stamps, which, model)
        move = kalman.transition(before, elapsed_s, model)
        covariance = move @ self._covariance[which] @ move.swapaxes(1, 2)
        covariance += kalman.diagonal(self._walk(variances, told[which]) * elapsed_s)
        difference, rows = kalman.innovation(values, predicted), kalman.sensitivity(predicted)
        if self._wind_radps >= GUST_RADPS:
            covariance = covariance + self._gusts(values, predicted, covariance, variances, elapsed_s)
        spread = rows @ covariance @ rows.swapaxes(1, 2)
        own = np.einsum("nii->in", spread) + variances
        self.noise.learn(which, difference - self._residual[:, which], own)
        weighed, implausible = _weighed(difference, own, variances, elapsed_s)
        spread += kalman.diagonal(weighed)
        estimate = kalman.correct(Estimate(predicted.table, covariance), rows, spread, difference, weighed)
        estimate.table[SPEED] = np.maximum(estimate.table[SPEED], LEAST_AIRSPEED_MPS)
        self._table[:, which], self._covariance[which] = estimate
        self._stamps[which] = stamps
        self._residual[:, which] = kalman.innovation(values, FlightStates.of(estimate.table))
        self._implausible[which] = np.where(implausible, self._implausible[which] + 1, 0)
        lost = self._implausible[which] >= IMPLAUSIBLE_SAMPLES
        if any_of(lost):
            self._begin(which[lost], stamps[lost], values[:, lost])

    def _walk(self, variances: Array, told: Mask) -> Array:
        """Return the variances (8, N) that a second adds."""
        walk = np.where(told, UNMODELLED, UNTOLD)
        if not self._wind:
            walk[:2] = WITHOUT_WIND
            return walk**2
        noise_mps = np.sqrt(variances[GROUND_NORTH] + variances[AIRSPEED])
        walk[WIND_NORTH:] = np.minimum(WIND_WALK, self._wind_radps * noise_mps / math.sqrt(self._telemetry_hz))
        return walk**2

    def _gusts(
        self, values: Array, predicted: FlightStates, covariance: Array, variances: Array, elapsed_s: Array
    ) -> Array:
        """Return what the covariances grow by, (N, 8, 8), where samples tell of a wind that has changed at once."""
        jump = self._state_of(values)[WIND_NORTH:] - predicted.wind_mps
        size = (jump**2).mean(axis=0)
        known = variances[GROUND_NORTH] + variances[AIRSPEED] + values[AIRSPEED] ** 2 * variances[YAW]
        known = known + covariance[:, WIND_NORTH, WIND_NORTH]
        size = np.where((size > GUST_SIGMAS**2 * known) & (size < (3.0 * IMPLAUSIBLE[3]) ** 2), size, 0.0)
        grown = np.zeros_like(covariance)
        for place in (0, 1):
            wind = WIND_NORTH + place
            grown[:, wind, wind] = size
            grown[:, wind, place] = grown[:, place, wind] = size * elapsed_s / 2
            grown[:, place, place] = size * elapsed_s**2 / 3
        return grown


def _weighed(difference: Array, own: Array, variances: Array, elapsed_s: Array) -> tuple[Array, Mask]:
    """Return the variances (8, N) by which samples are weighed, and which of them (N,) aren't plausible.

    A value that is u times too far off is given a noise that makes its innovation's variance u² times as large.
    """
    allowance = np.repeat(IMPLAUSIBLE, elapsed_s.size, axis=1)
    allowance[:3] = STRAY_MPS * elapsed_s
    excess = difference**2 / (IMPLAUSIBLE_SIGMAS**2 * (own + allowance**2))
    return variances + own * np.maximum(excess - 1.0, 0.0), np.logical_or.reduce(excess > 1.0)

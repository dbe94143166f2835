"""Estimates equation (7) from whole flights by their setpoints alone, with a model of the noise (Box and Jenkins).

Ljung, "System Identification", 2nd ed., 4.2; Jategaonkar, "Flight Vehicle System Identification", chapter 4. No
measurement enters the simulation, so telemetry noise doesn't bias the estimate. The states at a recording's start, and
each channel's constant offset from its setpoint, are estimated with the parameters. Errors are taken at the
measurements only, not at interpolated points, because setpoints depend on earlier measurements.

Disturbances last, and the law answers them by its setpoints: a headwind gust coincides with a lower speed setpoint,
which looks as if the vehicle hardly followed setpoints. So an autoregressive model predicts each error from earlier
ones, and only the remainder counts. This makes the estimate consistent in closed loop too (Ljung, 13.4). If errors are
white, the autoregressive model has no coefficients, and this is output-error estimation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_toeplitz

from flight_model.arrays import Array, Indices, Mask, wrap
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, advance
from gcs_formation.identify.recording import STEP_S, Recording

RESOLUTION = np.array([0.05, 0.005, 0.1])
"""Least standard deviations of errors of airspeed (m/s), heading (rad) and height (m)."""
BEGIN_NUDGES = np.array([0.1, 0.01, 0.3, 0.1])
"""Steps of airspeed, heading, height and climb at the start, for numerical derivatives."""
BEGINS, CHANNELS = len(BEGIN_NUDGES), len(RESOLUTION)
HUBER = 2.0
"""Errors larger than this many standard deviations count by their size, not its square."""
ORDER_MAX = 40
"""Highest order of the autoregressive model."""
OUTLYING = 4.0
"""Larger errors, in standard deviations, are clipped to this when the noise model is fitted."""
INDEPENDENT_AFTER_S = 20.0
"""Errors this far apart count as independent in the standard deviations of the estimate."""
ITERATIONS = 15
NUDGE = 0.02
"""Step of a parameter's logarithm for the numerical derivative."""
STEP_MAX = 0.4
"""Largest change of a parameter's logarithm at a step of the search. Tuned: a number; 0.2 to 0.7; by judgement."""
CLOSE = 1e-5
"""Change of the logarithms below which the search ends."""
NEAR_ENOUGH = 1e-3
"""The same where the search only has to show whether a further parameter is worth a full one."""
TINY = 1e-9
MIN_KNOWN = 1e-8
"""Directions with less information than this, relative to the largest, count as unknown."""
MIN_SPEED_MPS = 1.0
"""Below this speed no lateral acceleration turns a vehicle."""

MIN_SQUARE = 1e-4
"""Least mean square of errors in the information of white ones, in units of `RESOLUTION`: simulations have none."""

Flown = Callable[[Array], tuple[Sequence[Array], AutopilotModels]]
"""From the parameters' logarithms to what acts on each recording's vehicle, (4, K), and its model, one column."""


class Point(NamedTuple):
    """One recording's errors at a set of parameters, and their derivatives.

    Errors are innovations: the parts that the noise model doesn't predict from earlier errors, in standard deviations,
    times their robust weights. The three channels follow each other in one row of M.
    """

    error: Array
    """(M,) the errors, less their projection on `begin`: whatever the start and the offsets are, that part remains."""
    slopes: Array
    """(P, M) derivatives by the parameters, with the same projection taken off."""
    begin: Array
    """(7, M) derivatives by the state at the start (4) and by the channels' offsets (3)."""
    full: Array
    """(M,) the errors, nothing taken off."""
    full_slopes: Array
    """(P, M) derivatives by the parameters, nothing taken off."""


class Search:
    """Gauss-Newton search for the parameters of one kind of vehicle, from recorded flights."""

    def __init__(self, recordings: Sequence[Recording], flown: Flown, start: Array, spreads: Array) -> None:
        """Begin at the logarithms `start` (P,), held by a normal prior with standard deviations `spreads`.

        Each recording must begin where its setpoints act.
        """
        self.logs = start
        self._flown, self._start = flown, start
        self._prior: Array = np.diag(spreads**-2.0)
        self._measured = [_Measured.of(each) for each in recordings]
        self._begins = [np.concatenate((each.seen[:, 0], np.zeros(CHANNELS))) for each in recordings]
        self._durations_s = [each.duration_s for each in recordings]
        self._scales = RESOLUTION
        self._coloured = False
        self._predictors: list[Array] = [np.ones(1)] * CHANNELS

    def find(self) -> None:
        """Search for the parameters. Correlated errors count less against the prior, by their effective number.

        The first search takes errors as white: far from the solution, model errors would be taken for noise.
        """
        self._search()
        self._coloured = True
        self._search()

    def refine(self, logs: Array) -> None:
        """Search on from parameters near the solution; the prior's mean stays where it is."""
        self.logs, self._coloured = logs, True
        self._search(NEAR_ENOUGH)

    def _search(self, close: float = CLOSE) -> None:
        for _ in range(ITERATIONS):
            points = self.points(self.logs)
            count = sum(int(each.there.sum()) for each in self._measured)
            lasting = sum(
                _long_run_variance(each, duration_s) for each, duration_s in zip(points, self._durations_s, strict=True)
            )
            worth = 1.0 / max(lasting / count, TINY)
            information = worth * sum(each.slopes @ each.slopes.T for each in points) + self._prior
            pull = worth * sum(each.slopes @ each.error for each in points) + self._prior @ (self.logs - self._start)
            step = np.clip(np.linalg.solve(information, pull), -STEP_MAX, STEP_MAX)
            self.logs = self.logs - step
            for index, each in enumerate(points):
                left = each.full - step @ each.full_slopes
                self._begins[index] = self._begins[index] - np.linalg.lstsq(each.begin.T, left, rcond=None)[0]
            if np.abs(step).max() < close:
                return

    def points(self, logs: Array, *, refit: bool = True) -> list[Point]:
        """Return errors and slopes of each recording at these logarithms; `refit`: fit the model of noise first."""
        tried = [logs, *(logs + NUDGE * each for each in np.eye(len(logs))), *[logs] * BEGINS]
        nudged = np.vstack((np.zeros((1 + len(logs), BEGINS)), np.diag(BEGIN_NUDGES)))
        errors = self._errors(tried, nudged)
        by_begin = errors[1 + len(logs) :]
        if refit and self._coloured:
            units = [each / RESOLUTION[:, None] for each in errors[0]]
            self._predictors = [predictor(self._there(units, channel)) for channel in range(CHANNELS)]
        if refit:
            left = [self._unpredicted(each) for each in errors[0]]
            each_sigma = [_sigma(np.concatenate(self._there(left, channel))) for channel in range(CHANNELS)]
            self._scales = np.maximum(RESOLUTION, each_sigma)
        found = list[Point]()
        for index, seen in enumerate(errors[0]):
            moved = [(each[index] - seen) / NUDGE for each in errors[1 : 1 + len(logs)]]
            begun = [(each[index] - seen) / nudge for each, nudge in zip(by_begin, BEGIN_NUDGES.tolist(), strict=True)]
            offsets = [np.repeat(each[:, None], seen.shape[1], axis=1) for each in np.eye(CHANNELS)]
            each_row = (seen, *moved, *begun, *offsets)
            error, *every = (self._unpredicted(each) / self._scales[:, None] for each in each_row)
            weights = self._counted(index) * np.sqrt(np.minimum(1.0, HUBER / np.maximum(np.abs(error), TINY)))
            full, rows = (error * weights).ravel(), np.stack([(each * weights).ravel() for each in every])
            slopes, basis = rows[: len(logs)], rows[len(logs) :]
            directions = np.linalg.qr(basis[basis.any(axis=1)].T)[0]  # a channel without measurements has none
            without = [each - (each @ directions) @ directions.T for each in (full, slopes)]
            found.append(Point(without[0], without[1], basis, full, slopes))
        return found

    def covariance(self, late: Flown) -> Array:
        """Return the covariance (P, P) of the estimated logarithms, with autocorrelated errors.

        Morelli and Klein, "Accuracy of aerodynamic model parameters estimated from flight test data", Journal of
        Guidance, Control, and Dynamics 20 (1997): the covariance of the score follows from the errors' spectrum.

        Args:
            late: flown with setpoints that act one standard deviation later.
        """
        points = self.points(self.logs)
        information = sum(each.slopes @ each.slopes.T for each in points) + TINY * self._prior
        pulls = sum(
            _score_covariance(each, duration_s) for each, duration_s in zip(points, self._durations_s, strict=True)
        )
        flown, self._flown = self._flown, late
        later = self.points(self.logs, refit=False)
        self._flown = flown
        moved = sum(each.slopes @ (then.full - each.full) for each, then in zip(points, later, strict=True))
        values, directions = np.linalg.eigh(information)
        known = values > MIN_KNOWN * values[-1]  # two equal time constants: the flight determines only their sum
        seen = directions[:, known]
        pulled = seen.T @ (pulls + np.outer(moved, moved)) @ seen + TINY * np.diag(values[known])
        weighed = seen * values[known]
        found = np.linalg.inv(weighed @ np.linalg.inv(pulled) @ weighed.T + self._prior).astype(np.float64)
        white = np.linalg.inv(self._white_information(points) + self._prior).astype(np.float64)
        return widened(found, white)

    def _white_information(self, points: Sequence[Point]) -> Array:
        """Return the information (P, P) of errors that are as large as found, and white."""
        counted = sum(self._counted(index).sum(axis=1) for index in range(len(points)))
        squares = sum((each.error.reshape(CHANNELS, -1) ** 2).sum(axis=1) for each in points)
        weights = 1.0 / np.maximum(squares / np.maximum(counted, 1), MIN_SQUARE)
        each_channel = (each.slopes.reshape(len(self.logs), CHANNELS, -1) for each in points)
        return np.asarray(sum(np.einsum("pcm,qcm,c->pq", each, each, weights) for each in each_channel))

    def _errors(self, tried: Sequence[Array], nudged: Array) -> list[list[Array]]:
        """Return simulated minus measured, (3, K), for each of T sets of logarithms and each recording.

        Simulated flights include their offsets. `nudged` (T, 4) is added to their starting states.
        """
        flown = [self._flown(logs) for logs in tried]
        commanded = [each for of_all, _ in flown for each in of_all]
        models = np.concatenate([np.repeat(model.table, len(self._begins), axis=1) for _, model in flown], axis=1)
        begins = np.concatenate([np.array(self._begins)[:, :BEGINS] + more for more in nudged])
        motions, found = simulated(commanded, AutopilotModels.of(models), begins), list[list[Array]]()
        for first in range(0, len(motions), len(self._begins)):
            each = zip(motions[first : first + len(self._begins)], self._measured, self._begins, strict=True)
            found.append([measured.errors(motion, begin[BEGINS:]) for motion, measured, begin in each])
        return found

    def _there(self, errors: Sequence[Array], channel: int) -> list[Array]:
        """Return each recording's errors of a channel, at its measurements."""
        return [error[channel, of.there[channel]] for error, of in zip(errors, self._measured, strict=True)]

    def _unpredicted(self, errors: Array) -> Array:
        """Return the part of the errors (3, M) that earlier errors don't predict."""
        each = zip(errors, self._predictors, strict=True)
        return np.stack([np.convolve(error, weights)[: error.size] for error, weights in each])

    def _counted(self, index: int) -> Mask:
        """Return which errors (3, M) of a recording count: measured ones with enough before them."""
        there = self._measured[index].there.copy()
        for channel, weights in enumerate(self._predictors):
            there[channel, : weights.size - 1] = False
        return there


def widened(covariance: Array, white: Array) -> Array:
    """Return a covariance (P, P) with no standard deviation below that of `white` errors, its correlations kept.

    A spectrum that is estimated from the errors left by a fit is too low near 0, where the fit has taken them away: of
    17 recordings with white noise, 1.96 deviations by it alone held the heights' two time constants in 15 and 14.
    """
    more = np.sqrt(np.maximum(np.diag(white) / np.maximum(np.diag(covariance), TINY**2), 1.0))
    return covariance * np.outer(more, more)


class _Measured(NamedTuple):
    """Measurements of each channel, (3, M), padded to the same length."""

    point: Indices
    """Grid point before each measurement."""
    part: Array
    """Share of a step after that point."""
    value: Array
    there: Mask
    """False for padding."""

    @classmethod
    def of(cls, recording: Recording) -> _Measured:
        each, last = recording.measured(), recording.seen.shape[1] - 2
        longest = max(len(at) for at, _ in each)
        steps = np.stack([np.pad(at, (0, longest - len(at)), constant_values=-1.0) for at, _ in each])
        value = np.stack([np.pad(value, (0, longest - len(value))) for _, value in each])
        point = np.clip(steps.astype(np.intp), 0, last)
        return cls(point, steps - point, value, steps >= 0.0)

    def errors(self, motion: Array, offsets: Array) -> Array:
        """Return the errors (3, M) of a motion (3, K) with these offsets; 0 for padding."""
        before, after = (np.take_along_axis(motion, self.point + more, axis=1) for more in (0, 1))
        error = (1.0 - self.part) * before + self.part * after + offsets[:, None] - self.value
        error[1] = wrap(error[1])
        return np.where(self.there, error, 0.0)


def predictor(errors: Sequence[Array]) -> Array:
    """Return weights (1 + P,) of an error and the P before it; their sum is what the earlier ones don't predict.

    By the Yule-Walker equations, with the order P that minimises Schwarz's criterion.

    Args:
        errors: of each recording (M,), in time order, in units of `RESOLUTION`; white noise of one unit is added. M may
            be 0.
    """
    count, alike = sum(each.size for each in errors), np.eye(1, ORDER_MAX + 1)[0]
    if not count:
        return np.ones(1)
    for each in (one for one in errors if one.size):
        limit = OUTLYING * _sigma(each)
        kept = np.clip(each - np.median(each), -limit, limit)
        for lag in range(min(ORDER_MAX + 1, kept.size)):
            alike[lag] += kept[lag:] @ kept[: kept.size - lag] / count
    found, smallest = np.ones(1), math.inf
    for order in range(ORDER_MAX + 1):
        weights = np.append(1.0, -solve_toeplitz(alike[:order], alike[1 : order + 1])) if order else np.ones(1)
        criterion = count * math.log(weights @ alike[: order + 1]) + order * math.log(count)
        if criterion < smallest:
            found, smallest = weights, criterion
    return found


def _sigma(errors: Array) -> float:
    """Return the standard deviation of errors, from the median of their sizes; 0 if there are none."""
    return 1.4826 * float(np.median(np.abs(errors))) if errors.size else 0.0


def simulated(commanded: Sequence[Array], models: AutopilotModels, begins: Array) -> list[Array]:
    """Return airspeed, heading and height (3, K) of N flights simulated by setpoints (4, K) alone; K may differ.

    Args:
        commanded: setpoints of speed, heading and height as they act, `STEP_S` apart, and the lateral acceleration of
            turns.
        models: (N,) columns, whose turn rates are changed.
        begins: (N, 4) airspeed, heading, height and climb at the start.
    """
    count, longest = len(commanded), max(each.shape[1] for each in commanded)
    held = np.stack([np.pad(each, ((0, 0), (0, longest - each.shape[1])), mode="edge") for each in commanded], axis=2)
    airspeed, heading, height, climb = begins.T
    none, step_s, turn_rate_max_rps = np.zeros(count), np.full(count, STEP_S), models.turn_rate_max_rps.copy()
    state, flown = FlightStates(none, none, height, climb, airspeed, heading, none, none), np.empty((3, longest, count))
    for point in range(longest):
        flown[:, point] = state.airspeed_mps, state.heading_rad, state.height_m
        lateral_rps = held[3, point] / np.maximum(state.airspeed_mps, MIN_SPEED_MPS)
        models.turn_rate_max_rps[:] = np.minimum(turn_rate_max_rps, lateral_rps)
        state = advance(state, held[:3, point], step_s, models)
    return [flown[:, : each.shape[1], index] for index, each in enumerate(commanded)]


def autocovariance(errors: Array, duration_s: float) -> Array:
    """Return the autocovariance (3, L) of errors (3, K), up to `INDEPENDENT_AFTER_S`, with Bartlett's window."""
    points = errors.shape[1]
    lags = min(round(INDEPENDENT_AFTER_S / duration_s * points), points - 1)
    power = np.abs(np.fft.rfft(errors, 2 * points)) ** 2
    return np.fft.irfft(power, 2 * points)[:, : lags + 1] / points * (1.0 - np.arange(lags + 1) / (lags + 1))


def _long_run_variance(point: Point, duration_s: float) -> float:
    """Return the long-run variance of one recording's errors (spectral density at 0), summed over them."""
    alike = autocovariance(point.error.reshape(CHANNELS, -1), duration_s)
    return float((2.0 * alike.sum(axis=1) - alike[:, 0]).sum()) * point.error.size / CHANNELS


def _score_covariance(point: Point, duration_s: float) -> Array:
    """Return the covariance (P, P) of one recording's score, by the spectrum of each channel's errors."""
    slopes = point.slopes.reshape(len(point.slopes), CHANNELS, -1)
    alike = autocovariance(point.error.reshape(CHANNELS, -1), duration_s)
    size, lags, found = 2 * slopes.shape[2], alike.shape[1] - 1, np.zeros((len(point.slopes), len(point.slopes)))
    for channel, each in enumerate(alike):
        spectrum = np.fft.rfft(np.concatenate((each, np.zeros(size - 2 * lags - 1), each[:0:-1]))).real
        turned = np.fft.rfft(slopes[:, channel], size)
        twice = np.full(turned.shape[1], 2.0)
        twice[0] = twice[-1] = 1.0
        found += ((turned * (np.maximum(spectrum, 0.0) * twice)) @ turned.conj().T).real / size
    return found

"""How telemetry samples are weighted: their noise, the drift of their positions, and implausible values.

White noise of variance r makes successive increments that the model doesn't explain anticorrelated: their covariance is
-r. Gusts, and time constants that differ from the model's, give increments that are uncorrelated or of the same sign,
so they aren't taken for noise (autocovariance method: Bélanger, Automatica 10, 1974).

A sample has eight values: north, east, height, their rates over ground, airspeed, heading. A value within
`IMPLAUSIBLE_SIGMAS` standard deviations of the expected one has full weight; beyond, its noise is increased by the
square of the excess.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from flight_model.autopilot_model import squared, within

Values = tuple[float, float, float, float, float, float, float, float]
"""The values of a sample, or figures for each of them."""
Quantities = tuple[float, float, float, float, float, float]
"""Figures for each of `QUANTITIES`."""
QUANTITIES: Final = ("position", "height", "velocity", "climb", "airspeed", "heading")
"""Quantities with a noise of their own. North and east count as one quantity."""
RESOLUTION = np.array((0.003, 0.001, 0.003, 0.003, 0.0001, 0.00002))
"""Least standard deviations, m, m/s and rad: rounding by 1e-7 degrees, 1 mm and 1 cm/s; the last two are floats."""
UNDECLARED = np.array((0.3, 0.3, 0.1, 0.1, 0.3, 0.01))
"""Initial standard deviations where none are declared, for a real autopilot's estimates. Tuned: m, m, m/s, m/s, m/s,
rad; 0.3 to 3 times these; shown by `pytest tests/gcs_formation/estimation`."""
MAX_POSITION: Final = 30.0 * 30.0
"""Largest variance of positions and heights, m². Tuned: m²; 20² to 50²; shown by `pytest
tests/gcs_formation/estimation`."""
MAX_VELOCITY: Final = 5.0 * 5.0
"""Largest variance of velocities and climbs, (m/s)². Tuned: (m/s)²; 3² to 8²; shown by `pytest
tests/gcs_formation/estimation`."""
MAX_AIRSPEED: Final = 10.0 * 10.0
"""Largest variance of airspeeds, (m/s)². Tuned: (m/s)²; 5² to 15²; shown by `pytest tests/gcs_formation/estimation`."""
MAX_HEADING: Final = 0.5 * 0.5
"""Largest variance of headings, rad². Tuned: rad²; 0.3² to 0.8²; shown by `pytest tests/gcs_formation/estimation`."""
MEMORY: Final = 100.0
"""Number of samples in the mean. Tuned: samples; 50 to 300; shown by `pytest tests/gcs_formation/estimation`."""
FIRST_MEMORY: Final = 20.0
"""Initial weight of the declared noise, in samples. Tuned: samples; 10 to 50; shown by `pytest
tests/gcs_formation/estimation`."""
CLIPPED_AT: Final = 2.0
"""Standard deviations at which increments are clipped, so that an outlier isn't taken for noise. Tuned: standard
deviations; 1.5 to 3; shown by `pytest tests/gcs_formation/estimation`."""
IMPLAUSIBLE_SIGMAS: Final = 3.0
"""Standard deviations beyond which a sample's value has less weight, by the square of the excess. Tuned: standard
deviations; 2.5 to 5; shown by `pytest tests/gcs_formation/estimation`."""
UNKNOWN_MOTION: Final = 1.0
"""Added to their variance, (m/s)²: motion between two samples that the model doesn't know. For positions and heights it
is the square of the interval, in m². Tuned: (m/s)²; 0.5 to 3; shown by `pytest tests/gcs_formation/estimation`."""
UNKNOWN_TURN: Final = 0.1 * 0.1
"""The same for headings, rad². Tuned: rad²; 0.05² to 0.2²; shown by `pytest tests/gcs_formation/estimation`."""
MAX_DRIFT: Final = 0.05 * 0.05
"""Largest variance per second of the drift of positions from integrated velocities, m²: with it, positions are followed
anyway. Tuned: m²/s; 0.02² to 0.1²; shown by `pytest tests/gcs_formation/estimation`."""
DRIFT_S: Final = 3.0
"""Memory of the sum of what positions gain on integrated velocities; an autopilot corrects both more slowly. Tuned: s;
2 to 6; shown by `pytest tests/gcs_formation/estimation`."""
DRIFT_EXCESS: Final = 4.0
"""Positions drift where the mean square of that sum exceeds this many times the one that noise gives. Tuned: a number;
3 to 8; shown by `pytest tests/gcs_formation/estimation`."""
DRIFT_GAP_S: Final = 0.3
"""After a longer interval between samples velocities can't be integrated accurately. Tuned: s; 0.2 to 0.6; by
judgement."""


class VehicleNoise:
    """The variances of one vehicle's telemetry."""

    def __init__(self, declared: Quantities, minimum: Quantities, *, stated: bool = True) -> None:
        """Start from what is declared.

        Args:
            declared: standard deviations.
            minimum: lower bounds of what is estimated, standard deviations.
            stated: whether the scenario declares them, so that the estimate can be compared with them.
        """
        self._declared, self._minimum, self._stated = declared, _squares(minimum), stated
        self.initialise()

    def initialise(self) -> None:
        """Start again from what is declared."""
        self.by_quantity = _squares(self._declared)
        self.values: Values = _by_value(self.by_quantity)
        """Variance of each value of a sample."""
        self._before: Values = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.samples = 0.0

    def sigma(self) -> list[float]:
        """Return the standard deviations, in the order of `QUANTITIES`."""
        return [math.sqrt(each) for each in self.by_quantity]

    def ratios(self) -> list[float]:
        """Return the ratios of noise to that declared; 1 where that is only rounding, and before `MEMORY` samples."""
        if self.samples < MEMORY or not self._stated:
            return [1.0] * len(QUANTITIES)
        each = zip(self.sigma(), self._declared, RESOLUTION.tolist(), strict=True)
        return [sigma / declared if declared > finest else 1.0 for sigma, declared, finest in each]

    def adapt(self, increments: Values, spread: Values) -> None:
        """Update the variances by the increments of a sample's values, and the innovations' variances `spread`.

        An increment, an innovation minus the residual of the sample before, is what the model doesn't explain.
        """
        now, before, known, minimum = (
            _clipped(increments, spread, self.values),
            self._before,
            self.by_quantity,
            self._minimum,
        )
        self._before = now
        self.samples += 1.0
        share = 1.0 / min(self.samples + FIRST_MEMORY, MEMORY)
        position = (0.0 - now[0] * before[0] - now[1] * before[1]) / 2.0
        velocity = (0.0 - now[3] * before[3] - now[4] * before[4]) / 2.0
        self.by_quantity = (
            within(known[0] + share * (position - known[0]), minimum[0], MAX_POSITION),
            within(known[1] + share * (0.0 - now[2] * before[2] - known[1]), minimum[1], MAX_POSITION),
            within(known[2] + share * (velocity - known[2]), minimum[2], MAX_VELOCITY),
            within(known[3] + share * (0.0 - now[5] * before[5] - known[3]), minimum[3], MAX_VELOCITY),
            within(known[4] + share * (0.0 - now[6] * before[6] - known[4]), minimum[4], MAX_AIRSPEED),
            within(known[5] + share * (0.0 - now[7] * before[7] - known[5]), minimum[5], MAX_HEADING),
        )
        self.values = _by_value(self.by_quantity)


def _squares(sigma: Quantities) -> Quantities:
    position, height, velocity, climb, airspeed, heading = sigma
    return squared(position), squared(height), squared(velocity), squared(climb), squared(airspeed), squared(heading)


def _by_value(quantities: Quantities) -> Values:
    """Return each quantity's figure for the values of a sample."""
    position, height, velocity, climb, airspeed, heading = quantities
    return position, position, height, velocity, velocity, climb, airspeed, heading


def _clipped(increments: Values, spread: Values, noise: Values) -> Values:
    """Return increments within `CLIPPED_AT` standard deviations."""
    return (
        _within_sigmas(increments[0], spread[0] + noise[0]),
        _within_sigmas(increments[1], spread[1] + noise[1]),
        _within_sigmas(increments[2], spread[2] + noise[2]),
        _within_sigmas(increments[3], spread[3] + noise[3]),
        _within_sigmas(increments[4], spread[4] + noise[4]),
        _within_sigmas(increments[5], spread[5] + noise[5]),
        _within_sigmas(increments[6], spread[6] + noise[6]),
        _within_sigmas(increments[7], spread[7] + noise[7]),
    )


def _within_sigmas(increment: float, variance: float) -> float:
    bound = CLIPPED_AT * math.sqrt(variance)
    return within(increment, -bound, bound)


class PositionDrift:
    """Drift of a vehicle's positions from the integral of its velocities: an autopilot's filter corrects both.

    What positions gain on integrated velocities from sample to sample is summed. A drift adds up in the sum. Noise of
    positions cancels from one sample to the next; noise of velocities adds up, but is known.
    """

    def __init__(self) -> None:
        """Start without drift."""
        self._values: Values = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._samples = self._north_m = self._east_m = self._square = 0.0
        self.variance = 0.0
        """Variance of the drift per second, m²."""

    def initialise(self, values: Values) -> None:
        """Restart the sums from a sample; the estimated variance is kept."""
        self._values = values
        self._north_m = self._east_m = 0.0

    def adapt(self, values: Values, elapsed_s: float, noise: Values) -> None:
        """Take the next sample and the variances of its values."""
        before = self._values
        if not 0.0 < elapsed_s < DRIFT_GAP_S:
            self.initialise(values)
            return
        half_s = elapsed_s / 2.0 * _arc_ratio(before[3], before[4], values[3], values[4])
        bound_m = CLIPPED_AT * math.sqrt(2.0 * noise[0] + MAX_DRIFT * elapsed_s)
        north_m = within(values[0] - before[0] - (values[3] + before[3]) * half_s, -bound_m, bound_m)
        east_m = within(values[1] - before[1] - (values[4] + before[4]) * half_s, -bound_m, bound_m)
        kept = 1.0 - elapsed_s / DRIFT_S
        self._north_m, self._east_m = kept * self._north_m + north_m, kept * self._east_m + east_m
        self._samples += 1.0
        square = (squared(self._north_m) + squared(self._east_m)) / 2.0
        self._square += (square - self._square) / min(self._samples + FIRST_MEMORY, MEMORY)
        by_noise = noise[0] + noise[3] * elapsed_s * DRIFT_S / 2.0
        self.variance = within(2.0 / DRIFT_S * (self._square - DRIFT_EXCESS * by_noise), 0.0, MAX_DRIFT)
        self._values = values


def _arc_ratio(north_mps: float, east_mps: float, later_north_mps: float, later_east_mps: float) -> float:
    """Return an arc's chord by the mean of the velocities at its ends: tan x / x, where x is half the angle turned."""
    cross = north_mps * later_east_mps - east_mps * later_north_mps
    before, later = squared(north_mps) + squared(east_mps), squared(later_north_mps) + squared(later_east_mps)
    return 1.0 + squared(cross) / (12.0 * max(before * later, 1.0))


def excesses(difference: Values, own: Values, elapsed_s: float) -> Values:
    """Return the squared excess of each of a sample's values over the plausible deviation; 1 for plausible values.

    `difference`: the innovations, which have the variances `own`.
    """
    position = squared(elapsed_s)
    return (
        _excess(difference[0], own[0], position),
        _excess(difference[1], own[1], position),
        _excess(difference[2], own[2], position),
        _excess(difference[3], own[3], UNKNOWN_MOTION),
        _excess(difference[4], own[4], UNKNOWN_MOTION),
        _excess(difference[5], own[5], UNKNOWN_MOTION),
        _excess(difference[6], own[6], UNKNOWN_MOTION),
        _excess(difference[7], own[7], UNKNOWN_TURN),
    )


def _excess(difference: float, own: float, unknown: float) -> float:
    excess = squared(difference) / (IMPLAUSIBLE_SIGMAS**2 * (own + unknown))
    return excess if excess > 1.0 else 1.0


def plausible(excess: Values) -> bool:
    """Return whether all of a sample's values are plausible."""
    a, b, c, d, e, f, g, h = excess
    return a == b == c == d == e == f == g == h == 1.0


def weighed(variances: Values, own: Values, excess: Values) -> Values:
    """Return the noise variances by which a sample's values are weighted.

    A value that exceeds the plausible deviation u times gets a noise that makes its innovation's variance u² times as
    large.
    """
    return (
        variances[0] + own[0] * (excess[0] - 1.0),
        variances[1] + own[1] * (excess[1] - 1.0),
        variances[2] + own[2] * (excess[2] - 1.0),
        variances[3] + own[3] * (excess[3] - 1.0),
        variances[4] + own[4] * (excess[4] - 1.0),
        variances[5] + own[5] * (excess[5] - 1.0),
        variances[6] + own[6] * (excess[6] - 1.0),
        variances[7] + own[7] * (excess[7] - 1.0),
    )

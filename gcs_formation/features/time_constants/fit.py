# Compiled by mypyc: it runs every tick.

"""Fits a vehicle's time constants to its telemetry, from simulations by several models (7)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from librt.vecs import vec

from flight_model.autopilot_model import squared, within
from gcs_formation.features.time_constants.model_set import ResidualBatch

RATIO_MAX: Final = 2.0
"""Fitted time constants are between the declared one divided by this and multiplied by it. Tuned: ratio; 1.5 to 3;
shown by `pytest tests/gcs_formation/features/time_constants`."""
BOUND: Final = math.log(RATIO_MAX)
PRIOR_SPREAD: Final = 0.35
"""Prior standard deviation of the logarithm of a time constant's ratio to the declared one: 40 %. Tuned: a number; 0.2
to 0.7; shown by `python -m benchmarks.model_draws`."""
PRIOR_INFORMATION: Final = 1.0 / PRIOR_SPREAD**2
CORRELATED_S: Final = 1.0
"""Residuals this far apart count as independent, unless they are found to be correlated for longer. Tuned: s; 0.5 to 3;
by judgement."""
BATCH_S: Final = 1.0
"""Interval between fits. Tuned: s; 0.5 to 3; by judgement."""
ALIKE_S: Final = 60.0
"""Time constant of the memory of `Persistence`. Tuned: s; 30 to 180; by judgement."""
STILL_ALIKE: Final = math.exp(-BATCH_S / ALIKE_S)
PRIOR_BATCHES: Final = 6.0
"""Prior number of successive batches whose residuals are correlated. Also the largest number that the mismatch uses:
residuals that are correlated for longer may come from wrong time constants. Tuned: batches; 3 to 12; shown by `pytest
tests/gcs_formation/features/time_constants`."""
PRIOR_WORTH: Final = 5.0
"""Weight of that prior, in pairs of batches. Tuned: pairs; 2 to 10; by judgement."""
STEP_MAX: Final = 0.1
"""Largest change of a ratio's logarithm at a fit. Tuned: a number; 0.05 to 0.2; by judgement."""
SETTLED: Final = 1e-3
"""After a fit that changes a ratio's logarithm by less, the next one waits for a batch with excitation. Tuned: a
number; 1e-4 to 1e-2; by judgement."""
MIN_SPREAD: Final = 0.02
"""Old samples are forgotten once a ratio's logarithm has a smaller standard deviation, since time constants may change.
Without excitation nothing is estimated and nothing forgotten. Tuned: a number; 0.01 to 0.05; by judgement."""
RECENT_S: Final = 20.0
"""Time constant of the mismatch's memory. Tuned: s; 10 to 60; by judgement."""
STILL_RECENT: Final = math.exp(-BATCH_S / RECENT_S)
FITTED: Final = 2.0
"""Degrees of freedom of the residuals that the mismatch's own fit uses, for a mean and a share."""
SIGNIFICANT: Final = 2.0
"""Standard deviations by which the mismatch is reduced, so that chance doesn't count. Tuned: standard deviations; 1.5
to 3; shown by `pytest tests/gcs_formation/features/time_constants`."""


class Nodes:
    """Interpolation between simulations: n Chebyshev points of [-BOUND, BOUND] for each of P parameters, 1 or 2."""

    def __init__(self, count: int, parameters: int) -> None:
        """Take the number n of points and the number P of parameters."""
        points = [BOUND * math.cos((2 * place + 1) * math.pi / (2 * count)) for place in range(count)]
        self.parameters = parameters
        self.at = [[one] for one in points] if parameters == 1 else [[one, two] for one in points for two in points]
        """(K, P) logarithms of the simulations' ratios; K is n to the power of P."""
        terms: list[list[float]] = np.linalg.inv(np.vander(points)).T.tolist()
        self._terms = vec[vec[float]]([vec[float](each) for each in terms])
        """(n, n) coefficients, the highest power's first, of the polynomials that are 1 at one point, 0 at the rest."""

    def weights(self, log_ratio: list[float]) -> vec[vec[float]]:
        """Return (P + 1, K): the weights of the simulations at `log_ratio` (P), and their derivatives."""
        first, by_first = self._one_parameter(log_ratio[0])
        if self.parameters == 1:
            return vec[vec[float]]([first, by_first])
        second, by_second = self._one_parameter(log_ratio[1])
        return vec[vec[float]]([_outer(first, second), _outer(by_first, second), _outer(first, by_second)])

    def _one_parameter(self, log_ratio: float) -> tuple[vec[float], vec[float]]:
        """Return the weights (n) for one parameter, and their derivatives."""
        size = len(self._terms)
        weights, slopes = vec[float]([0.0] * size), vec[float]([0.0] * size)
        for point in range(size):
            weight = slope = 0.0
            for term in self._terms[point]:
                slope = slope * log_ratio + weight
                weight = weight * log_ratio + term
            weights[point], slopes[point] = weight, slope
        return weights, slopes


class Persistence:
    """For how many batches residuals stay correlated: turbulence moves a vehicle for longer than a batch.

    From von Neumann's ratio of successive batches' means: rho = 1 - steps / (2 size), both sums of squares.
    """

    def __init__(self, resolution: float) -> None:
        """Begin with independent residuals of the size of `resolution`."""
        self._before: float = math.nan
        self._count: float = 0.0
        self._mean: float = 0.0
        self._size: float = squared(resolution)
        self._steps: float = 2.0 * self._size

    def add_batch(self, mean: float) -> None:
        """Take the mean of a batch's residuals; NaN where it has none."""
        if not math.isnan(mean - self._before):
            self._count = STILL_ALIKE * self._count + 1.0
            off = mean - self._mean
            self._mean += off / self._count
            self._size = STILL_ALIKE * self._size + off * (mean - self._mean)
            self._steps = STILL_ALIKE * self._steps + squared(mean - self._before)
        self._before = mean

    @property
    def variance(self) -> float:
        """Variance of batches' means: at first that of the resolution, which counts as one batch."""
        return self._size / (self._count + 1.0)

    @property
    def batches(self) -> float:
        """Number of successive batches with the information of one of independent residuals: (1 + rho) / (1 - rho)."""
        seen = max(1.0, 4.0 * self._size / self._steps - 1.0)
        return (PRIOR_WORTH * PRIOR_BATCHES + self._count * seen) / (PRIOR_WORTH + self._count)


class TimeConstantFit:
    """The fit of the P time constants of a vehicle's airspeed, heading or height."""

    def __init__(self, nodes: Nodes, resolution: float, finest: float, rate_hz: float, *, in_use: bool) -> None:
        """Start with the declared time constants.

        Args:
            nodes: the simulations' interpolation.
            resolution: standard deviation assumed of residuals before any were seen.
            finest: the least that they may turn out to have.
            rate_hz: of the telemetry.
            in_use: whether the model has the fitted time constants, not the declared ones.
        """
        self.log_ratio = [0.0] * nodes.parameters
        """(P) logarithms of the fitted time constants' ratios to the declared ones."""
        self.misfit = 0.0
        """Relative difference of recently flown time constants from those in use, beyond chance."""
        self._nodes, self._in_use = nodes, in_use
        self._min_variance, self._finest_variance = resolution**2, finest**2
        self._alike = max(1.0, CORRELATED_S * rate_hz)
        self._kept = 1.0
        """Factor by which the sums are scaled before the next batch is added: forgetting."""
        self._settled = True
        """Whether the last fit changed less than `SETTLED`."""
        self._weights = nodes.weights(self.log_ratio)
        """Weights of the simulations at the time constants in use, and their derivatives."""
        self._persistence = Persistence(resolution)
        self._all, self._recent = _zeros(len(nodes.at) + 1), _zeros(len(nodes.at) + 1)
        """(K + 1, K + 1) sums of products over all samples, and over recent ones, of batches with excitation, up to the
        diagonal: products of the K simulations minus telemetry, and of 1."""
        self._still_recent = 1.0
        """Factor by which the recent sums are yet to be scaled."""
        self._shown = _zeros(nodes.parameters + 2)
        """(P + 2, P + 2) likewise over recent samples: of residuals of the time constants in use, their derivatives,
        and 1."""
        self._calm_square = self._calm_total = self._calm_count = 0.0
        """Sums over recent samples of batches without excitation: of residuals squared, of residuals, and of 1."""

    def update(self, tracks: ResidualBatch) -> bool:
        """Take a batch of samples; refit if it has excitation or time constants still change, and return whether.

        Without excitation all simulations agree; the samples then only show how large and how correlated residuals are.
        """
        excited = tracks.excited(math.sqrt(self._noise_variance()))
        fits = excited or not self._settled
        self._age()
        if excited:
            self._add(tracks)
        if fits:
            weights = self._nodes.weights(self.log_ratio)
            seen = _centred(_projected(self._all, weights))
            step = self._least_squares_step(seen)
            self._take(tracks, _weights_near(weights, step), calm=not excited)
            self._fit(seen, self._persistence.batches * _residual_square(seen, step) / _count(self._all))
            self._shown = _projected(self._recent, self._weights)
            _scale(self._shown, self._still_recent)
        else:
            self._take(tracks, self._weights[0], calm=True)
        self._judge()
        return fits

    def _age(self) -> None:
        """Apply one batch's forgetting to the recent sums."""
        self._still_recent *= STILL_RECENT
        _scale(self._shown, STILL_RECENT)
        self._calm_square *= STILL_RECENT
        self._calm_total *= STILL_RECENT
        self._calm_count *= STILL_RECENT

    def _add(self, tracks: ResidualBatch) -> None:
        """Add a batch with excitation to the sums."""
        _scale(self._all, self._kept)
        _scale(self._recent, self._still_recent)
        self._still_recent = 1.0
        for sample in range(tracks.count):
            _add(tracks.rows[sample], self._all, self._recent)

    def _take(self, tracks: ResidualBatch, weights: vec[float], *, calm: bool) -> None:
        """Take a batch's residuals, given the weights of the simulations; `calm`: without excitation."""
        square = total = 0.0
        for sample in range(tracks.count):
            residual = _dot(weights, tracks.rows[sample])
            square += residual * residual
            total += residual
        count = float(tracks.count)
        self._persistence.add_batch(total / count if count > 0.0 else math.nan)
        if calm:
            self._calm_square += square
            self._calm_total += total
            self._calm_count += count

    def _noise_variance(self) -> float:
        """Return the residuals' variance that isn't the time constants': less than at first once batches show less."""
        return within(self._persistence.variance, self._finest_variance, self._min_variance)

    def _least_squares_step(self, seen: vec[vec[float]]) -> list[float]:
        """Return the step of the log ratios that minimises the residuals `seen`, regularised by the prior."""
        found = [0.0 for _ in self.log_ratio]
        held = PRIOR_INFORMATION * self._noise_variance() * self._alike
        for place, row in enumerate(_inverse_with(_information(seen, 1.0), held)):
            for other, each in enumerate(row):
                found[place] -= each * seen[1 + other][0]
        return found

    def _fit(self, seen: vec[vec[float]], variance: float) -> None:
        """Make a Gauss-Newton step towards the most likely time constants, and set how much is forgotten.

        Args:
            seen: products of the residuals at the present ratios, and of their derivatives, about their means.
            variance: of the residuals that no time constants explain, times the number of correlated batches.
        """
        log_ratio, maximum, change = self.log_ratio, 1.0, 0.0
        worth = 1.0 / ((variance + self._noise_variance()) * self._alike)
        information = _information(seen, worth)
        pull = [-seen[1 + place][0] * worth - each * PRIOR_INFORMATION for place, each in enumerate(log_ratio)]
        for place, row in enumerate(_inverse_with(information, PRIOR_INFORMATION)):
            wanted, before = 0.0, log_ratio[place]
            for other, each in enumerate(row):
                wanted += each * pull[other]
            log_ratio[place] = within(before + within(wanted, -STEP_MAX, STEP_MAX), -BOUND, BOUND)
            change = max(change, abs(log_ratio[place] - before))
            maximum = max(maximum, information[place][place])
        self._kept = min(1.0, 1.0 / (MIN_SPREAD**2 * maximum))
        self._settled = change < SETTLED
        if self._in_use:
            self._weights = self._nodes.weights(log_ratio)

    def _judge(self) -> None:
        """Estimate the model mismatch: the common relative difference of time constants in use and flown recently.

        The number of independent residuals is that of samples with excitation, divided by the correlation time, less
        `FITTED`. Calm flight doesn't add to it: a gust and the law's response to it are one event, however long the
        flight. With none left the mismatch is 0. It is limited to the range of the simulations.
        """
        sums, last = self._shown, len(self._shown) - 1
        samples = max(sums[last][last] + self._calm_count, 1.0)
        total, slopes = sums[last][0] + self._calm_total, 0.0
        shown = by_all = 0.0
        for one in range(1, last):
            slopes += sums[last][one]
            shown += sums[one][0]
            for other in range(1, last):
                by_all += sums[max(one, other)][min(one, other)]
        shown -= slopes * total / samples
        excitation = max(by_all - squared(slopes) / samples, 1e-12)
        size = sums[0][0] + self._calm_square - squared(total) / samples
        free = sums[last][last] / (self._alike * min(self._persistence.batches, PRIOR_BATCHES)) - FITTED
        if free <= 0.0:
            self.misfit = 0.0
            return
        left = max(size - squared(shown) / excitation, 0.0) / (self._alike * free)
        chance = math.sqrt((left + self._min_variance) * self._alike / excitation)
        self.misfit = within(abs(shown) / excitation - SIGNIFICANT * chance, 0.0, RATIO_MAX - 1.0)


def _zeros(size: int) -> vec[vec[float]]:
    """Return a symmetric matrix of zeros, rows up to the diagonal."""
    return vec[vec[float]]([vec[float]([0.0] * (row + 1)) for row in range(size)])


def _dot(one: vec[float], other: vec[float]) -> float:
    """Return the scalar product of a list with the first numbers of another."""
    total = 0.0
    for place in range(len(one)):
        total += one[place] * other[place]
    return total


def _scale(sums: vec[vec[float]], share: float) -> None:
    """Scale all sums by a share: exponential forgetting."""
    for row in sums:
        for place in range(len(row)):
            row[place] = row[place] * share


def _add(row: vec[float], sums: vec[vec[float]], others: vec[vec[float]]) -> None:
    """Add the products of every two numbers of a row to `sums` and to `others`."""
    for one in range(len(row)):
        value, to, to_other = row[one], sums[one], others[one]
        for other in range(one + 1):
            product = value * row[other]
            to[other] = to[other] + product
            to_other[other] = to_other[other] + product


def _count(sums: vec[vec[float]]) -> float:
    """Return the number of samples in the sums, 1 at least."""
    end = len(sums) - 1
    return max(sums[end][end], 1.0)


def _projected(sums: vec[vec[float]], weights: vec[vec[float]]) -> vec[vec[float]]:
    """Return the sums of products of P + 1 weighted means of the simulations, and of 1, from those of simulations."""
    totals, found, end = sums[len(sums) - 1], _zeros(len(weights) + 1), len(weights)
    for one in range(end):
        along = _products_with_mean(sums, weights[one])
        for other in range(one + 1):
            found[one][other] = _dot(weights[other], along)
        found[end][one] = _dot(weights[one], totals)
    found[end][end] = totals[len(totals) - 1]
    return found


def _products_with_mean(sums: vec[vec[float]], weights: vec[float]) -> vec[float]:
    """Return the sums of products (K) of the simulations' weighted mean with each of them."""
    along = vec[float]([0.0] * len(weights))
    for one in range(len(weights)):
        row, weight, product = sums[one], weights[one], 0.0
        for other in range(one):
            product += row[other] * weights[other]
            along[other] = along[other] + row[other] * weight
        along[one] = product + row[one] * weight
    return along


def _centred(sums: vec[vec[float]]) -> vec[vec[float]]:
    """Change the sums of products, except those with 1, to ones about the means, and return them."""
    end, count = len(sums) - 1, _count(sums)
    totals = sums[end]
    for one in range(end):
        for other in range(one + 1):
            sums[one][other] = sums[one][other] - totals[one] * totals[other] / count
    return sums


def _weights_near(weights: vec[vec[float]], by: list[float]) -> vec[float]:
    """Return the weights (K) of the simulations after a step `by` of the log ratios, to first order."""
    moved = vec[float]([0.0] * len(weights[0]))
    for node in range(len(moved)):
        weight = weights[0][node]
        for place, each in enumerate(by):
            weight += each * weights[1 + place][node]
        moved[node] = weight
    return moved


def _information(seen: vec[vec[float]], worth: float) -> list[list[float]]:
    """Return the products (P, P) of the derivatives with each other, times `worth`."""
    first = seen[1][1] * worth
    if len(seen) == 3:
        return [[first]]
    cross = seen[2][1] * worth
    return [[first, cross], [cross, seen[2][2] * worth]]


def _residual_square(seen: vec[vec[float]], by: list[float]) -> float:
    """Return the sum of squared residuals about their mean after a step `by` of the log ratios, to first order."""
    left, information = seen[0][0], _information(seen, 1.0)
    for one, each in enumerate(by):
        left += 2.0 * each * seen[1 + one][0]
        for other, another in enumerate(by):
            left += each * another * information[one][other]
    return max(left, 0.0)


def _outer(rows: vec[float], columns: vec[float]) -> vec[float]:
    """Return all products of two lists' numbers, those of the first of `rows` first."""
    return vec[float]([row * column for row in rows for column in columns])


def _inverse_with(matrix: list[list[float]], diagonal: float) -> list[list[float]]:
    """Return the inverse of a symmetric matrix, 1 by 1 or 2 by 2, with `diagonal` added to its diagonal."""
    first = matrix[0][0] + diagonal
    if len(matrix) == 1:
        return [[1.0 / first]]
    second, cross = matrix[1][1] + diagonal, matrix[0][1]
    determinant = first * second - cross * cross
    return [[second / determinant, -cross / determinant], [-cross / determinant, first / determinant]]

"""The lags that fit a vehicle's telemetry, from simulations of it by models (7) of several lags: `lags` says when."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from librt.vecs import vec

from flight_model.autopilot import squared, within

RATIO_MAX: Final = 2.0
"""A lag is found between the believed one divided and multiplied by this."""
BOUND: Final = math.log(RATIO_MAX)
BELIEVED_SPREAD: Final = 0.35
"""Standard deviation of the logarithm of a lag's ratio before anything is learnt: 40 %."""
BELIEF: Final = 1.0 / BELIEVED_SPREAD**2
CORRELATED_S: Final = 1.0
"""Residuals this far apart count as independent, unless they are seen to stay alike for longer."""
BATCH_S: Final = 1.0
"""How often lags are fitted."""
ALIKE_S: Final = 60.0
"""Memory of how long they do."""
STILL_ALIKE: Final = math.exp(-BATCH_S / ALIKE_S)
GUST_ALIKE: Final = 6.0
"""Batches that tell as much as one, before it is seen how many. The misfit counts no more: what stays alike for longer
may be lags that are far off."""
GUST_WORTH: Final = 5.0
"""As many pairs of batches as the belief in that is worth."""
STEP_MAX: Final = 0.1
"""Largest change of a ratio's logarithm at a fit."""
LEAST_SPREAD: Final = 0.02
"""What was seen first is forgotten once the ratio is known better than this: lags may change. Without excitation
nothing is learnt, and nothing forgotten."""
RECENT_S: Final = 20.0
"""Memory of the misfit."""
STILL_RECENT: Final = math.exp(-BATCH_S / RECENT_S)
"""What it keeps from one fit to the next."""
FITTED: Final = 2.0
"""Independent residuals that a mean and a share take up which are fitted to them."""
LEAST_FREE: Final = 0.1
"""That are left then, at least."""
SIGNIFICANT: Final = 2.0
"""Standard deviations of the misfit that don't count."""


class Tracks:
    """A vehicle's batch of samples of a channel: K simulations minus telemetry, and 1; all 0: there is no sample."""

    __slots__ = ("rows",)

    def __init__(self, simulations: int, samples: int) -> None:
        """Take K and B, without a sample."""
        self.rows = zeros(simulations + 1, samples)
        """(K + 1, B)."""

    def clear(self) -> None:
        """Take the samples away."""
        for row in self.rows:
            for sample in range(len(row)):
                row[sample] = 0.0

    def excited(self, resolution: float) -> bool:
        """Return whether the simulations differ by more than a resolution: the first from the last."""
        first, last, most = self.rows[0], self.rows[len(self.rows) - 2], 0.0
        for sample in range(len(first)):
            most = max(most, abs(first[sample] - last[sample]))
        return most > resolution


class Nodes:
    """Interpolation between simulations: n Chebyshev points of [-BOUND, BOUND] for each of P parameters, 1 or 2."""

    def __init__(self, count: int, parameters: int) -> None:
        """Take n and P."""
        points = [BOUND * math.cos((2 * place + 1) * math.pi / (2 * count)) for place in range(count)]
        self.parameters = parameters
        self.at = [[one] for one in points] if parameters == 1 else [[one, two] for one in points for two in points]
        """(K, P) logarithms of the simulations' ratios; K is n to the power of P."""
        terms: list[list[float]] = np.linalg.inv(np.vander(points)).T.tolist()
        self._terms = vec[vec[float]]([vec[float](each) for each in terms])
        """(n, n) coefficients, the highest power's first, of the polynomials that are 1 at one point, 0 at the rest."""

    def weights(self, log_ratio: list[float]) -> vec[vec[float]]:
        """Return (P + 1, K): the weights of the simulations at `log_ratio` (P), and their derivatives."""
        first, by_first = self._of_one(log_ratio[0])
        if self.parameters == 1:
            return vec[vec[float]]([first, by_first])
        second, by_second = self._of_one(log_ratio[1])
        return vec[vec[float]]([_each(first, second), _each(by_first, second), _each(first, by_second)])

    def _of_one(self, log_ratio: float) -> tuple[vec[float], vec[float]]:
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
    """How long residuals stay alike: turbulence moves a vehicle for longer than a batch, and tells nothing of lags.

    By von Neumann's ratio of the means of batch after batch: rho = 1 - steps / (2 size), of squares.
    """

    __slots__ = ("_before", "_count", "_mean", "_size", "_steps")

    def __init__(self, resolution: float) -> None:
        """Begin with residuals that are independent, and no larger than a `resolution`."""
        self._before: float = math.nan
        self._count: float = 0.0
        self._mean: float = 0.0
        self._size: float = squared(resolution)
        self._steps: float = 2.0 * self._size

    def take(self, mean: float) -> None:
        """Take the mean of a batch's residuals; NaN where it has none."""
        if not math.isnan(mean - self._before):
            self._count = STILL_ALIKE * self._count + 1.0
            off = mean - self._mean
            self._mean += off / self._count
            self._size = STILL_ALIKE * self._size + off * (mean - self._mean)
            self._steps = STILL_ALIKE * self._steps + squared(mean - self._before)
        self._before = mean

    @property
    def batches(self) -> float:
        """How many batches in a row tell no more than one of independent residuals: (1 + rho) / (1 - rho)."""
        seen = max(1.0, 4.0 * self._size / self._steps - 1.0)
        return (GUST_WORTH * GUST_ALIKE + self._count * seen) / (GUST_WORTH + self._count)


class Channel:
    """Airspeed, heading or height of all vehicles: what was seen, and the P lags that fit it."""

    def __init__(self, nodes: Nodes, columns: int, resolution: float, rate_hz: float, *, in_use: bool) -> None:
        """Start with the believed lags.

        `rate_hz` is that of the telemetry; `in_use`: whether the lags found are, not the believed ones.
        """
        self.nodes = nodes
        self.log_ratio = [[0.0] * nodes.parameters for _ in range(columns)]
        """(C, P) of the lags to the believed ones."""
        self.spread = [[BELIEVED_SPREAD] * nodes.parameters for _ in range(columns)]
        """(C, P) standard deviations of these."""
        self.misfit = [0.0] * columns
        """(C) share by which lags seem to differ from those in use, beyond chance, in what was flown last."""
        self._resolution, self._in_use = resolution, in_use
        self._least_variance = resolution**2
        self._alike = max(1.0, CORRELATED_S * rate_hz)
        self._kept = [1.0] * columns
        """Share of what was seen that counts from now on."""
        self._believed = nodes.weights([0.0] * nodes.parameters)
        """Weights of the simulations at the believed lags."""
        self._persistence = [Persistence(resolution) for _ in range(columns)]
        self._found = zeros(nodes.parameters + 1, nodes.parameters + 1)
        self._all = [_triangle(len(nodes.at) + 1) for _ in range(columns)]
        self._recent = [_triangle(len(nodes.at) + 1) for _ in range(columns)]
        """(C, K + 1, K + 1) sums of products over all samples that count, and over recent ones, up to the diagonal: of
        K simulations minus telemetry, and of 1."""

    def learn(self, batch: list[Tracks]) -> None:
        """Take the vehicles' samples and fit the lags anew."""
        for column, tracks in enumerate(batch):
            of_all, of_recent = self._all[column], self._recent[column]
            _forget(of_all, self._kept[column])
            _forget(of_recent, STILL_RECENT)
            _add(tracks.rows, of_recent, of_all, both=tracks.excited(self._resolution))
            weights, samples = self.nodes.weights(self.log_ratio[column]), _count(of_all)
            seen = self._products(of_all, weights)
            nearer = self._nearer(seen)
            persistence = self._persistence[column]
            persistence.take(_mean(tracks.rows, _moved(weights, nearer)))
            self._fit(column, seen, persistence.batches * _left(seen, nearer) / samples)
            in_use = weights if self._in_use else self._believed
            recent = self._products(of_recent, in_use)
            self.misfit[column] = self._misfit(recent, _count(of_recent), min(persistence.batches, GUST_ALIKE))

    def _products(self, sums: vec[vec[float]], weights: vec[vec[float]]) -> vec[vec[float]]:
        """Return, until the next call, (P + 1, P + 1) products of each two weighted means about their own means."""
        totals, count, products = sums[len(sums) - 1], _count(sums), self._found
        for one in range(len(weights)):
            along = _about_mean(sums, weights[one], _dot(weights[one], totals) / count)
            for other in range(one + 1):
                products[one][other] = products[other][one] = _dot(weights[other], along)
        return products

    def _nearer(self, seen: vec[vec[float]]) -> list[float]:
        """Return by how much other ratios would come nearest to what was `seen`, as far as it stands out."""
        parameters = range(self.nodes.parameters)
        information = [[seen[1 + one][1 + other] for other in parameters] for one in parameters]
        found = [0.0 for _ in parameters]
        for place, row in enumerate(_inverse_with(information, BELIEF * self._least_variance * self._alike)):
            for other, each in enumerate(row):
                found[place] -= each * seen[1 + other][0]
        return found

    def _fit(self, column: int, seen: vec[vec[float]], variance: float) -> None:
        """Make a Gauss-Newton step towards the most likely lags, and forget what is more than enough.

        Args:
            column: whose.
            seen: the products of the simulation with its lags, and of its derivatives, about their means.
            variance: of what no lags would explain, so often as it stays alike.
        """
        log_ratio, spread, count, most = self.log_ratio[column], self.spread[column], self.nodes.parameters, 1.0
        worth = 1.0 / ((variance + self._least_variance) * self._alike)
        information = [[seen[1 + one][1 + other] * worth for other in range(count)] for one in range(count)]
        pull = [-seen[1 + place][0] * worth - log_ratio[place] * BELIEF for place in range(count)]
        for place, row in enumerate(_inverse_with(information, BELIEF)):
            wanted = 0.0
            for other, each in enumerate(row):
                wanted += each * pull[other]
            log_ratio[place] = within(log_ratio[place] + within(wanted, -STEP_MAX, STEP_MAX), -BOUND, BOUND)
            spread[place] = math.sqrt(row[place])
            most = max(most, information[place][place])
        self._kept[column] = min(1.0, 1.0 / (LEAST_SPREAD**2 * most))

    def _misfit(self, seen: vec[vec[float]], samples: float, batches: float) -> float:
        """Return by what common share the lags in use, those of `seen`, differ from those of what was flown last.

        So many `batches` tell no more than one of independent residuals. Few of these, less a mean and a share that
        were fitted to them, tell little of how large they are.
        """
        by_all = shown = 0.0
        for one in range(1, len(seen)):
            shown += seen[one][0]
            for other in range(1, len(seen)):
                by_all += seen[one][other]
        excitation = max(by_all, 1e-12)
        free = max(samples / (self._alike * batches) - FITTED, LEAST_FREE)
        left = max(seen[0][0] - squared(shown) / excitation, 0.0) / (self._alike * free)
        chance = math.sqrt((left + self._least_variance) * self._alike / excitation)
        return max(0.0, abs(shown) / excitation - SIGNIFICANT * chance)


def zeros(rows: int, columns: int) -> vec[vec[float]]:
    """Return a matrix of zeros."""
    return vec[vec[float]]([vec[float]([0.0] * columns) for _ in range(rows)])


def _triangle(size: int) -> vec[vec[float]]:
    """Return a symmetric matrix of zeros: of each row what is up to the diagonal."""
    return vec[vec[float]]([vec[float]([0.0] * (row + 1)) for row in range(size)])


def _dot(one: vec[float], other: vec[float]) -> float:
    """Return the product of two lists' numbers, as many as the first has."""
    total = 0.0
    for place in range(len(one)):
        total += one[place] * other[place]
    return total


def _moved(weights: vec[vec[float]], by: list[float]) -> vec[float]:
    """Return the weights (K) of the simulations at ratios that are moved, from weights and their derivatives."""
    moved = vec[float]([0.0] * len(weights[0]))
    for node in range(len(moved)):
        weight = weights[0][node]
        for place, each in enumerate(by):
            weight += each * weights[1 + place][node]
        moved[node] = weight
    return moved


def _left(seen: vec[vec[float]], by: list[float]) -> float:
    """Return the simulation's product with itself, about its mean, at ratios that are moved."""
    left = seen[0][0]
    for one, each in enumerate(by):
        left += 2.0 * each * seen[1 + one][0]
        for other, another in enumerate(by):
            left += each * another * seen[1 + one][1 + other]
    return max(left, 0.0)


def _mean(rows: vec[vec[float]], weights: vec[float]) -> float:
    """Return the weighted mean of a batch's simulations minus telemetry, over its samples; NaN where it has none."""
    samples = rows[len(weights)]
    count = _dot(samples, samples)
    if count == 0.0:
        return math.nan
    total = 0.0
    for node in range(len(weights)):
        total += weights[node] * _dot(rows[node], samples)
    return total / count


def _each(rows: vec[float], columns: vec[float]) -> vec[float]:
    """Return all products of two lists' numbers, those of the first of `rows` first."""
    return vec[float]([row * column for row in rows for column in columns])


def _forget(sums: vec[vec[float]], kept: float) -> None:
    for row in sums:
        for place in range(len(row)):
            row[place] = row[place] * kept


def _add(rows: vec[vec[float]], sums: vec[vec[float]], others: vec[vec[float]], *, both: bool) -> None:
    """Add the products of each two rows of a batch to sums, and to others if to `both`."""
    for one in range(len(rows)):
        row, to, to_other = rows[one], sums[one], others[one]
        for other in range(one + 1):
            product = _dot(row, rows[other])
            to[other] = to[other] + product
            if both:
                to_other[other] = to_other[other] + product


def _count(sums: vec[vec[float]]) -> float:
    """Return how many samples they are of, 1 at least."""
    end = len(sums) - 1
    return max(sums[end][end], 1.0)


def _about_mean(sums: vec[vec[float]], weights: vec[float], mean: float) -> vec[float]:
    """Return the products (K) of the simulations' weighted mean, minus its own `mean`, with each of them."""
    totals = sums[len(weights)]
    along = vec[float]([0.0] * len(weights))
    for one in range(len(weights)):
        row, weight, product = sums[one], weights[one], 0.0
        for other in range(one):
            product += row[other] * weights[other]
            along[other] = along[other] + row[other] * weight
        along[one] = product + row[one] * weight - mean * totals[one]
    return along


def _inverse_with(matrix: list[list[float]], diagonal: float) -> list[list[float]]:
    """Return the inverse of a symmetric matrix, 1 by 1 or 2 by 2, with `diagonal` added to its diagonal."""
    first = matrix[0][0] + diagonal
    if len(matrix) == 1:
        return [[1.0 / first]]
    second, cross = matrix[1][1] + diagonal, matrix[0][1]
    determinant = first * second - cross * cross
    return [[second / determinant, -cross / determinant], [-cross / determinant, first / determinant]]

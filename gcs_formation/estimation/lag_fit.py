"""The lags that fit a vehicle's telemetry, from simulations of it by models (7) of several lags: `lags` says when."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from librt.vecs import vec

from flight_model.autopilot_model import squared, within
from gcs_formation.estimation.lag_simulation import ResidualBatch

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
"""Time constant of the memory of how long residuals stay alike."""
STILL_ALIKE: Final = math.exp(-BATCH_S / ALIKE_S)
GUST_ALIKE: Final = 6.0
"""How many batches are believed to tell no more than one, until it is seen. The misfit's count goes no higher: what
stays alike for longer may be lags that are far off."""
GUST_WORTH: Final = 5.0
"""How many pairs of batches that belief is worth."""
STEP_MAX: Final = 0.1
"""Largest change of a ratio's logarithm at a fit."""
SETTLED: Final = 1e-3
"""A change of a ratio's logarithm at a fit so small that the next fit waits for samples that show lags."""
LEAST_SPREAD: Final = 0.02
"""What was seen first is forgotten once the ratio is known better than this: lags may change. Without excitation
nothing is learnt, and nothing forgotten."""
RECENT_S: Final = 20.0
"""Time constant of the misfit's memory."""
STILL_RECENT: Final = math.exp(-BATCH_S / RECENT_S)
"""What it keeps from one fit to the next."""
FITTED: Final = 2.0
"""Independent residuals that a mean and a share take up which are fitted to them: so few tell nothing of chance."""
SIGNIFICANT: Final = 2.0
"""Standard deviations of the misfit that don't count."""


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


class LagFit:
    """A vehicle's airspeed, heading or height: what was seen, and the P lags that fit it."""

    def __init__(self, nodes: Nodes, resolution: float, rate_hz: float, *, in_use: bool) -> None:
        """Start with the believed lags.

        `rate_hz` is that of the telemetry; `in_use`: whether the lags found are, not the believed ones.
        """
        self.log_ratio = [0.0] * nodes.parameters
        """(P) of the lags to the believed ones."""
        self.misfit = 0.0
        """Share by which lags seem to differ from those in use, beyond chance, in what was flown last."""
        self._nodes, self._resolution, self._in_use = nodes, resolution, in_use
        self._least_variance = resolution**2
        self._alike = max(1.0, CORRELATED_S * rate_hz)
        self._kept = 1.0
        """Share of what was seen that counts from now on."""
        self._settled = True
        """Whether the last fit changed next to nothing."""
        self._weights = nodes.weights(self.log_ratio)
        """Of the simulations at the lags in use, and their derivatives."""
        self._persistence = Persistence(resolution)
        self._all, self._recent = _zeros(len(nodes.at) + 1), _zeros(len(nodes.at) + 1)
        """(K + 1, K + 1) sums of products over all samples that count and over recent ones, of batches that show lags,
        up to the diagonal: of K simulations minus telemetry, and of 1."""
        self._still_recent = 1.0
        """Share of the recent sums that still counts."""
        self._shown = _zeros(nodes.parameters + 2)
        """(P + 2, P + 2) likewise over recent samples: of residuals of the lags in use, their derivatives, and 1."""
        self._calm_square = self._calm_total = self._calm_count = 0.0
        """Sums over recent samples of batches that don't show lags: of residuals, and of 1."""

    def learn(self, tracks: ResidualBatch) -> bool:
        """Take a batch of samples. Fit the lags anew if it shows any, or while they still change; return whether.

        Where simulations of all lags are the same, samples only tell how large and how lasting other residuals are.
        """
        excited = tracks.excited(self._resolution)
        fits = excited or not self._settled
        self._age()
        if excited:
            self._add(tracks)
        if fits:
            weights = self._nodes.weights(self.log_ratio)
            seen = _about_means(_projected(self._all, weights))
            nearer = self._nearer(seen)
            self._take(tracks, _moved(weights, nearer), calm=not excited)
            self._fit(seen, self._persistence.batches * _left(seen, nearer) / _count(self._all))
            self._shown = _projected(self._recent, self._weights)
            _keep(self._shown, self._still_recent)
        else:
            self._take(tracks, self._weights[0], calm=True)
        self._judge()
        return fits

    def _age(self) -> None:
        """Have what was recent be so no more, by and by."""
        self._still_recent *= STILL_RECENT
        _keep(self._shown, STILL_RECENT)
        self._calm_square *= STILL_RECENT
        self._calm_total *= STILL_RECENT
        self._calm_count *= STILL_RECENT

    def _add(self, tracks: ResidualBatch) -> None:
        """Add a batch that shows lags to the sums."""
        _keep(self._all, self._kept)
        _keep(self._recent, self._still_recent)
        self._still_recent = 1.0
        for sample in range(tracks.count):
            _add(tracks.rows[sample], self._all, self._recent)

    def _take(self, tracks: ResidualBatch, weights: vec[float], *, calm: bool) -> None:
        """Take what lags leave of a batch, by these weights; it's `calm` if it shows none."""
        square = total = 0.0
        for sample in range(tracks.count):
            residual = _dot(weights, tracks.rows[sample])
            square += residual * residual
            total += residual
        count = float(tracks.count)
        self._persistence.take(total / count if count > 0.0 else math.nan)
        if calm:
            self._calm_square += square
            self._calm_total += total
            self._calm_count += count

    def _nearer(self, seen: vec[vec[float]]) -> list[float]:
        """Return by how much other ratios would come nearest to what was `seen`, as far as it stands out."""
        found = [0.0 for _ in self.log_ratio]
        held = BELIEF * self._least_variance * self._alike
        for place, row in enumerate(_inverse_with(_information(seen, 1.0), held)):
            for other, each in enumerate(row):
                found[place] -= each * seen[1 + other][0]
        return found

    def _fit(self, seen: vec[vec[float]], variance: float) -> None:
        """Make a Gauss-Newton step towards the most likely lags, and forget what is more than enough.

        Args:
            seen: the products of the simulation with its lags, and of its derivatives, about their means.
            variance: of what no lags would explain, so often as it stays alike.
        """
        log_ratio, most, change = self.log_ratio, 1.0, 0.0
        worth = 1.0 / ((variance + self._least_variance) * self._alike)
        information = _information(seen, worth)
        pull = [-seen[1 + place][0] * worth - each * BELIEF for place, each in enumerate(log_ratio)]
        for place, row in enumerate(_inverse_with(information, BELIEF)):
            wanted, before = 0.0, log_ratio[place]
            for other, each in enumerate(row):
                wanted += each * pull[other]
            log_ratio[place] = within(before + within(wanted, -STEP_MAX, STEP_MAX), -BOUND, BOUND)
            change = max(change, abs(log_ratio[place] - before))
            most = max(most, information[place][place])
        self._kept = min(1.0, 1.0 / (LEAST_SPREAD**2 * most))
        self._settled = change < SETTLED
        if self._in_use:
            self._weights = self._nodes.weights(log_ratio)

    def _judge(self) -> None:
        """Find by what common share the lags in use differ from those of what was flown last.

        So many batches as stay alike tell no more of residuals than an independent one. Only those that show lags
        count: a gust and the law's answer to it, in calm flight, are one event however long that flight was. Few of
        them, less a mean and a share that were fitted to them, tell little of how large residuals are, and nothing
        where none are left. A share beyond what simulations span is taken for theirs.
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
        free = sums[last][last] / (self._alike * min(self._persistence.batches, GUST_ALIKE)) - FITTED
        if free <= 0.0:
            self.misfit = 0.0
            return
        left = max(size - squared(shown) / excitation, 0.0) / (self._alike * free)
        chance = math.sqrt((left + self._least_variance) * self._alike / excitation)
        self.misfit = within(abs(shown) / excitation - SIGNIFICANT * chance, 0.0, RATIO_MAX - 1.0)


def _zeros(size: int) -> vec[vec[float]]:
    """Return a symmetric matrix of zeros: of each row what is up to the diagonal."""
    return vec[vec[float]]([vec[float]([0.0] * (row + 1)) for row in range(size)])


def _dot(one: vec[float], other: vec[float]) -> float:
    """Return the product of two lists' numbers, as many as the first has."""
    total = 0.0
    for place in range(len(one)):
        total += one[place] * other[place]
    return total


def _keep(sums: vec[vec[float]], share: float) -> None:
    """Scale all sums by a share: exponential forgetting."""
    for row in sums:
        for place in range(len(row)):
            row[place] = row[place] * share


def _add(row: vec[float], sums: vec[vec[float]], others: vec[vec[float]]) -> None:
    """Add the products of each two numbers of a row to sums, and to others."""
    for one in range(len(row)):
        value, to, to_other = row[one], sums[one], others[one]
        for other in range(one + 1):
            product = value * row[other]
            to[other] = to[other] + product
            to_other[other] = to_other[other] + product


def _count(sums: vec[vec[float]]) -> float:
    """Return how many samples they are of, 1 at least."""
    end = len(sums) - 1
    return max(sums[end][end], 1.0)


def _projected(sums: vec[vec[float]], weights: vec[vec[float]]) -> vec[vec[float]]:
    """Return the sums of products of P + 1 weighted means of the simulations, and of 1."""
    totals, found, end = sums[len(sums) - 1], _zeros(len(weights) + 1), len(weights)
    for one in range(end):
        along = _along(sums, weights[one])
        for other in range(one + 1):
            found[one][other] = _dot(weights[other], along)
        found[end][one] = _dot(weights[one], totals)
    found[end][end] = totals[len(totals) - 1]
    return found


def _along(sums: vec[vec[float]], weights: vec[float]) -> vec[float]:
    """Return the sums of products (K) of the simulations' weighted mean with each of them."""
    along = vec[float]([0.0] * len(weights))
    for one in range(len(weights)):
        row, weight, product = sums[one], weights[one], 0.0
        for other in range(one):
            product += row[other] * weights[other]
            along[other] = along[other] + row[other] * weight
        along[one] = product + row[one] * weight
    return along


def _about_means(sums: vec[vec[float]]) -> vec[vec[float]]:
    """Make the sums of products, but for those with 1, such about their means, and return them."""
    end, count = len(sums) - 1, _count(sums)
    totals = sums[end]
    for one in range(end):
        for other in range(one + 1):
            sums[one][other] = sums[one][other] - totals[one] * totals[other] / count
    return sums


def _moved(weights: vec[vec[float]], by: list[float]) -> vec[float]:
    """Return the weights (K) of the simulations at ratios that are moved, from weights and their derivatives."""
    moved = vec[float]([0.0] * len(weights[0]))
    for node in range(len(moved)):
        weight = weights[0][node]
        for place, each in enumerate(by):
            weight += each * weights[1 + place][node]
        moved[node] = weight
    return moved


def _information(seen: vec[vec[float]], worth: float) -> list[list[float]]:
    """Return the products (P, P) of the derivatives with each other, times what they are worth."""
    first = seen[1][1] * worth
    if len(seen) == 3:
        return [[first]]
    cross = seen[2][1] * worth
    return [[first, cross], [cross, seen[2][2] * worth]]


def _left(seen: vec[vec[float]], by: list[float]) -> float:
    """Return the simulation's product with itself, about its mean, at ratios that are moved."""
    left, information = seen[0][0], _information(seen, 1.0)
    for one, each in enumerate(by):
        left += 2.0 * each * seen[1 + one][0]
        for other, another in enumerate(by):
            left += each * another * information[one][other]
    return max(left, 0.0)


def _each(rows: vec[float], columns: vec[float]) -> vec[float]:
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

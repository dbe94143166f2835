# Compiled by mypyc: it runs every tick.

"""Sums of products of simulations' residuals: added, forgotten, projected on weighted means, and solved for steps."""

from __future__ import annotations

from librt.vecs import vec


def zeros(size: int) -> vec[vec[float]]:
    """Return a symmetric matrix of zeros, rows up to the diagonal."""
    return vec[vec[float]]([vec[float]([0.0] * (row + 1)) for row in range(size)])


def dot(one: vec[float], other: vec[float]) -> float:
    """Return the scalar product of a list with the first numbers of another."""
    total = 0.0
    for index in range(len(one)):
        total += one[index] * other[index]
    return total


def scale(sums: vec[vec[float]], share: float) -> None:
    """Scale all sums by a share: exponential forgetting."""
    for row in sums:
        for index in range(len(row)):
            row[index] = row[index] * share


def add_products(row: vec[float], sums: vec[vec[float]], others: vec[vec[float]]) -> None:
    """Add the products of every two numbers of a row to `sums` and to `others`."""
    for one in range(len(row)):
        value, to, to_other = row[one], sums[one], others[one]
        for other in range(one + 1):
            product = value * row[other]
            to[other] = to[other] + product
            to_other[other] = to_other[other] + product


def count_of(sums: vec[vec[float]]) -> float:
    """Return the number of samples in the sums, 1 at least."""
    end = len(sums) - 1
    return max(sums[end][end], 1.0)


def projected(sums: vec[vec[float]], weights: vec[vec[float]]) -> vec[vec[float]]:
    """Return the sums of products of P + 1 weighted means of the simulations, and of 1, from those of simulations."""
    totals, found, end = sums[len(sums) - 1], zeros(len(weights) + 1), len(weights)
    for one in range(end):
        along = _products_with_mean(sums, weights[one])
        for other in range(one + 1):
            found[one][other] = dot(weights[other], along)
        found[end][one] = dot(weights[one], totals)
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


def centred(sums: vec[vec[float]]) -> vec[vec[float]]:
    """Change the sums of products, except those with 1, to ones about the means, and return them."""
    end, count = len(sums) - 1, count_of(sums)
    totals = sums[end]
    for one in range(end):
        for other in range(one + 1):
            sums[one][other] = sums[one][other] - totals[one] * totals[other] / count
    return sums


def weights_near(weights: vec[vec[float]], by: list[float]) -> vec[float]:
    """Return the weights (K) of the simulations after a step `by` of the log ratios, to first order."""
    moved = vec[float]([0.0] * len(weights[0]))
    for node in range(len(moved)):
        weight = weights[0][node]
        for index, each in enumerate(by):
            weight += each * weights[1 + index][node]
        moved[node] = weight
    return moved


def information_of(seen: vec[vec[float]], worth: float) -> list[list[float]]:
    """Return the products (P, P) of the derivatives with each other, times `worth`."""
    first = seen[1][1] * worth
    if len(seen) == 3:
        return [[first]]
    cross = seen[2][1] * worth
    return [[first, cross], [cross, seen[2][2] * worth]]


def residual_square(seen: vec[vec[float]], by: list[float]) -> float:
    """Return the sum of squared residuals about their mean after a step `by` of the log ratios, to first order."""
    left, information = seen[0][0], information_of(seen, 1.0)
    for one, each in enumerate(by):
        left += 2.0 * each * seen[1 + one][0]
        for other, another in enumerate(by):
            left += each * another * information[one][other]
    return max(left, 0.0)


def inverse_with(matrix: list[list[float]], diagonal: float) -> list[list[float]]:
    """Return the inverse of a symmetric matrix, 1 by 1 or 2 by 2, with `diagonal` added to its diagonal."""
    first = matrix[0][0] + diagonal
    if len(matrix) == 1:
        return [[1.0 / first]]
    second, cross = matrix[1][1] + diagonal, matrix[0][1]
    determinant = first * second - cross * cross
    return [[second / determinant, -cross / determinant], [-cross / determinant, first / determinant]]

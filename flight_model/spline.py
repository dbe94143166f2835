"""The cubic spline through points, of natural ends, by B-splines (equations 35 and 36).

`scipy.interpolate.make_interp_spline` gives the same to the bit; importing it takes longer than reading a scenario.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from flight_model.arrays import Array, Indices

DEGREE = 3


@dataclass(frozen=True)
class CubicSpline:
    """Splines over one parameter, a column of coefficients for each: knots (n + 6,), coefficients (n + 2, columns)."""

    knots: Array
    coefficients: Array

    def at(self, parameters: Array, order: int = 0) -> Array:
        """Return values (..., columns) at parameters (...), or derivatives of an order up to 2."""
        first, basis = _basis(self.knots, parameters, order)
        terms = [self.coefficients[first + i] * basis[i][..., None] for i in range(DEGREE + 1)]
        return terms[0] + terms[1] + terms[2] + terms[3]


def spline_through(parameters: Array, points: Array) -> CubicSpline:
    """Return the splines through points (n, columns) at rising parameters (n,), their ends without curvature."""
    knots = np.concatenate((np.full(DEGREE, parameters[0]), parameters, np.full(DEGREE, parameters[-1])))
    count, none = len(points) + 2, np.zeros((1, points.shape[1]))
    conditions = (
        _basis(knots, parameters[:1], 2),
        _basis(knots, parameters, 0),
        _basis(knots, parameters[-1:], 2),
    )
    first = np.concatenate([condition[0] for condition in conditions])
    bands = np.zeros((2 * DEGREE + 1, count))
    for i in range(DEGREE + 1):
        rows = np.arange(count)
        bands[DEGREE + rows - first - i, first + i] = np.concatenate([basis[i] for _, basis in conditions])
    known = np.concatenate((none, points, none))
    return CubicSpline(knots, np.asarray(solve_banded((DEGREE, DEGREE), bands, known), dtype=np.float64))


def _basis(knots: Array, parameters: Array, order: int) -> tuple[Indices, list[Array]]:
    """Return the four B-splines that aren't 0 at parameters, or derivatives of them, and the number of the first.

    By Cox and de Boor's recurrence from degree 0 up; the last `order` steps differentiate instead.
    """
    span = np.clip(np.searchsorted(knots, parameters, side="right") - 1, DEGREE, len(knots) - DEGREE - 2)
    basis: list[Array] = [np.ones_like(parameters)]
    for degree in range(1, DEGREE + 1):
        lower, basis = basis, [np.zeros_like(parameters)]
        for i, each in enumerate(lower, 1):
            right, left = knots[span + i], knots[span + i - degree]
            if degree <= DEGREE - order:
                share = each / (right - left)
                basis[-1] = basis[-1] + share * (right - parameters)
                basis.append(share * (parameters - left))
            else:
                slope = degree * each / (right - left)
                basis[-1] = basis[-1] - slope
                basis.append(slope)
    return span - DEGREE, basis

"""The cubic spline through points, of natural ends, by B-splines (equations 35 and 36).

`scipy.interpolate.make_interp_spline` gives the same; importing it takes longer than reading a scenario.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
    begin, end = parameters[:1], parameters[-1:]
    conditions = (
        _basis(knots, begin, 0),
        _basis(knots, begin, 2),
        _basis(knots, parameters[1:-1], 0),
        _basis(knots, end, 2),
        _basis(knots, end, 0),
    )
    first = np.concatenate([condition[0] for condition in conditions])
    bands, rows = np.zeros((count, 2 * DEGREE + 1)), np.arange(count)
    for i in range(DEGREE + 1):
        bands[rows, DEGREE + first + i - rows] = np.concatenate([basis[i] for _, basis in conditions])
    return CubicSpline(knots, _solved(bands, np.concatenate((points[:1], none, points[1:-1], none, points[-1:]))))


def _solved(bands: Array, known: Array) -> Array:
    """Return the solution of a banded system, whose row k has its columns from k - 3 to k + 3 in `bands` (n, 7).

    Gauss's elimination. A spline's conditions need no pivots (de Boor, A Practical Guide to Splines, 1978, chapter 13).
    """
    rows, values = bands.tolist(), known.copy()
    count = len(rows)
    for pivot, row in enumerate(rows):
        for below in range(pivot + 1, min(pivot + DEGREE + 1, count)):
            other, place = rows[below], DEGREE + pivot - below
            share = other[place] / row[DEGREE]
            if share != 0.0:
                for i in range(DEGREE + 1):
                    other[place + i] -= share * row[DEGREE + i]
                values[below] -= share * values[pivot]
    for pivot in reversed(range(count)):
        row = rows[pivot]
        for i in range(1, min(DEGREE, count - 1 - pivot) + 1):
            values[pivot] -= row[DEGREE + i] * values[pivot + i]
        values[pivot] /= row[DEGREE]
    return values


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

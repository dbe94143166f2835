"""A path as one curve through its waypoints: a B-spline, parametrised by horizontal arc length.

`scipy.interpolate.make_interp_spline` gives the same spline; importing it takes longer than reading a scenario.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight_model.arrays import Array, Indices
from flight_model.path import FlightPath, PathError, hermite_pieces

DEGREE = 3
MIN_LEG_M = 1.0
MIN_TANGENT = 1e-3
PIECES_PER_LEG = 64
QUADRATURE_POINTS = 8


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
    """Return the splines through points (n, columns) at rising parameters (n,), with zero curvature at both ends."""
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
    """Return the solution of a banded system; row k of `bands` (n, 7) has its columns k - 3 to k + 3.

    By Gaussian elimination; a spline's conditions need no pivoting (de Boor, A Practical Guide to Splines, 1978,
    chapter 13).
    """
    rows, values = bands.tolist(), known.copy()
    count = len(rows)
    for pivot, row in enumerate(rows):
        for below in range(pivot + 1, min(pivot + DEGREE + 1, count)):
            other, offset = rows[below], DEGREE + pivot - below
            share = other[offset] / row[DEGREE]
            if share != 0.0:
                for i in range(DEGREE + 1):
                    other[offset + i] -= share * row[DEGREE + i]
                values[below] -= share * values[pivot]
    for pivot in reversed(range(count)):
        row = rows[pivot]
        for i in range(1, min(DEGREE, count - 1 - pivot) + 1):
            values[pivot] -= row[DEGREE + i] * values[pivot + i]
        values[pivot] /= row[DEGREE]
    return values


def _basis(knots: Array, parameters: Array, order: int) -> tuple[Indices, list[Array]]:
    """Return the index of the first of the four B-splines that are nonzero at parameters, and these, or derivatives.

    By the Cox-de Boor recurrence from degree 0 up; the last `order` steps differentiate instead.
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


class SplinePath(FlightPath):
    """A cubic B-spline with clamped ends through waypoints (equations 35 and 36), by arc length in metres.

    Knots are at the waypoints' horizontal chord lengths; the second derivative is zero at both ends.
    Before 0 and beyond `length_m` the path is straight and level.
    """

    def __init__(self, waypoints_m: Sequence[Sequence[float]] | Array) -> None:
        """Take (n, 3) north, east and height in m, n >= 2.

        Raises:
            PathError: two successive waypoints less than 1 m apart horizontally, or a leg that turns straight
                back.
        """
        waypoints = np.asarray(waypoints_m, dtype=np.float64)
        chords = np.hypot(*np.diff(waypoints[:, :2], axis=0).T)
        short = np.flatnonzero(chords < MIN_LEG_M)
        if short.size:
            raise PathError(f"found a waypoint {chords[short[0]]:.3g} m from the one before it", int(short[0]) + 1)
        spline, parameters, derivatives = _spline_values(waypoints, chords)
        lengths = _piece_lengths(spline, parameters)
        nodes_m: Array = np.concatenate(([0.0], np.cumsum(lengths)))
        super().__init__(nodes_m, nodes_m[::PIECES_PER_LEG], hermite_pieces(*_by_arc_length(derivatives), lengths))


def _spline_values(waypoints: Array, chords: Array) -> tuple[CubicSpline, Array, Array]:
    """Return the spline over its parameter, the ends of the pieces (m + 1,), and derivatives 0 to 2 there.

    These are (3, m + 1, 3).
    """
    knots = np.concatenate(([0.0], np.cumsum(chords)))
    spline = spline_through(knots, waypoints)
    whole_legs = np.linspace(knots[:-1], knots[1:], PIECES_PER_LEG, endpoint=False, axis=1)
    parameters = np.append(whole_legs.ravel(), knots[-1])
    derivatives = np.stack([spline.at(parameters, order) for order in range(3)])
    tangents = np.hypot(derivatives[1, :, 0], derivatives[1, :, 1])
    if tangents.min() < MIN_TANGENT:
        waypoint = int(np.argmin(np.abs(knots - parameters[np.argmin(tangents)])))
        raise PathError("found a path that turns straight back", waypoint)
    return spline, parameters, derivatives


def _piece_lengths(spline: CubicSpline, parameters: Array) -> Array:
    """Return the horizontal length of each piece, by Gauss-Legendre quadrature."""
    abscissae, weights = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
    half = np.diff(parameters)[:, None] / 2.0
    tangents = spline.at(parameters[:-1, None] + half * (1.0 + abscissae), 1)
    return np.asarray(np.sum(np.hypot(tangents[..., 0], tangents[..., 1]) * weights * half, axis=1))


def _by_arc_length(derivatives: Array) -> tuple[Array, Array, Array]:
    """Return values and first and second derivatives by horizontal arc length, each (m + 1, 3)."""
    values, first, second = derivatives
    rate = np.hypot(first[:, 0], first[:, 1])[:, None]
    rate_change = np.sum(first[:, :2] * second[:, :2], axis=1)[:, None] / rate
    return values, first / rate, (second * rate - first * rate_change) / rate**3

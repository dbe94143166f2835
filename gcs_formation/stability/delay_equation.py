"""Characteristic roots of linear differential equations with several constant delays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flight_model.arrays import Array

_COINCIDENT = 1e-14


def rightmost_root(terms: Mapping[float, Array], nodes: int = 24) -> complex:
    """Rightmost root of det(sI - sum_k A_k exp(-s tau_k)), by pseudospectral discretisation.

    The infinitesimal generator of the solution operator is collocated at Chebyshev points of [-max tau, 0]
    (Breda, Maset and Vermiglio 2005): spectrally accurate while `nodes` well exceeds |s| max tau.

    Args:
        terms: matrix A_k, (n, n), of each delay in seconds; delay 0 is the undelayed term.
        nodes: collocation intervals; the eigenproblem is of size n (nodes + 1).

    Returns:
        The root in rad/s, the one above the real axis of a pair.
    """
    longest = max(terms)
    roots = np.linalg.eigvals(sum(terms.values()) if longest == 0.0 else _generator(terms, longest, nodes))
    rightmost = roots[np.argmax(roots.real)]
    return complex(rightmost.real, abs(rightmost.imag))


def _generator(terms: Mapping[float, Array], longest: float, nodes: int) -> Array:
    size = next(iter(terms.values())).shape[0]
    points = np.cos(np.pi * np.arange(nodes + 1) / nodes)
    generator = np.kron(_differentiation(points) * (2.0 / longest), np.eye(size)).astype(np.float64)
    at_delays = {delay: _interpolation(points, 1.0 - 2.0 * delay / longest) for delay in terms}
    generator[:size] = sum(np.kron(at_delays[delay], matrix) for delay, matrix in terms.items())
    return generator


def _weights(points: Array) -> Array:
    """Barycentric weights of Chebyshev points."""
    weights = np.where(np.arange(len(points)) % 2 == 0, 1.0, -1.0)
    weights[[0, -1]] /= 2.0
    return weights


def _differentiation(points: Array) -> Array:
    weights = _weights(points)
    gaps = points[:, None] - points + np.eye(len(points))
    matrix = weights / weights[:, None] / gaps
    np.fill_diagonal(matrix, 0.0)
    return matrix - np.diag(matrix.sum(axis=1))


def _interpolation(points: Array, at: float) -> Array:
    """Row that takes values at the points to the value of their interpolant."""
    gaps = at - points
    hit = np.abs(gaps) < _COINCIDENT
    if hit.any():
        return hit.astype(np.float64)
    terms = _weights(points) / gaps
    return terms / terms.sum()

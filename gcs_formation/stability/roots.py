"""Roots of functions between points where their signs differ, and of delay differential equations.

`scipy.optimize.elementwise.find_root` gives the first to the bit; importing it takes longer than finding them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from flight_model.arrays import Array

TOLERANCE = 4.0 * float(np.finfo(np.float64).eps)
"""How near the ends of a bracket get, as a share of the root."""
TINY = float(np.finfo(np.float64).smallest_normal)
_COINCIDENT = 1e-14


def roots_between(function: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Return a root (n,) of a function of arrays between each low and high (n,), where its signs differ.

    Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function without using
    derivatives", Advances in Engineering Software 28 (1997): by inverse quadratic interpolation where it is safe.
    """
    return np.array([_root(function, *ends) for ends in zip(low.tolist(), high.tolist(), strict=True)])


def _root(function: Callable[[Array], Array], x1: float, x2: float) -> float:
    f1, f2 = (_value(function, x) for x in (x1, x2))
    share = 0.5
    while True:
        x = x1 + share * (x2 - x1)
        f = _value(function, x)
        if np.sign(f) == np.sign(f1):
            x3, f3 = x1, f1
        else:
            x3, f3, x2, f2 = x2, f2, x1, f1
        x1, f1 = x, f
        root, value = (x1, f1) if abs(f1) < abs(f2) else (x2, f2)
        near = abs(root) * TOLERANCE + 4.0 * TINY
        if abs(value) <= TINY or abs(x2 - x1) < near:
            return root
        least = 0.5 * near / abs(x2 - x1)
        share = min(max(_interpolated((x1, x2, x3), (f1, f2, f3)), least), 1.0 - least)


def _value(function: Callable[[Array], Array], x: float) -> float:
    return float(function(np.array([x]))[0])


def _interpolated(x: tuple[float, float, float], f: tuple[float, float, float]) -> float:
    """Return the share of the way from the first to the second point at which to look next."""
    (x1, x2, x3), (f1, f2, f3) = x, f
    xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2) if f3 != f2 else np.inf
    if not 1.0 - np.sqrt(1.0 - xi) < phi < np.sqrt(xi):
        return 0.5
    alpha = (x3 - x1) / (x2 - x1)
    return f1 / (f1 - f2) * f3 / (f3 - f2) - alpha * f1 / (f3 - f1) * f2 / (f2 - f3)


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

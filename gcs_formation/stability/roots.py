"""Roots of a function between points where its signs differ.

`scipy.optimize.elementwise.find_root` gives the same to the bit; importing it takes longer than finding them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flight_model.arrays import Array

TOLERANCE = 4.0 * float(np.finfo(np.float64).eps)
"""How near the ends of a bracket get, as a share of the root."""
TINY = float(np.finfo(np.float64).smallest_normal)


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

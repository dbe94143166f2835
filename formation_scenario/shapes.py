"""The slots of each shape."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count as naturals
from itertools import islice
from math import cos, pi, sin, sqrt

import numpy as np

from flight_model.arrays import Array

Place = tuple[float, float]

ROW_OF_TRIANGLE = sqrt(3.0) / 2.0


def slots(shape: str, count: int, spacing_m: float) -> Array:
    """Return the slots (count, 3) of a shape, in m forward, right and up of the leader.

    No two vehicles, the leader included, are nearer to each other than the spacing. Only circle and plus, which have
    the leader in their middle, have slots ahead of it. In all but the circle, more vehicles don't move the slots.

    Raises:
        ValueError: a shape that isn't one of `SHAPES`.
    """
    if shape not in SHAPES:
        raise ValueError(f"found shape '{shape}'; allowed: {', '.join(SHAPES)}")
    places = np.array(list(islice(SHAPES[shape](count), count)), dtype=np.float64).reshape(count, 2)
    return np.column_stack((spacing_m * places, np.zeros(count)))


# Each shape yields (forward, right) in units of the spacing, nearest to the leader first.


def _follower(_: int) -> Iterator[Place]:
    for k in naturals(1):
        yield -k, 0.0


def _echelon(_: int) -> Iterator[Place]:
    for k in naturals(1):
        yield -k, k


def _arrow(_: int) -> Iterator[Place]:
    for k in naturals(1):
        yield -k, -k
        yield -k, k


def _line(_: int) -> Iterator[Place]:
    for k in naturals(1):
        yield 0.0, -k
        yield 0.0, k


def _plus(_: int) -> Iterator[Place]:
    for k in naturals(1):
        yield from ((-k, 0.0), (0.0, -k), (0.0, k), (k, 0.0))


def _diamond(_: int) -> Iterator[Place]:
    """A lattice on its corner, (i, j) at (-(i + j), i - j), grown by whole diamonds of (k + 1)²."""
    for k in naturals(1):
        for i in range(k):
            yield -(i + k), i - k
            yield -(i + k), k - i
        yield -2 * k, 0.0


def _triangle(_: int) -> Iterator[Place]:
    """Equilateral: row k has k + 1 places, the middle ones first."""
    for k in naturals(1):
        for right in sorted((j - k / 2.0 for j in range(k + 1)), key=lambda right: (abs(right), right)):
            yield -k * ROW_OF_TRIANGLE, right


def _square(_: int) -> Iterator[Place]:
    """Columns are added right and left in turn, with a row at the back each time."""
    for k in naturals(1):
        left, right = -(k // 2), (k + 1) // 2
        side = right if k % 2 else left
        yield from ((-row, side) for row in range(k))
        yield from ((-k, column) for column in range(left, right + 1))


def _circle(count: int) -> Iterator[Place]:
    radius = max(1.0, 0.5 / sin(pi / count)) if count > 1 else 1.0
    for k in range(count):
        angle = pi + 2.0 * pi * k / count
        yield radius * cos(angle), radius * sin(angle)


SHAPES: dict[str, Callable[[int], Iterator[Place]]] = {
    "follower": _follower,
    "diamond": _diamond,
    "triangle": _triangle,
    "square": _square,
    "plus": _plus,
    "arrow": _arrow,
    "line": _line,
    "echelon": _echelon,
    "circle": _circle,
}

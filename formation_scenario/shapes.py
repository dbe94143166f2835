"""Shapes of a formation: where the slots of any number of followers are. Ours are registered as an extension's are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, count, islice
from math import cos, pi, sin, sqrt

from formation_scenario.register import Decorator, Extension, decorator

SHAPE = "shape"
Offset = tuple[float, float]
"""Forward and right of the leader, in units of the spacing."""
ROW_OF_TRIANGLE = sqrt(3.0) / 2.0


class Shape(Extension, ABC):
    """A shape, which `formation.shape`, its changes and the order `shape NAME` choose."""

    @abstractmethod
    def slots(self, followers: int, spacing_m: float) -> Iterable[Sequence[float]]:
        """Return the slots of a number of followers, in the order in which they are filled.

        No two vehicles, the leader at (0, 0, 0) included, should be nearer to each other than the spacing; `check`
        refuses what is too near for `safety`.

        Args:
            followers: how many slots are needed, 1 or more.
            spacing_m: `formation.spacing_m`, m.

        Returns:
            For each follower m forward and right of the leader, and up if there is a third number.
        """


def register_shape(name: str) -> Decorator[type[Shape]]:
    """Register a shape, which `formation.shape: NAME` chooses; `formation.parameters` are its keys."""
    return decorator(SHAPE, name, Shape)


class Rings(Shape):
    """A shape that is filled ring by ring, nearest to the leader first; further vehicles don't move its slots."""

    @abstractmethod
    def ring(self, k: int) -> Iterable[Offset]:
        """Return the k-th slots, k from 1, in units of the spacing."""

    def slots(self, followers: int, spacing_m: float) -> Iterator[Offset]:
        """Yield the first slots."""
        for forward, right in islice(chain.from_iterable(map(self.ring, count(1))), followers):
            yield spacing_m * forward, spacing_m * right


@register_shape("follower")
class Follower(Rings):
    """One behind another."""

    def ring(self, k: int) -> Iterable[Offset]:
        """Return the k-th slot."""
        return [(-k, 0.0)]


@register_shape("diamond")
class Diamond(Rings):
    """A square lattice on its corner, (i, j) at (-(i + j), i - j), grown by whole diamonds of (k + 1)²."""

    def ring(self, k: int) -> Iterator[Offset]:
        """Yield the slots that make it larger."""
        for i in range(k):
            yield from ((-(i + k), i - k), (-(i + k), k - i))
        yield -2 * k, 0.0


@register_shape("triangle")
class Triangle(Rings):
    """Equilateral triangle: row k has k + 1 slots, the middle ones first."""

    def ring(self, k: int) -> Iterator[Offset]:
        """Yield a row."""
        for right in sorted((j - k / 2.0 for j in range(k + 1)), key=lambda right: (abs(right), right)):
            yield -k * ROW_OF_TRIANGLE, right


@register_shape("square")
class Square(Rings):
    """Columns are added right and left in turn, with a row at the back each time."""

    def ring(self, k: int) -> Iterator[Offset]:
        """Yield a column and a row."""
        left, right = -(k // 2), (k + 1) // 2
        side = right if k % 2 else left
        yield from ((-row, side) for row in range(k))
        yield from ((-k, column) for column in range(left, right + 1))


@register_shape("plus")
class Plus(Rings):
    """Four arms, the leader in their middle."""

    def ring(self, k: int) -> Iterable[Offset]:
        """Return a slot of each arm."""
        return [(-k, 0.0), (0.0, -k), (0.0, k), (k, 0.0)]


@register_shape("arrow")
class Arrow(Rings):
    """Two arms, back left and back right."""

    def ring(self, k: int) -> Iterable[Offset]:
        """Return a slot of each arm."""
        return [(-k, -k), (-k, k)]


@register_shape("line")
class Line(Rings):
    """Side by side."""

    def ring(self, k: int) -> Iterable[Offset]:
        """Return a slot left and one right."""
        return [(0.0, -k), (0.0, k)]


@register_shape("echelon")
class Echelon(Rings):
    """One arm, back right."""

    def ring(self, k: int) -> Iterable[Offset]:
        """Return the k-th slot."""
        return [(-k, k)]


@register_shape("circle")
class Circle(Shape):
    """A circle around the leader."""

    def slots(self, followers: int, spacing_m: float) -> Iterator[Offset]:
        """Yield its slots, equally far from one another."""
        radius = max(1.0, 0.5 / sin(pi / followers)) if followers > 1 else 1.0
        for k in range(followers):
            angle = pi + 2.0 * pi * k / followers
            yield spacing_m * (radius * cos(angle)), spacing_m * (radius * sin(angle))

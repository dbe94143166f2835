"""The shortest paths from one straight to another with turns of continuous curvature: one turn, two, or three.

As L. E. Dubins's paths (American Journal of Mathematics 79, 1957): turn, straight, turn, or three turns to alternating
sides; and a single turn, wider than the tightest one, with straights before and after. With transitions the turns' ends
aren't on circles, so the equations are solved numerically: from brackets or local minima on a grid by Newton's method,
for all of them at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flight_model.arrays import TURN, Array, Complex
from flight_model.legs.turn import NEGLIGIBLE_M, Stretch, TurnLimits, turn_length_m, turn_stretches, turned_m

ANGLES = 120
"""Number of angles of a turn that are tried; courses of the straight between turns are tried at twice as many."""
MAX_MINIMA = 8
STEPS = 9
CLOSED_M = 1e-7
"""Largest gap between a path's end and the straight that it leads to."""
DIFFERENCE_RAD = 1e-6
MAX_STEP_RAD = 0.1
FULL_RAD = 1e-7
"""A turn by less than a full one by this is none: rounding may not add a circle."""
NEAR = 2.5
"""Distance, in widths of a turn by half a circle, beyond which three turns are never the shortest path."""
SMALL_RAD = (0.004, 0.03, 0.12)
"""Small first and last angles of three turns that are tried besides the grid's: there the gap changes fast."""
PARALLEL = 1e-9
SECOND: Array = np.array([[0.0], [0.0], [DIFFERENCE_RAD]])
DECIMALS, ANGLE_DECIMALS = 6, 9
"""Decimals to which two detours must agree to be the same one."""


class Part(NamedTuple):
    """A straight, or a turn by an angle in rad, clockwise positive, `widened` times as wide as the tightest one."""

    straight_m: float = 0.0
    angle_rad: float = 0.0
    widened: float = 1.0


class Detour(NamedTuple):
    """A path of turns and straights."""

    length_m: float
    parts: tuple[Part, ...]

    def stretches(self, limits: TurnLimits) -> tuple[Stretch, ...]:
        """Return its stretches."""
        found = list[Stretch]()
        for straight_m, angle_rad, widened in self.parts:
            if straight_m > NEGLIGIBLE_M:
                found.append(Stretch(straight_m))
            found += turn_stretches(angle_rad, limits.widened(widened))
        return tuple(found)

    def mirrored(self) -> Detour:
        """Return it with left and right exchanged."""
        return Detour(self.length_m, tuple(each._replace(angle_rad=-each.angle_rad) for each in self.parts))


class Detours:
    """Finds detours within limits; those of one geometry, as between the lanes of a survey, are found once."""

    def __init__(self, limits: TurnLimits) -> None:
        """Begin without any."""
        self.limits = limits
        self._known = dict[tuple[float, float, float], tuple[Detour, ...]]()
        self._grid: Array = np.linspace(0.0, TURN, ANGLES + 1)
        self._turned = turned_m(self._grid, limits)
        self._width_m = abs(complex(turned_m(np.asarray(np.pi), limits)))

    def between(self, forward_m: float, right_m: float, angle_rad: float) -> tuple[Detour, ...]:
        """Return paths to a point and a course relative to the begin's, clockwise positive; the shortest first."""
        angle_rad = math.remainder(angle_rad, TURN)
        mirrored = right_m < 0.0 or (right_m == 0.0 and angle_rad < 0.0)
        side = -1.0 if mirrored else 1.0
        key = round(forward_m, DECIMALS), round(side * right_m, DECIMALS), round(side * angle_rad, ANGLE_DECIMALS)
        if key not in self._known:
            end = complex(forward_m, side * right_m)
            found = [*self._of_one(end, key[2]), *self._of_two(end, key[2])]
            found += self._of_three(end, key[2]) if abs(end) < NEAR * self._width_m else ()
            self._known[key] = tuple(sorted(found))
        return tuple(each.mirrored() for each in self._known[key]) if mirrored else self._known[key]

    def _of_one(self, end: complex, angle_rad: float) -> Iterator[Detour]:
        """Yield straight, turn, straight: the tightest turn, or a wider one without one of the straights."""
        axis = complex(math.cos(angle_rad), math.sin(angle_rad))
        for angle in (angle_rad, angle_rad - math.copysign(TURN, angle_rad)):
            turned = complex(turned_m(np.asarray(angle), self.limits))
            length_m = float(turn_length_m(np.asarray(angle), self.limits))
            tightest = _shares(1.0, axis, end - turned)
            no_first, no_last = _shares(turned, axis, end), _shares(1.0, turned, end)
            candidates = [] if tightest is None else [(*tightest, 1.0)]
            candidates += [] if no_first is None else [(0.0, no_first[1], no_first[0])]
            candidates += [] if no_last is None else [(no_last[0], 0.0, no_last[1])]
            for before_m, after_m, widened in candidates:
                if min(before_m, after_m) >= -CLOSED_M and widened >= 1.0:
                    straights = max(before_m, 0.0), max(after_m, 0.0)
                    parts = Part(straights[0], angle, widened), Part(straights[1])
                    yield Detour(sum(straights) + widened * length_m, parts)

    def _rough(self, angle_rad: Array) -> Complex:
        """Return `turned_m` by interpolation, to find out where to begin."""
        steps = np.abs(angle_rad) * (ANGLES / TURN)
        index = np.minimum(steps.astype(np.intp), ANGLES - 1)
        found = self._turned[index] + (steps - index) * (self._turned[index + 1] - self._turned[index])
        return np.where(angle_rad < 0.0, np.conj(found), found)

    def _of_two(self, end: complex, angle_rad: float) -> Iterator[Detour]:
        """Yield turn, straight, turn: the straight's course is a root of how far it misses the last turn."""
        sides = np.array([(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)])
        grid, limits = np.linspace(-np.pi, np.pi, 2 * ANGLES + 1), self.limits
        first, last = _to_side(sides[:, :1], grid), _to_side(sides[:, 1:], angle_rad - grid)
        off_m = ((end - self._rough(first)) * np.exp(-1j * grid) - self._rough(last)).imag
        which, at = np.nonzero(off_m[:, :-1] * off_m[:, 1:] <= 0.0)
        # A path of one turn alone is on no bracket: it touches 0.
        course = np.concatenate((grid[at] + (grid[1] - grid[0]) / 2.0, np.tile([0.0, angle_rad], 4)))
        one, other = sides[np.concatenate((which, np.repeat(np.arange(4), 2)))].T

        def missed(course_rad: Array) -> tuple[Complex, Array, Array]:
            turns = _to_side(one, course_rad), _to_side(other, angle_rad - course_rad)
            return (end - turned_m(turns[0], limits)) * np.exp(-1j * course_rad) - turned_m(turns[1], limits), *turns

        for _ in range(STEPS):
            off, later = missed(np.stack((course, course + DIFFERENCE_RAD)))[0].imag
            if np.abs(off).max() < CLOSED_M / 10.0:
                break
            rate = (later - off) / DIFFERENCE_RAD
            course = course - np.clip(off / np.where(rate == 0.0, 1.0, rate), -MAX_STEP_RAD, MAX_STEP_RAD)
        left, begun, ended = missed(course)
        closed = (np.abs(left.imag) < CLOSED_M) & (left.real > -CLOSED_M)
        straight = np.maximum(left.real, 0.0)
        length = straight + turn_length_m(begun, limits) + turn_length_m(ended, limits)
        for length_m, *turns, straight_m in _distinct(np.stack((length, begun, ended, straight), axis=1)[closed]):
            yield Detour(length_m, (Part(0.0, turns[0]), Part(straight_m, turns[1])))

    def _of_three(self, end: complex, angle_rad: float) -> Iterator[Detour]:
        """Yield the paths of three turns to alternating sides, from the local minima of their gap at the end."""
        grid = (np.arange(ANGLES) + 0.5) * TURN / ANGLES
        sums = np.arange(1 - ANGLES, ANGLES) * TURN / ANGLES
        index = np.arange(ANGLES)[:, None] - np.arange(ANGLES)[None, :] + ANGLES - 1
        for side in (1.0, -1.0):
            one, two = self._rough(side * grid), self._rough(-side * grid)
            three = np.exp(1j * side * sums) * self._rough(_to_side(np.array(side), angle_rad - side * sums))
            gap = np.abs(one[:, None] + (np.exp(1j * side * grid)[:, None] * two) + three[index] - end)
            yield from self._closed(gap, grid, side, end, angle_rad)

    def _closed(self, gap: Array, grid: Array, side: float, end: complex, angle_rad: float) -> Iterator[Detour]:
        """Yield the paths near the local minima of the gaps (ANGLES, ANGLES) that close."""
        around = [np.roll(gap, shift, axis) for axis in (0, 1) for shift in (1, -1)]
        rows, columns = np.nonzero(np.all([gap <= each for each in around], axis=0))
        nearest = np.argsort(gap[rows, columns])[:MAX_MINIMA]
        small, last = (each.ravel() for each in np.meshgrid(SMALL_RAD, SMALL_RAD))
        first = np.concatenate((grid[rows[nearest]], small))
        second = np.concatenate((grid[columns[nearest]], (small + last - side * angle_rad) % TURN))

        def off(first: Array, second: Array) -> tuple[Complex, Array]:
            last = _to_side(np.array(side), angle_rad - side * (first - second))
            one, two, three = turned_m(np.stack((side * first, -side * second, last)), self.limits)
            axis = np.exp(1j * side * first)
            return one + axis * (two + np.exp(-1j * side * second) * three) - end, last

        for _ in range(STEPS):
            # Small turns grow with the root of their angle: by the root of the first, the gap is smooth.
            root = 2.0 * np.sqrt(first)
            step = DIFFERENCE_RAD * root
            value, by_first, by_second = off(np.stack((first, first + step, first)), second + SECOND)[0]
            by_first, by_second = (by_first - value) / DIFFERENCE_RAD, (by_second - value) / DIFFERENCE_RAD
            area = by_first.real * by_second.imag - by_first.imag * by_second.real
            area = np.where(np.abs(area) < PARALLEL, 1.0, area)
            one = (value.real * by_second.imag - value.imag * by_second.real) / area
            other = (by_first.real * value.imag - by_first.imag * value.real) / area
            first = np.maximum(root / 2.0 - np.clip(one, -MAX_STEP_RAD, MAX_STEP_RAD), 1e-4) ** 2
            second = second - np.clip(other, -MAX_STEP_RAD, MAX_STEP_RAD)
        value, last = off(first, second)
        closed = (first > 0.0) & (first < TURN) & (second > 0.0) & (second < TURN) & (np.abs(value) < CLOSED_M)
        turns = np.stack((side * first, -side * second, last), axis=1)
        length = turn_length_m(turns, self.limits).sum(axis=1)
        for length_m, *angles in _distinct(np.column_stack((length, turns))[closed]):
            yield Detour(length_m, tuple(Part(0.0, each) for each in angles))


def _to_side(side: Array, angle_rad: Array) -> Array:
    """Return angles as turns to a side, 1 right or -1 left, of less than a full turn."""
    size = (side * angle_rad) % TURN
    return side * np.where(size > TURN - FULL_RAD, 0.0, size)


def _shares(one: complex, other: complex, end: complex) -> tuple[float, float] | None:
    """Return how much of each of two vectors adds up to a third; None if they are parallel."""
    area = one.real * other.imag - one.imag * other.real
    if abs(area) < PARALLEL * abs(one) * abs(other) or area == 0.0:
        return None
    first = (end.real * other.imag - end.imag * other.real) / area
    return first, (one.real * end.imag - one.imag * end.real) / area


def _distinct(rows: Array) -> list[list[float]]:
    """Return the rows, the shortest first, without those that several beginnings led to."""
    return sorted({tuple(round(value, DECIMALS) for value in row): row for row in rows.tolist()}.values())

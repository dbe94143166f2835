"""Turns at a sharp corner that cross the next leg and come back onto it, or leave the leg before it to the outside.

A turn inside a corner of more than a right angle passes far from its waypoint. Begun later, it passes as near as is
allowed, crosses the line of the next leg, and a second turn leads back onto it, as an aircraft does that overshoots.
The same flown backwards leaves the first leg to the outside and ends nearer to the waypoint on the second.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Complex, Mask
from flight_model.legs.detour import Detour, Part
from flight_model.legs.joint import SAMPLES, Joint
from flight_model.legs.turn import Stretch, TurnLimits, tangent_m, turn_length_m, turn_parts, turned_m

BACK_RAD: Array = np.radians(np.linspace(3.0, 100.0, 98))
"""Angles of the turn back onto the leg that are tried."""
BEGINS = 25
"""Number of distances before the waypoint at which the first turn is tried to begin."""
SHARPEST_RAD = math.radians(150.0)
"""Corner for which the earliest begin of the first turn is that of a turn inside it; sharper ones have none."""
MIN_RAD = math.radians(1.0)
KEPT = 4
"""Number of turns of either kind that are compared by their room to a fence, each with another begin."""
DECIMALS = 9


class _Tried(NamedTuple):
    """All turns that are tried at corners of one angle: by their begin (B, 1), and by the turn back (A,), (B, A)."""

    begin_m: Array
    end_m: Array
    straight_m: Array
    length_m: Array
    near: Mask
    """Whether it passes near enough to the waypoint and ends beyond it."""


class Overshoots:
    """Finds such turns within limits, near enough to their waypoint; those at corners of one angle are tried once."""

    def __init__(self, limits: TurnLimits, max_m: float) -> None:
        """Begin without any; `max_m` is the largest distance from the waypoint, m."""
        self._limits, self._max_m = limits, max_m
        self._known = dict[float, _Tried]()

    def at(self, angle_rad: float, before_m: float, after_m: float) -> list[Joint]:
        """Return turns at a corner, clockwise positive, that take no more than given of both legs; the shortest first.

        Of those that begin at the same distance before the waypoint, only the shortest.
        """
        size = round(abs(angle_rad), DECIMALS)
        if size < MIN_RAD:
            return []
        if size not in self._known:
            self._known[size] = self._tried(size)
        tried = self._known[size]
        found = [*self._best(tried, size, before_m, after_m)]
        found += [_backwards(each) for each in self._best(tried, size, after_m, before_m)]
        found.sort(key=lambda each: each.length_m)
        return found if angle_rad > 0.0 else [_mirrored(each) for each in found]

    def _best(self, tried: _Tried, angle_rad: float, before_m: float, after_m: float) -> Iterator[Joint]:
        fits = tried.near & (tried.begin_m <= before_m) & (tried.end_m <= after_m)
        length_m = np.where(fits, tried.length_m, np.inf)
        best = length_m.argmin(axis=1)
        for row in np.argsort(length_m.min(axis=1), kind="stable")[:KEPT].tolist():
            column = int(best[row])
            if fits[row, column]:
                by = float(BACK_RAD[column])
                parts = Part(0.0, angle_rad + by), Part(float(tried.straight_m[row, column]), -by)
                stretches = Detour(0.0, parts).stretches(self._limits)
                yield Joint(float(tried.begin_m[row, 0]), float(tried.end_m[row, column]), stretches, "overshoot")

    def _tried(self, angle_rad: float) -> _Tried:
        """Return turns to the right that cross the next leg and come back onto it."""
        limits = self._limits
        earliest_m = max(self._max_m, tangent_m(min(angle_rad, SHARPEST_RAD), limits))
        begin_m: Array = np.linspace(0.0, earliest_m, BEGINS)[:, None]
        first, back = turned_m(angle_rad + BACK_RAD, limits), turned_m(-BACK_RAD, limits)
        # Along the next leg, and to the right of it, from the waypoint.
        crossed = (first - begin_m) * np.exp(-1j * angle_rad) + np.exp(1j * BACK_RAD) * back
        straight_m = -crossed.imag / np.sin(BACK_RAD)
        end_m = crossed.real + straight_m * np.cos(BACK_RAD)
        length_m = turn_length_m(angle_rad + BACK_RAD, limits) + turn_length_m(BACK_RAD, limits) + straight_m
        passed_m = np.abs(_first_turns(angle_rad, limits) - begin_m[:, :, None]).min(axis=2)
        near = (straight_m >= 0.0) & (end_m >= 0.0) & (np.minimum(passed_m, begin_m) <= self._max_m)
        return _Tried(begin_m, end_m, straight_m, length_m, near)


def _first_turns(angle_rad: float, limits: TurnLimits) -> Complex:
    """Return points (A, K) of the first turns, forward + i right of their begins, by the trapezium rule."""
    turns_rad = angle_rad + BACK_RAD[:, None]
    peak, transition_m, _ = turn_parts(turns_rad, limits)
    length_m = turn_length_m(turns_rad, limits)
    along_m = length_m * np.linspace(0.0, 1.0, SAMPLES + 1)
    from_end_m = np.minimum(along_m, length_m - along_m)
    share = np.minimum(from_end_m / transition_m, 1.0)
    turned = peak * (transition_m * share**3 * (1.0 - share / 2.0) + np.maximum(from_end_m - transition_m, 0.0))
    axes = np.exp(1j * np.where(along_m <= length_m / 2.0, turned, turns_rad - turned))
    steps = (axes[:, 1:] + axes[:, :-1]) / 2.0 * length_m / SAMPLES
    return np.concatenate((np.zeros((len(steps), 1)), np.cumsum(steps, axis=1)), axis=1)


def _backwards(joint: Joint) -> Joint:
    """Return the joint that is this one flown from its end, with left and right exchanged: at the same corner."""
    stretches = tuple(Stretch(length_m, end, begin) for length_m, begin, end in reversed(joint.stretches))
    return Joint(joint.after_m, joint.before_m, stretches, joint.kind)


def _mirrored(joint: Joint) -> Joint:
    return joint._replace(stretches=tuple(Stretch(length_m, -a, -b) for length_m, a, b in joint.stretches))

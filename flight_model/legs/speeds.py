"""The planned airspeed along a path: one a leg, and smooth changes where a leg begins.

A change follows Bloss's transition by the distance, v(u) = v0 + (v1 - v0) (3 u^2 - 2 u^3), so that speed and
acceleration are continuous. It begins with a leg, after the turn onto it, and is over before the next turn, which is so
flown at one speed. A leg that is too short for it is left at the speed that it had room for.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.legs.turn import STEEPEST

STEP_S = 0.5
"""Step by which distances are integrated while speeds change."""
MIN_MPS = 1e-3


class Change(NamedTuple):
    """A change of the airspeed that begins at a distance, from one speed to another over a length."""

    begin_m: float
    length_m: float
    from_mps: float
    to_mps: float


class SpeedChanges(NamedTuple):
    """How fast the airspeed may change: acceleration, the wind that may add to it over ground, and time constant.

    A change takes at least `min_s`, some time constants: setpoints lead the speed by one.
    """

    accel_mps2: float
    wind_mps: float
    min_s: float

    def length_m(self, from_mps: float, to_mps: float) -> float:
        """Return the distance that a change takes."""
        over_ground_mps = max(from_mps, to_mps) + self.wind_mps
        takes_s = max(STEEPEST * abs(to_mps - from_mps) / self.accel_mps2, self.min_s)
        return over_ground_mps * takes_s if to_mps != from_mps else 0.0


class SpeedProfile:
    """The airspeed by the distance along a path, m/s."""

    def __init__(self, begin_mps: float, changes: Sequence[Change] = ()) -> None:
        """Take the speed at the path's begin, and its changes in the order of the path, which don't overlap."""
        self.begin_mps = begin_mps
        self.changes = tuple(changes)
        self._begins_m = [each.begin_m for each in changes]

    def at(self, distance_m: float) -> tuple[float, float]:
        """Return the airspeed at a distance, and its derivative by the distance, 1/s."""
        index = bisect_right(self._begins_m, distance_m) - 1
        if index < 0:
            return self.begin_mps, 0.0
        begin_m, length_m, from_mps, to_mps = self.changes[index]
        share = (distance_m - begin_m) / length_m
        if share >= 1.0:
            return to_mps, 0.0
        by_mps = to_mps - from_mps
        return from_mps + by_mps * share**2 * (3.0 - 2.0 * share), by_mps * 6.0 * share * (1.0 - share) / length_m

    def at_each(self, distance_m: Array) -> Array:
        """Return the airspeeds at distances (K,), m/s."""
        speed_mps = np.full(np.shape(distance_m), self.begin_mps)
        for begin_m, length_m, from_mps, to_mps in self.changes:
            share = np.clip((distance_m - begin_m) / length_m, 0.0, 1.0)
            changed = from_mps + (to_mps - from_mps) * share**2 * (3.0 - 2.0 * share)
            speed_mps = np.where(distance_m >= begin_m, changed, speed_mps)
        return speed_mps

    def later_m(self, distance_m: float, seconds: float) -> float:
        """Return the distance that is reached after some time from another one, in still air, m.

        By the midpoint rule, in steps of `STEP_S` while speeds change.
        """
        if not self.changes or seconds <= 0.0:
            return distance_m + seconds * self.begin_mps
        steps = max(1, round(seconds / STEP_S))
        step_s = seconds / steps
        for _ in range(steps):
            middle_m = distance_m + self.at(distance_m)[0] * step_s / 2.0
            distance_m += self.at(middle_m)[0] * step_s
        return distance_m

    @property
    def speeds_mps(self) -> tuple[float, ...]:
        """The distinct speeds between changes, the first one's first."""
        return tuple(dict.fromkeys([self.begin_mps, *(each.to_mps for each in self.changes)]))

    def near(self, distance_m: Array, speed_mps: float) -> Mask:
        """Return the mask (K,) of distances at which a speed is flown, or is that at either end of a change."""
        found = np.zeros(np.shape(distance_m), dtype=np.bool_)
        ends_m = [*self._begins_m, np.inf]
        begin_m, flown_mps = -np.inf, self.begin_mps
        for change, until_m in zip((None, *self.changes), ends_m, strict=True):
            if change is not None:
                begin_m, flown_mps = change.begin_m + change.length_m, change.to_mps
                if speed_mps in change[2:]:
                    found |= (distance_m >= change.begin_m) & (distance_m <= begin_m)
            if flown_mps == speed_mps:
                found |= (distance_m >= begin_m) & (distance_m <= until_m)
        return found


def speed_profile(
    straights: Sequence[tuple[int, float, float]], legs_mps: Sequence[float], limits: SpeedChanges
) -> tuple[SpeedProfile, dict[int, float]]:
    """Return the airspeed along a path, and the speed reached on each leg that is too short for its own, by its index.

    Args:
        straights: legs that are flown straight, in order: index, and the distances where it begins and ends, m.
        legs_mps: the n - 1 legs' airspeeds; the path begins at the first one's.
        limits: of the changes.
    """
    now_mps, changes, short = legs_mps[0], list[Change](), dict[int, float]()
    for leg, begin_m, end_m in straights:
        wanted_mps = legs_mps[leg]
        if wanted_mps == now_mps:
            continue
        reached_mps = _reached(now_mps, wanted_mps, end_m - begin_m, limits)
        if reached_mps != wanted_mps:
            short[leg] = reached_mps
        if reached_mps != now_mps:
            changes.append(Change(begin_m, limits.length_m(now_mps, reached_mps), now_mps, reached_mps))
        now_mps = reached_mps
    return SpeedProfile(legs_mps[0], changes), short


def _reached(from_mps: float, to_mps: float, room_m: float, limits: SpeedChanges) -> float:
    """Return the speed nearest to the wanted one that a change within a length reaches, by bisection."""
    if limits.length_m(from_mps, to_mps) <= room_m:
        return to_mps
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = (low + high) / 2.0
        fits = limits.length_m(from_mps, from_mps + middle * (to_mps - from_mps)) <= room_m
        low, high = (middle, high) if fits else (low, middle)
    return from_mps + low * (to_mps - from_mps) if low > MIN_MPS else from_mps

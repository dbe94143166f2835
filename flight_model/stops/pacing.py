"""Speeds along a path whose ends, corners and stops each allow one: changes between them are smooth and bounded.

A change follows Bloss's transition by the time, v(t) = v0 + (v1 - v0) (3 u^2 - 2 u^3), u = t / T: speed and
acceleration are continuous, and a standstill is left in finite time, which a speed given by the distance can't.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from flight_model.legs.turn import STEEPEST

HALVINGS = 40
NO_CHANGE_MPS = 1e-6
"""Speeds that differ by less are the same."""


class Rates(NamedTuple):
    """How fast a speed may change: the largest acceleration, and the shortest duration of a change."""

    accel_mps2: float
    min_s: float

    def duration_s(self, from_mps: float, to_mps: float) -> float:
        """Return how long a change takes."""
        by_mps = abs(to_mps - from_mps)
        return max(STEEPEST * by_mps / self.accel_mps2, self.min_s) if by_mps > NO_CHANGE_MPS else 0.0

    def length_m(self, from_mps: float, to_mps: float) -> float:
        """Return the distance that a change takes: its mean speed is that of both ends."""
        return (from_mps + to_mps) / 2.0 * self.duration_s(from_mps, to_mps)

    def reached_mps(self, from_mps: float, to_mps: float, room_m: float) -> float:
        """Return the speed nearest to another one that a change within a length reaches."""
        if self.length_m(from_mps, to_mps) <= room_m:
            return to_mps
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = (low + high) / 2.0
            fits = self.length_m(from_mps, from_mps + middle * (to_mps - from_mps)) <= room_m
            low, high = (middle, high) if fits else (low, middle)
        return from_mps + low * (to_mps - from_mps)


def attainable(allowed_mps: Sequence[float], straights_m: Sequence[float], rates: Rates) -> list[float]:
    """Return the highest speeds (n,) at points with straights (n - 1,) between them, m, that changes can connect.

    None is higher than allowed there (n,); the first one is as given, whatever can be reached from it.
    """
    speeds = list(allowed_mps)
    for at, room_m in enumerate(straights_m):
        if speeds[at] < speeds[at + 1]:
            speeds[at + 1] = rates.reached_mps(speeds[at], speeds[at + 1], room_m)
    for at in range(len(straights_m) - 1, 0, -1):
        if speeds[at + 1] < speeds[at]:
            speeds[at] = rates.reached_mps(speeds[at + 1], speeds[at], straights_m[at])
    return speeds


def between(from_mps: float, to_mps: float, wanted_mps: float, room_m: float, rates: Rates) -> float:
    """Return the highest speed up to a wanted one that a straight has room to reach and to leave again."""
    low, high = max(from_mps, to_mps), max(wanted_mps, from_mps, to_mps)

    def fits(speed_mps: float) -> bool:
        return rates.length_m(from_mps, speed_mps) + rates.length_m(speed_mps, to_mps) <= room_m

    if fits(high):
        return high
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low

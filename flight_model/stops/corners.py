"""How fast a formation that can hover passes each waypoint: as fast as the corner has room for, or with a stop.

The radius of a corner follows from the speed at which it is flown, so a sharp corner, or one between short legs, is
flown slowly. Where it would have to be slower than `SLOWEST_MPS`, the formation stops at the waypoint and turns there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Complex
from flight_model.legs.joint import STRAIGHT_RAD, Corner, fly_by
from flight_model.legs.turn import TurnLimits
from flight_model.stops.pacing import Rates, attainable

SHARES = (1.0, 0.85, 0.7, 0.55, 0.45, 0.35, 0.25)
"""Shares of the legs' speed at which a corner is tried to be flown."""
SLOWEST_MPS = 2.0
"""Slowest corner: below this speed the course, by which slots lie, is uncertain."""
LEG_SHARE = 0.5
"""Share of a leg that one of the corners at its ends may take."""


class Pass(NamedTuple):
    """How a waypoint is passed: at most at a speed, 0 for a stop, in a turn that takes so much of both legs."""

    speed_mps: float
    limits: TurnLimits | None = None
    takes_m: float = 0.0


class Corners:
    """Chooses how waypoints are passed."""

    def __init__(
        self,
        waypoints: Complex,
        legs_mps: Sequence[float],
        limits_at: Callable[[float], TurnLimits],
        rates: Rates,
        max_m: float,
    ) -> None:
        """Take what corners depend on.

        Args:
            waypoints: (n,) north + i east, m.
            legs_mps: (n - 1,) wanted speeds of the legs.
            limits_at: the tightest turn at a speed.
            rates: of the changes of speed.
            max_m: farthest that a turn may pass from its waypoint.
        """
        self._waypoints, self._legs_mps, self._limits_at = waypoints, legs_mps, limits_at
        self._rates, self._max_m = rates, max_m
        self._courses: list[float] = np.angle(np.diff(waypoints)).tolist()
        self._lengths_m: list[float] = np.abs(np.diff(waypoints)).tolist()

    def chosen(self, stops: Set[int], given: Set[int]) -> list[Pass]:
        """Return how the waypoints but the first and the last are passed.

        Args:
            stops: waypoints at which the formation is to stop.
            given: waypoints that are passed in another way, such as circles, at their leg's speed.
        """
        inside, stops = range(1, len(self._waypoints) - 1), set(stops)
        while True:
            found = [self._passed(index, stops, given) for index in inside]
            slow = {
                index
                for index, speed_mps in zip(inside, self._flown_mps(found), strict=True)
                if index not in stops and index not in given and speed_mps < min(SLOWEST_MPS, self._leg_mps(index))
            }
            if not slow:
                return found
            stops |= slow

    def _leg_mps(self, index: int) -> float:
        return min(self._legs_mps[index - 1 : index + 1])

    def _passed(self, index: int, stops: Set[int], given: Set[int]) -> Pass:
        leg_mps = self._leg_mps(index)
        if index in stops:
            return Pass(0.0)
        if index in given:
            return Pass(leg_mps, self._limits_at(leg_mps))
        corner = Corner(self._courses[index - 1], self._courses[index], (complex(self._waypoints[index]),))
        for speed_mps in (share * leg_mps for share in SHARES):
            if speed_mps < min(SLOWEST_MPS, leg_mps):
                break
            limits = self._limits_at(speed_mps)
            joint = fly_by(corner, limits, self._max_m)
            if joint is not None and joint.before_m <= self._room_m(index, speed_mps, stops):
                return Pass(leg_mps if abs(corner.angle_rad) < STRAIGHT_RAD else speed_mps, limits, joint.before_m)
        return Pass(0.0)

    def _room_m(self, index: int, speed_mps: float, stops: Set[int]) -> float:
        """Return how much of both legs a corner at a speed may take: up to a stop the rest is for the change."""
        ends = {0, len(self._waypoints) - 1} | stops
        change_m = self._rates.length_m(0.0, speed_mps)
        rooms_m = (
            self._lengths_m[leg] - (change_m if other in stops else 0.0)
            if other in ends
            else LEG_SHARE * self._lengths_m[leg]
            for leg, other in ((index - 1, index - 1), (index, index + 1))
        )
        return min(rooms_m)

    def _flown_mps(self, found: Sequence[Pass]) -> list[float]:
        """Return the speeds that changes between the waypoints can reach."""
        takes_m = [0.0, *(each.takes_m for each in found), 0.0]
        straights_m = [length_m - takes_m[leg] - takes_m[leg + 1] for leg, length_m in enumerate(self._lengths_m)]
        allowed_mps = [self._legs_mps[0], *(each.speed_mps for each in found), self._legs_mps[-1]]
        return attainable(allowed_mps, straights_m, self._rates)[1:-1]

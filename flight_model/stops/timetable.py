"""When the leader is where on a path with stops: its planned speed, as a function of the time.

It takes the place of a `SpeedProfile`, which is a function of the distance: a speed of 0 has no distance by which it
would end.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.legs.speeds import Change, SpeedProfile
from flight_model.stops.pacing import NO_CHANGE_MPS, Rates, attainable, between

SETTLE_S = 2.0
"""How long the leader is led to the point of a stop before it hovers there."""
NEWTON_STEPS = 30
ALMOST_S = 1e-9
MIN_S = 1e-6
"""Pieces shorter than this are none."""
HOVER_MPS = 1e-3
"""Below this a speed has no derivative by the distance that means anything."""


class Passage(NamedTuple):
    """How the leader passes a point of its path: between two distances at most at a speed; 0: it stops there."""

    begin_m: float
    end_m: float
    max_mps: float
    hold_s: float = 0.0
    """Of a stop: how long it hovers before it turns."""
    turn_s: float = 0.0
    """How long it turns in place."""
    from_rad: float = 0.0
    by_rad: float = 0.0
    """Course before the turn in place, and the angle of that, clockwise positive."""
    waypoint: int = 0

    @property
    def stops(self) -> bool:
        """Whether it is a stop."""
        return self.max_mps == 0.0

    @property
    def pause_s(self) -> float:
        """How long a stop lasts."""
        return SETTLE_S + self.hold_s + self.turn_s


class Piece(NamedTuple):
    """A part of the timetable in which the speed changes from one to another, is constant, or is 0."""

    begin_s: float
    begin_m: float
    duration_s: float
    from_mps: float
    to_mps: float

    def after(self, seconds: float) -> tuple[float, float, float]:
        """Return distance, speed and acceleration some time after its begin."""
        u, by_mps = min(seconds / self.duration_s, 1.0), self.to_mps - self.from_mps
        distance_m = self.begin_m + self.from_mps * seconds + by_mps * self.duration_s * u**3 * (1.0 - u / 2.0)
        speed_mps = self.from_mps + by_mps * u**2 * (3.0 - 2.0 * u)
        return distance_m, speed_mps, by_mps * 6.0 * u * (1.0 - u) / self.duration_s

    @property
    def length_m(self) -> float:
        """Length of its part of the path."""
        return (self.from_mps + self.to_mps) / 2.0 * self.duration_s


class Pause(NamedTuple):
    """When a stop is made."""

    passage: Passage
    begin_s: float
    end_s: float


class Timetable(SpeedProfile):
    """Planned distances, speeds and accelerations along a path by the time since its begin."""

    def __init__(
        self, begin_mps: float, legs_mps: Sequence[float], passages: Sequence[Passage], length_m: float, rates: Rates
    ) -> None:
        """Take how the path is passed between its begin and its end.

        Args:
            begin_mps: the speed at which the path is begun.
            legs_mps: wanted on the straights before, between and after the passages, one more than these.
            passages: in the order of the path.
            length_m: of the path.
            rates: of the changes.
        """
        self.passages, self.legs_mps, self._length_m = tuple(passages), tuple(legs_mps), length_m
        ends_m = [0.0, *(each.end_m for each in passages)]
        begins_m = [*(each.begin_m for each in passages), length_m]
        straights_m = [max(begin - end, 0.0) for end, begin in zip(ends_m, begins_m, strict=True)]
        max_mps = [min(each.max_mps, *legs_mps[index : index + 2]) for index, each in enumerate(passages)]
        speeds = attainable([begin_mps, *max_mps, legs_mps[-1]], straights_m, rates)
        self.lacks_m = max(rates.length_m(begin_mps, speeds[1]) - straights_m[0], 0.0)
        """How much longer the first straight would have to be to brake from the speed at which the path is begun."""
        self._rates, self._pieces, self.pauses = rates, list[Piece](), list[Pause]()
        self.cruises_mps = list[float]()
        """What is reached of the wanted speed on each straight."""
        self.flown = list(zip(passages, speeds[1:-1], strict=True))
        """Each passage, and the speed at which it is flown."""
        self._at_s = self._at_m = 0.0
        for index, (room_m, wanted_mps) in enumerate(zip(straights_m, legs_mps, strict=True)):
            self._straight(speeds[index], speeds[index + 1], wanted_mps, room_m, rates)
            if index < len(passages):
                self._pass(passages[index], speeds[index + 1])
        self.pieces = tuple(self._pieces)
        self._begins_s, self._starts_m = [each.begin_s for each in self.pieces], [each.begin_m for each in self.pieces]
        self.stops, self._ends_s = [each.passage for each in self.pauses], [each.end_s for each in self.pauses]
        self.end_s, self.end_mps = self._at_s, speeds[-1]
        flown = [each for each in self.pieces if abs(each.to_mps - each.from_mps) > NO_CHANGE_MPS]
        changes = [Change(each.begin_m, max(each.length_m, MIN_S), each.from_mps, each.to_mps) for each in flown]
        super().__init__(begin_mps, changes)

    def passed(self, seconds: float) -> int:
        """Return how many stops are over at a time."""
        return bisect_right(self._ends_s, seconds)

    def pause_at(self, seconds: float) -> Pause | None:
        """Return the stop that is made at a time; None if there is none, or the time isn't known."""
        index = self.passed(seconds)
        return self.pauses[index] if index < len(self.pauses) and self.pauses[index].begin_s <= seconds else None

    def at_speed(self, speed_mps: float) -> Timetable:
        """Return the timetable of the same path at another speed of all legs."""
        return Timetable(speed_mps, [speed_mps] * len(self.legs_mps), self.passages, self._length_m, self._rates)

    def _add(self, duration_s: float, from_mps: float, to_mps: float) -> None:
        if duration_s > MIN_S:
            piece = Piece(self._at_s, self._at_m, duration_s, from_mps, to_mps)
            self._pieces.append(piece)
            self._at_s, self._at_m = self._at_s + duration_s, self._at_m + piece.length_m

    def _straight(self, from_mps: float, to_mps: float, wanted_mps: float, room_m: float, rates: Rates) -> None:
        cruise_mps = between(from_mps, to_mps, wanted_mps, room_m, rates)
        self.cruises_mps.append(cruise_mps)
        left_m = room_m - rates.length_m(from_mps, cruise_mps) - rates.length_m(cruise_mps, to_mps)
        self._change(from_mps, cruise_mps, room_m, rates)
        if left_m > 0.0 and cruise_mps > 0.0:
            self._add(left_m / cruise_mps, cruise_mps, cruise_mps)
        self._change(cruise_mps, to_mps, room_m, rates)

    def _change(self, from_mps: float, to_mps: float, room_m: float, rates: Rates) -> None:
        """Change the speed; where the path begins too near to a corner, faster than at the rates."""
        length_m = rates.length_m(from_mps, to_mps)
        if length_m > 0.0:
            self._add(rates.duration_s(from_mps, to_mps) * min(1.0, room_m / length_m), from_mps, to_mps)

    def _pass(self, passage: Passage, speed_mps: float) -> None:
        self._at_m = passage.begin_m  # no rounding adds up
        if passage.stops:
            self.pauses.append(Pause(passage, self._at_s, self._at_s + passage.pause_s))
            self._add(passage.pause_s, 0.0, 0.0)
        elif passage.end_m > passage.begin_m:
            self._add((passage.end_m - passage.begin_m) / speed_mps, speed_mps, speed_mps)
        self._at_m = passage.end_m

    def after(self, seconds: float) -> tuple[float, float, float]:
        """Return distance, speed and acceleration some time after the path's begin."""
        if seconds < 0.0 or not self.pieces:
            return seconds * self.begin_mps, self.begin_mps, 0.0
        if seconds >= self.end_s:
            return self._length_m + (seconds - self.end_s) * self.end_mps, self.end_mps, 0.0
        piece = self.pieces[max(bisect_right(self._begins_s, seconds) - 1, 0)]
        return piece.after(seconds - piece.begin_s)

    def when_s(self, distance_m: float) -> float:
        """Return the first time at which a distance is reached."""
        if distance_m <= 0.0 or not self.pieces:
            return distance_m / self.begin_mps
        if distance_m >= self._length_m:
            return self.end_s + (distance_m - self._length_m) / max(self.end_mps, HOVER_MPS)
        index = max(bisect_right(self._starts_m, distance_m) - 1, 0)
        while index > 0 and self.pieces[index].begin_m >= distance_m - ALMOST_S:
            index -= 1
        piece = self.pieces[index]
        low, high = 0.0, piece.duration_s
        for _ in range(NEWTON_STEPS):
            middle = (low + high) / 2.0
            low, high = (middle, high) if piece.after(middle)[0] < distance_m else (low, middle)
        return piece.begin_s + high

    def at(self, distance_m: float) -> tuple[float, float]:
        """Return the airspeed at a distance, and its derivative by the distance, 1/s; at a stop 0."""
        _, speed_mps, accel_mps2 = self.after(self.when_s(distance_m))
        return speed_mps, accel_mps2 / speed_mps if speed_mps > HOVER_MPS else 0.0

    def at_each(self, distance_m: Array) -> Array:
        """Return the airspeeds at distances (K,), m/s."""
        flat = np.ravel(distance_m).tolist()
        return np.array([self.at(each)[0] for each in flat]).reshape(np.shape(distance_m))

    def later_m(self, distance_m: float, seconds: float) -> float:
        """Return the distance that is reached after some time from another one, m."""
        return self.after(self.when_s(distance_m) + seconds)[0] if seconds > 0.0 else distance_m

    def progress(self) -> tuple[Array, Array]:
        """Return distances (K,), m, and when each is reached, s; a stop is there twice."""
        times = [np.linspace(each.begin_s, each.begin_s + each.duration_s, 9) for each in self.pieces]
        at_s = np.unique(np.concatenate([np.zeros(1), *times, np.array([self.end_s])]))
        return np.array([self.after(each)[0] for each in at_s.tolist()]), at_s

    @property
    def speeds_mps(self) -> tuple[float, ...]:
        """The distinct speeds at which straights and corners are planned to be flown, the first one's first."""
        corners = [each.max_mps for each in self.passages if not each.stops]
        return tuple(dict.fromkeys([self.begin_mps, *self.legs_mps, *corners]))

    def near(self, distance_m: Array, speed_mps: float) -> Mask:
        """Return the mask (K,) of distances at which a speed is planned: in a corner its own, else that of the leg."""
        begins_m = [-np.inf, *(each.end_m for each in self.passages)]
        ends_m = [*(each.begin_m for each in self.passages), np.inf]
        found = np.zeros(np.shape(distance_m), dtype=np.bool_)
        for begin_m, end_m, leg_mps in zip(begins_m, ends_m, self.legs_mps, strict=True):
            if leg_mps == speed_mps:
                found |= (distance_m >= begin_m) & (distance_m <= end_m)
        for each in self.passages:
            if each.max_mps == speed_mps:
                found |= (distance_m >= each.begin_m) & (distance_m <= each.end_m)
        return found

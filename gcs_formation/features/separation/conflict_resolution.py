"""Decides which vehicles manoeuvre, and how: a predictive filter of setpoints with safe manoeuvres in reserve.

A setpoint passes if, after it has acted, a manoeuvre is left that keeps every distance over the whole horizon; if none
is, such a manoeuvre is flown now. See docs/separation.md for sources and consequences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flight_model.arrays import Array, Indices, Mask, any_of
from flight_model.vehicle_arrays import Setpoints
from gcs_formation.features.separation.approach import (
    ClosestApproach,
    Manoeuvre,
    MinimumDistance,
    approach,
    fly,
    fly_level,
    may_come_near,
)
from gcs_formation.features.separation.traffic import (
    AS_COMMANDED,
    TrafficPicture,
    free_heights,
    possible_pairs,
    take_height,
)

RELEASE = 1.1
"""A vehicle stops manoeuvring once it would keep this many times the minimum distance without. Tuned: ratio; 1.05 to
1.3; shown by `pytest tests/gcs_formation/features/separation`."""
RETURN_S = 4.0
"""How long a multirotor's path back to its slot must be clear before it stops manoeuvring. Tuned: s; 2 to 8; by
judgement."""
NEGLIGIBLE_M_S = 1e-6
HELPED_BELOW = 0.9
"""If the best trajectory keeps less than this share of the minimum distance, the vehicle with precedence manoeuvres
too. The margin allows for prediction errors. Tuned: share; 0.8 to 1; shown by `pytest
tests/gcs_formation/features/separation`."""
HEIGHTS_MAX = 8
"""Largest number of heights that are tried for one vehicle. Tuned: heights; 4 to 16; shown by `python -m
benchmarks.features.separation`."""
SWEEPS = 2
"""How often all vehicles choose in turn: later ones may make room for earlier ones. Tuned: sweeps; 1 to 4; shown by
`python -m benchmarks.features.separation`."""


@dataclass(frozen=True)
class Conflict:
    """A vehicle that manoeuvres, another, and their closest approach if it didn't."""

    vehicle: int
    other: int
    nearest_m: float
    in_s: float


@dataclass(frozen=True)
class Resolution:
    """The rule's decision at one tick."""

    setpoints: Setpoints
    side: Array
    """(N,) input of the next tick: 1 for vehicles that pass above the others, -1 below, 0 if they don't manoeuvre."""
    conflicts: tuple[Conflict, ...]


def resolve(picture: TrafficPicture, side: Array) -> Resolution:
    """Return setpoints that keep the distances; a vehicle that needn't manoeuvre keeps exactly its own.

    `side` is that of the last tick's resolution, (N,).
    """
    one, other = possible_pairs(picture)
    if not any_of(side != 0) and not any_of(_near_level(picture, one, other)):
        return Resolution(picture.setpoints, side, ())
    return _Search(picture, side, one, other).resolution()


def _near_level(picture: TrafficPicture, one: Indices, other: Indices) -> Mask:
    """Return which pairs come too near as commanded, seen from above; the others are apart whatever their heights."""
    if not one.size:
        return np.zeros(0, dtype=bool)
    which, inverse = np.unique(np.concatenate((one, other)), return_inverse=True)
    trajectories = fly_level(picture.traffic.select(which), picture.as_commanded().select(which), picture.times_s)
    first, second = trajectories[:, :, inverse[: one.size]], trajectories[:, :, inverse[one.size :]]
    return approach(first, second, picture.minimum(one, other), picture.times_s).deficit_m_s > NEGLIGIBLE_M_S


class _Search:
    """One tick's search, vehicle by vehicle."""

    def __init__(self, picture: TrafficPicture, side: Array, one: Indices, other: Indices) -> None:
        self._picture = picture
        self._side = side.copy()
        self._before = side != 0
        self._manoeuvre = picture.as_commanded()
        self._trajectories = fly(picture.traffic, self._manoeuvre, picture.times_s, picture.trails_m)
        self._conflicts: dict[int, tuple[Conflict, ...]] = {}
        near = approach(
            self._trajectories[:, :, one], self._trajectories[:, :, other], picture.minimum(one, other), picture.times_s
        )
        bad = near.deficit_m_s > NEGLIGIBLE_M_S
        self._waiting = {self._second(i, j) for i, j in zip(one[bad].tolist(), other[bad].tolist(), strict=True)}
        self._waiting |= set(np.flatnonzero(self._before & picture.commanded).tolist())

    def resolution(self) -> Resolution:
        self._side[~self._picture.commanded] = 0.0
        for _ in range(SWEEPS):
            if not self._sweep():
                break
        setpoints, yielding = self._picture.setpoints.table.copy(), self._side != 0
        setpoints[:, yielding] = self._manoeuvre.first.table[:, yielding]
        found = [
            conflict for vehicle, each in sorted(self._conflicts.items()) if yielding[vehicle] for conflict in each
        ]
        return Resolution(Setpoints.of(setpoints), self._side, tuple(found))

    def _second(self, i: int, j: int) -> int:
        """Return which of a pair manoeuvres first: the later one, if it is commanded."""
        return j if self._picture.commanded[j] else i

    def _sweep(self) -> bool:
        """Choose the trajectories of all waiting vehicles, the last first; return whether any found no safe one."""
        waiting, done, unsafe = set(self._waiting), set[int](), False
        while waiting:
            vehicle = max(waiting)
            waiting.remove(vehicle)
            done.add(vehicle)
            endangered = self._choose(vehicle)
            unsafe = unsafe or bool(endangered)
            waiting |= {i for i in endangered if self._picture.commanded[i]} - done
        self._waiting |= done
        return unsafe

    def _choose(self, vehicle: int) -> list[int]:
        """Choose a vehicle's trajectory; return the others that it still comes too near to."""
        picture, others = self._picture, self._neighbours(vehicle)
        plain = self._plain(vehicle)
        near = self._approach(vehicle, plain, others, RELEASE)
        conflicting = near.deficit_m_s.max(axis=0, initial=0.0) > NEGLIGIBLE_M_S
        self._conflicts[vehicle] = _conflicts(vehicle, others, near, conflicting)
        heights = free_heights(
            picture, vehicle, others[conflicting], self._trajectories[2, -1, others[conflicting]], self._side[vehicle]
        )[:HEIGHTS_MAX]
        escapes = take_height(picture, vehicle, heights)
        waits = self._passing(vehicle, plain, escapes, heights)
        manoeuvres = self._manoeuvring(vehicle, escapes)
        options = _joined(waits, manoeuvres)
        comes = self._approach(vehicle, options, others, 1.0)
        total = comes.deficit_m_s.sum(axis=1)
        held_back = waits.height_m.size if self._before[vehicle] and not self._released(vehicle, others, near) else 0
        total[:held_back] = np.inf
        safe = np.flatnonzero(total <= NEGLIGIBLE_M_S)
        chosen = self._mildest(options, safe, waits.height_m.size) if safe.size else int(np.argmin(total))
        self._adopt(vehicle, options.select(np.array([chosen])), yielding=chosen >= waits.height_m.size)
        return others[comes.nearest_m[chosen] < HELPED_BELOW * self._minimum(vehicle, others).distance_m].tolist()

    def _mildest(self, options: Manoeuvre, safe: Indices, waiting: int) -> int:
        """Return the first safe option; if it manoeuvres at once, the first one within the fence's heights if any."""
        if safe[0] < waiting:
            return int(safe[0])
        height_m, (min_m, max_m) = options.height_m[safe], self._picture.heights_m
        return int(safe[int(((height_m < min_m) | (height_m > max_m)).argmin())])

    def _released(self, vehicle: int, others: Indices, near: ClosestApproach) -> bool:
        """Return whether a vehicle may end a manoeuvre: as commanded and then straight on, it keeps well clear of all.

        A multirotor's path back to its slot must also be clear of uncommanded vehicles for a while: else it would move
        to and fro in front of them.
        """
        if (near.deficit_m_s[1] > NEGLIGIBLE_M_S).any():
            return False
        free = others[~self._picture.commanded[others]] if self._picture.traffic.hovers else others[:0]
        if not free.size:
            return True
        unchanged, times_s = self._picture.setpoints.select(np.array([vehicle])), self._picture.times_s
        soon = times_s <= RETURN_S
        back = fly_level(
            self._picture.traffic.select(np.array([vehicle])),
            Manoeuvre(unchanged, unchanged.speed_mps, unchanged.heading_rad, unchanged.height_m),
            times_s[soon],
        )
        trajectories = np.repeat(back, free.size, axis=2), self._trajectories[:2, soon][:, :, free]
        return not (
            approach(*trajectories, self._minimum(vehicle, free), times_s[soon]).deficit_m_s > NEGLIGIBLE_M_S
        ).any()

    def _plain(self, vehicle: int) -> Manoeuvre:
        """Return the two trajectories without a manoeuvre: as commanded, then as the reference or straight on."""
        which = np.array([vehicle])
        setpoints, (speed_mps, heading_rad) = self._picture.setpoints.select(which), self._picture.lasting(vehicle)
        along = Manoeuvre(setpoints, np.array([speed_mps]), np.array([heading_rad]), setpoints.height_m)
        return _joined(along, self._picture.straight(which))

    def _passing(self, vehicle: int, plain: Manoeuvre, escapes: Manoeuvre, heights: Array) -> Manoeuvre:
        """Return the trajectories that begin as commanded: the plain ones, and those that manoeuvre later."""
        setpoints = self._picture.setpoints.table[:, [vehicle]]
        courses = escapes.height_m.size // max(heights.size, 1)
        later = escapes.table.reshape(6, heights.size, courses)[:, :, :AS_COMMANDED].reshape(6, -1)
        later[:3] = setpoints
        return _joined(plain, Manoeuvre.of(later))

    def _manoeuvring(self, vehicle: int, escapes: Manoeuvre) -> Manoeuvre:
        """Return those that manoeuvre at once: at other heights first, for multirotors at the commanded one first."""
        level = take_height(self._picture, vehicle, self._picture.setpoints.height_m[[vehicle]])
        level = level.select(np.arange(AS_COMMANDED, level.height_m.size))
        return _joined(level, escapes) if self._picture.traffic.hovers else _joined(escapes, level)

    def _adopt(self, vehicle: int, chosen: Manoeuvre, *, yielding: bool) -> None:
        which = np.array([vehicle])
        self._manoeuvre.table[:, which] = chosen.table
        self._trajectories[:, :, which] = self._fly(which, chosen)
        upwards = chosen.height_m[0] >= self._picture.setpoints.height_m[vehicle]
        self._side[vehicle] = 0.0 if not yielding else (1.0 if upwards else -1.0)

    def _neighbours(self, vehicle: int) -> Indices:
        """Return the others that any trajectory of a vehicle could bring too near, whatever their heights.

        Each of its trajectories follows one of its courses, and the others' trajectories are known. The test uses the
        bounding boxes of these, step by step in a frame that moves with the reference.
        """
        picture = self._picture
        courses = take_height(picture, vehicle, picture.setpoints.height_m[[vehicle]])
        which = np.full(courses.height_m.size, vehicle, dtype=np.intp)
        moved = picture.reference_mps[:, None] * picture.times_s[:, None]
        ours = fly_level(picture.traffic.select(which), courses, picture.times_s) - moved
        others = np.delete(np.arange(picture.commanded.size, dtype=np.intp), vehicle)
        theirs = self._trajectories[:2, :, others] - moved
        return others[may_come_near(ours, theirs, self._minimum(vehicle, others).times(RELEASE), picture.times_s)]

    def _fly(self, which: Indices, manoeuvre: Manoeuvre) -> Array:
        picture = self._picture
        return fly(picture.traffic.select(which), manoeuvre, picture.times_s, picture.trails_m[which])

    def _minimum(self, vehicle: int, others: Indices) -> MinimumDistance:
        return self._picture.minimum(np.full(others.size, vehicle, dtype=np.intp), others)

    def _approach(self, vehicle: int, options: Manoeuvre, others: Indices, share: float) -> ClosestApproach:
        """Return the closest approach of each of a vehicle's options (M,) to each of the others: (M, O) arrays."""
        picture, count = self._picture, options.height_m.size
        which = np.full(count, vehicle, dtype=np.intp)
        trajectories = np.repeat(self._fly(which, options), others.size, axis=2)
        minimum = MinimumDistance(*(np.tile(values, count) for values in self._minimum(vehicle, others).times(share)))
        near = approach(trajectories, np.tile(self._trajectories[:, :, others], count), minimum, picture.times_s)
        return ClosestApproach(*(values.reshape(count, others.size) for values in near))


def _conflicts(vehicle: int, others: Indices, near: ClosestApproach, conflicting: Mask) -> tuple[Conflict, ...]:
    """Return a vehicle's conflicts, each on that of its plain trajectories which comes nearer to the other."""
    trajectory = np.argmin(near.nearest_m, axis=0)
    found: list[Conflict] = []
    for index in np.flatnonzero(conflicting).tolist():
        row = trajectory[index], index
        found.append(Conflict(vehicle, int(others[index]), float(near.nearest_m[row]), float(near.in_s[row])))
    return tuple(found)


def _joined(*manoeuvres: Manoeuvre) -> Manoeuvre:
    return Manoeuvre.of(np.concatenate([each.table for each in manoeuvres], axis=1))

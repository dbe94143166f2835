"""The joints of all legs: fly-by turns where they fit, and where they don't, the shortest path that does.

A turn that would pass too far from its waypoint overshoots one of its legs, or is a detour, unless these have no room
inside the fence. Where the turns at both ends of a leg need more than its length, these are compared: in place of one
of them or of both turns that overshoot, or detours, which leave a leg at its waypoint and come back to the next leg
there; one turn in place of both; and between lanes that are nearer than a turn back is wide, one detour from lane to
lane. Circles around a waypoint are given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from flight_model.arrays import TURN, Array, Complex
from flight_model.legs.detour import Detours
from flight_model.legs.joint import Corner, Joint, courses_rad, distances_m, fly_by, fly_over, off_legs_m, points
from flight_model.legs.overshoot import Overshoots
from flight_model.legs.turn import Stretch, TurnLimits, turned_m

Lack = Callable[[Complex, Array], float]
"""How much room a path lacks: points (K,), north + i east, and courses (K,), rad -> m, 0 if it has enough."""
ROOM_STEP_M = 20.0
ENOUGH_M = 1e-6
NEARER_M = 1.0
"""A detour that is nearer to the legs by less isn't preferred to a shorter one."""
LONGER_CIRCLES = 3.0
"""How much longer than the shortest detour one may be that has more room, in circles of the tightest radius."""
REVERSAL_RAD = math.radians(150.0)
"""Legs that differ by more in their course are lanes: both are flown whole, with a detour from one to the other."""


@dataclass(frozen=True)
class TurnRules:
    """How waypoints are passed: within `max_m` of the turn (fly-by), or over them, in turns within the limits.

    `limits` are those of each leg (n - 1,), which differ with its speed; a joint is flown at that of the leg before.
    Of detours that have room the shortest is flown, or with `near` the one that stays nearest to the legs.
    `known` keeps detours by their limits: paths that differ in some waypoints share the others' detours.
    """

    limits: Sequence[TurnLimits]
    max_m: float
    over: bool = False
    lack: Lack | None = None
    known: dict[TurnLimits, Detours] = field(default_factory=dict[TurnLimits, Detours])
    near: bool = False


class Placed(NamedTuple):
    """A joint in place of the turns at waypoints `first` to `last`.

    It lacks so much room, and passes so much farther than allowed from waypoints between them. `off_m`: how far it goes
    from the legs, of a detour where nearness counts.
    """

    first: int
    last: int
    joint: Joint
    lack_m: float = 0.0
    missed_m: float = 0.0
    off_m: float = 0.0


class Joiner:
    """Finds the joints of legs between waypoints."""

    def __init__(self, waypoints: Complex, rules: TurnRules, given: Mapping[int, Joint] = MappingProxyType({})) -> None:
        """Take the waypoints (n,), north + i east, m, and joints from one of them to the next one, by its index."""
        self._waypoints, self._rules, self._given = waypoints, rules, given
        legs = np.diff(waypoints)
        self._lengths_m: list[float] = np.abs(legs).tolist()
        self._courses: list[float] = np.angle(legs).tolist()
        self._overshoots = dict[TurnLimits, Overshoots]()
        self._placed = dict[tuple[int, int], Placed]()

    def joints(self) -> list[Placed]:
        """Return the joints along the legs, one after another, such that each leg has room for those at its ends."""
        inside = range(1, len(self._waypoints) - 1)
        found = [self._first_choice(index) for index in inside if index - 1 not in self._given]
        slack = [self._slack_m(found, at) for at in range(len(found) + 1)]
        while slack and min(slack) < -ENOUGH_M:
            at = slack.index(min(slack))
            begin, end = max(at - 1, 0), min(at + 1, len(found))
            chosen = self._chosen(found, begin, end)
            found[begin:end] = chosen
            first, last = max(begin - 1, 0), begin + len(chosen) + 1
            slack[begin : end + 1] = [0.0] * (len(chosen) + 1)
            for each in range(first, min(last + 1, len(found) + 1)):
                slack[each] = self._slack_m(found, each)
        return found

    def _first_choice(self, index: int) -> Placed:
        if index in self._given:
            return Placed(index, index + 1, self._given[index])
        corner, limits = self._corner(index, index), self._limits(index)
        joint = fly_over(corner, limits) if self._rules.over else fly_by(corner, limits, self._rules.max_m)
        if joint is not None:
            return Placed(index, index, joint)
        sharp = abs(corner.angle_rad) > REVERSAL_RAD
        around = self._overshooting(index, self._lengths_m[index - 1], self._lengths_m[index])
        if around and around[0].lack_m == 0.0 and not sharp:
            return around[0]
        best = min([self._detour(index, index), *around], key=lambda each: each.lack_m)
        wide = fly_by(corner, limits, math.inf) if best.lack_m > 0.0 else None
        if wide is None:
            return best
        missed_m = float(distances_m(corner, wide).max()) - self._rules.max_m
        lack_m = self._lack_m(corner, wide.stretches, wide.before_m)
        return min(best, Placed(index, index, wide, lack_m, missed_m), key=lambda each: each.lack_m)

    def _overshooting(self, index: int, before_m: float, after_m: float) -> list[Placed]:
        """Return turns at a waypoint that overshoot one of its legs, and take no more than given of both.

        The shortest of those that lack the least room is the first.
        """
        if self._rules.over:
            return []
        corner, limits = self._corner(index, index), self._limits(index)
        found = self._overshoots.setdefault(limits, Overshoots(limits, self._rules.max_m))
        joints = found.at(corner.angle_rad, before_m, after_m)
        placed = [Placed(index, index, each, self._lack_m(corner, each.stretches, each.before_m)) for each in joints]
        return sorted(placed, key=lambda each: each.lack_m)

    def _slack_m(self, found: list[Placed], at: int) -> float:
        """Return how much of the leg before joint `at` is left between the joints at its ends."""
        before = found[at - 1] if at > 0 else None
        after = found[at] if at < len(found) else None
        leg = before.last if before is not None else 0
        taken_m = (before.joint.after_m if before else 0.0) + (after.joint.before_m if after else 0.0)
        return self._lengths_m[leg] - taken_m

    def _chosen(self, found: list[Placed], begin: int, end: int) -> list[Placed]:
        """Return what replaces the joints at the ends of a leg that is too short for them: what is shortest."""
        if end - begin > 1:
            candidates: Iterable[list[Placed]] = self._candidates(found, begin)
        else:
            candidates = ([each] for each in self._others(found, begin))

        def worse(joints: list[Placed]) -> tuple[float, float, float]:
            lack_m = sum(each.lack_m + each.missed_m for each in joints)
            return lack_m, max(each.off_m for each in joints), self._longer_m(joints)

        return min(candidates, key=worse)

    def _others(self, found: list[Placed], at: int, partner: int | None = None) -> list[Placed]:
        """Return what may replace a joint: a detour, or what takes no more of its legs than there is, or than it did.

        With a partner at the other end of a crowded leg up to all of that: for which both there is room is seen later.
        """
        one = found[at]
        if one.first in self._given:
            return []
        choices = [self._detour(one.first, one.last)]
        if one.first == one.last:
            before_m = self._room_m(found, at, one.joint.before_m, alone=at == 0)
            after_m = self._room_m(found, at + 1, one.joint.after_m, alone=at == len(found) - 1)
            if partner is not None:
                before_m = self._lengths_m[one.first - 1] if partner < at else before_m
                after_m = self._lengths_m[one.last] if partner > at else after_m
            choices += self._overshooting(one.first, before_m, after_m)
        return choices

    def _room_m(self, found: list[Placed], leg: int, taken_m: float, *, alone: bool) -> float:
        """Return how much of the leg before joint `leg` one of its joints, which takes some, may take."""
        slack_m = self._slack_m(found, leg)
        return taken_m + slack_m if alone else taken_m + max(slack_m, 0.0)

    def _longer_m(self, joints: list[Placed]) -> float:
        """Return the length of joints beyond what they take from the legs outside, and with those between them."""
        between = sum(self._lengths_m[each.last] for each in joints[:-1])
        return sum(each.joint.longer_m for each in joints) + between

    def _candidates(self, found: list[Placed], at: int) -> Iterator[list[Placed]]:
        """Yield what may replace two joints at the ends of a leg."""
        one, other = found[at : at + 2]
        if self._given.keys() & {one.first, other.first}:
            yield from self._pairs(found, at)
            return
        leg_m, limits, corner = self._lengths_m[one.last], self._limits(one.first), self._corner(one.first, other.last)
        if not self._rules.over and (joint := fly_by(corner, limits, self._rules.max_m)) is not None:
            yield [Placed(one.first, other.last, joint)]
        # Lanes, and legs nearer to each other than a turn back is wide, are joined by one path from one to the other.
        width_m = abs(complex(turned_m(np.asarray(math.pi), limits)))
        merged = self._detour(one.first, other.last)
        if leg_m < width_m or abs(corner.angle_rad) > REVERSAL_RAD or other.last - one.first > 1:
            yield [merged]
            # A detour over one waypoint turns by half a circle or more.
            min_m = leg_m + math.pi / limits.curvature_1pm + min(one.joint.longer_m, other.joint.longer_m, 0.0)
            if merged.lack_m == merged.missed_m == 0.0 and (self._rules.near or merged.joint.longer_m < min_m):
                return
            yield from self._pairs(found, at, overshooting=merged.lack_m > 0.0)
        else:
            yield from self._pairs(found, at)

    def _pairs(self, found: list[Placed], at: int, *, overshooting: bool = True) -> Iterator[list[Placed]]:
        """Yield what may replace each of two joints, or one of them, with room on the leg between."""
        leg_m = self._lengths_m[found[at].last]
        ones, others = (
            self._others(found, each, partner) if overshooting else [self._detour(found[each].first, found[each].last)]
            for each, partner in ((at, at + 1), (at + 1, at))
        )
        for pair in product([found[at], *ones], [found[at + 1], *others]):
            if leg_m - pair[0].joint.after_m - pair[1].joint.before_m >= -ENOUGH_M:
                yield list(pair)

    def _detour(self, first: int, last: int) -> Placed:
        """Return the shortest detour from a waypoint's leg to another's that has room, or lacks the least."""
        if (first, last) not in self._placed:
            self._placed[first, last] = self._best_detour(first, last)
        return self._placed[first, last]

    def _best_detour(self, first: int, last: int) -> Placed:
        corner, limits = self._corner(first, last), self._limits(first)
        if limits not in self._rules.known:
            self._rules.known[limits] = Detours(limits)
        detours = self._rules.known[limits]
        candidates = detours.between(corner.end.real, corner.end.imag, corner.angle_rad)
        best, minimum = None, (math.inf, math.inf)
        longest_m = candidates[0].length_m + LONGER_CIRCLES * TURN / limits.curvature_1pm
        for candidate in candidates:
            if candidate.length_m > longest_m:  # to where lines meet that are almost parallel, anywhere
                break
            joint = Joint(0.0, 0.0, candidate.stretches(limits), "detour")
            lack_m, missed_m = self._lack_m(corner, joint.stretches), self._missed_m(corner, joint)
            off_m, lack_m = off_legs_m(corner, joint) if self._rules.near else 0.0, lack_m + missed_m
            nearer = lack_m <= minimum[0] and off_m < minimum[1] - NEARER_M
            if lack_m < minimum[0] - ENOUGH_M or nearer:
                best, minimum = Placed(first, last, joint, lack_m - missed_m, missed_m, off_m), (lack_m, off_m)
            if minimum[0] == 0.0 and not self._rules.near:
                break
        assert best is not None, "there is always a way with three turns, or turns with a straight between"
        return best

    def _missed_m(self, corner: Corner, joint: Joint) -> float:
        """Return by how much more than allowed a detour passes from a waypoint between its ends."""
        if len(corner.waypoints) == 2 or not joint.stretches:
            return 0.0
        return max(float(distances_m(corner, joint).max()) - self._rules.max_m, 0.0)

    def _lack_m(self, corner: Corner, stretches: tuple[Stretch, ...], before_m: float = 0.0) -> float:
        length_m = sum(each.length_m for each in stretches)
        if self._rules.lack is None or length_m == 0.0:
            return 0.0
        count = max(2, math.ceil(length_m / ROOM_STEP_M))
        axis = np.exp(1j * corner.course_rad)
        curve = corner.waypoints[0] + axis * (points(stretches, count) - before_m)
        return self._rules.lack(curve, corner.course_rad + courses_rad(stretches, count))

    def _corner(self, first: int, last: int) -> Corner:
        waypoints = tuple(complex(each) for each in self._waypoints[first : last + 1])
        return Corner(self._courses[first - 1], self._courses[last], waypoints)

    def _limits(self, first: int) -> TurnLimits:
        return self._rules.limits[first - 1]

# Compiled by mypyc: it runs every tick.

"""Heights for vehicles that circle at the end, and how long they take to get there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from airlink.endpoint import VehicleId
from formation_scenario.orders import End
from gcs_formation.fleet.circle_heights import (
    NO_HEIGHTS,
    NO_ORDER,
    STACK_M,
    Band,
    GroundFloor,
    loiter_heights,
    may_meet,
)
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.vehicle import Vehicle

COMMANDED_M = 0.5
"""A vehicle counts as sent to its height if its height setpoint is within this distance of it, m. Tuned: m; 0.2 to 2;
shown by `pytest tests/gcs_formation/features/ending`."""
MIN_S, MAX_S = 30.0, 300.0
"""Least time limit of the separation, and the greatest if heights have to be reassigned."""
RESERVE_S = 15.0
"""Time added in that limit to the climb to the highest level. Tuned: s; 5 to 30; shown by `pytest
tests/gcs_formation/features/ending`."""
MARGIN_M = 5.0
"""Vertical distance of circles beyond the separation that vehicles need, in calm air. Tuned: m; 3 to 10; shown by
`pytest tests/gcs_formation/features/ending`."""
SWAY_SIGMAS = 4.0
"""In turbulence, this multiple of the standard deviation of two vehicles' relative vertical displacement instead.
Tuned: standard deviations; 3 to 5; shown by `pytest tests/gcs_formation/features/ending`."""

ORIGIN = 0.0, 0.0
NOWHERE: Mapping[VehicleId, tuple[float, float]] = {}

Ahead = Callable[[float], Sequence[tuple[float, float]]]
"""Displacements north and east, m, that the formation passes through in a time, s; a longer time adds points."""


def stays(_: float) -> Sequence[tuple[float, float]]:
    """Return the displacements of a formation that stays where it is."""
    return ((0.0, 0.0),)


class FlyingVehicle:
    """A vehicle in flight during the separation."""

    def __init__(
        self, motion: ReportedMotion, commanded_m: float, band: Band | None = None, *, steered: bool = False
    ) -> None:
        """Take its state.

        Args:
            motion: its position and velocity.
            commanded_m: its last height setpoint, or the height at which it is left.
            band: the heights that it may reach, if it can't be moved: it doesn't answer or obey, or isn't ours to
                command.
            steered: whether it is commanded, and responds.
        """
        self.motion = motion
        self.commanded_m = commanded_m
        self.band = band
        self.steered = steered


class HoldingStack:
    """Heights of vehicles that circle one above the other."""

    def __init__(
        self,
        gap_m: float,
        floor_m: float = -math.inf,
        *,
        sway_m: float = 0.0,
        together: bool = False,
        hover: bool = False,
        first: Mapping[VehicleId, frozenset[VehicleId]] = NO_ORDER,
    ) -> None:
        """Start without vehicles.

        Args:
            gap_m: minimum vertical separation of vehicles.
            floor_m: lowest height to assign.
            sway_m: standard deviation of the vertical displacement of vehicles by the air.
            together: whether all circle at one position, wherever they are now.
            hover: whether all hover where they are instead, at their present heights.
            first: those that land before each, and so circle below it.
        """
        self.heights_m: dict[VehicleId, float] = {}
        """Height of each vehicle above the origin."""
        margin_m = max(MARGIN_M, SWAY_SIGMAS * math.sqrt(2.0) * sway_m)
        self._gap_m, self._separation_m = (-math.inf, 0.0) if hover else (gap_m, max(STACK_M, gap_m + margin_m))
        self._floor_m, self._together, self._first = floor_m, together, first
        self._taken: dict[VehicleId, Band] = {}

    def assign(self, fliers: dict[VehicleId, FlyingVehicle]) -> bool:
        """Assign heights to vehicles that have none, and new ones to those in the way of one that can't be moved.

        All others keep theirs, as reassigned during the climb they would start it again, but for those that are below
        one that lands before them: such a vehicle couldn't be moved for a while, or was in the way of one. Return
        whether any height has been assigned.
        """
        self._take(fliers)
        free = {identity: flier.motion for identity, flier in fliers.items() if identity not in self._taken}
        taken = [self._taken[identity] for identity in fliers if identity in self._taken]
        moved = {
            identity: motion
            for identity, motion in free.items()
            if identity not in self.heights_m or self._in_the_way(identity, taken)
        }
        while True:
            if moved:
                kept_m = {identity: self.heights_m[identity] for identity in fliers if identity not in moved}
                self.heights_m |= self._heights_m(moved, taken, kept_m)
            following = self._too_low(free, fliers)
            if following.keys() <= moved.keys():
                return bool(moved)
            moved |= following

    def _take(self, fliers: dict[VehicleId, FlyingVehicle]) -> None:
        """Leave their heights to those that can't be moved.

        Of those that can be again one is moved at a time, out of the others' way: they may be at one height.
        """
        for identity, flier in fliers.items():
            if flier.band is None:
                continue
            if identity in self._taken:
                (low_m, high_m), (also_low_m, also_high_m) = self._taken[identity], flier.band
                self._taken[identity] = min(low_m, also_low_m), max(high_m, also_high_m)
            else:
                self._taken[identity], self.heights_m[identity] = flier.band, flier.commanded_m
        follows = (identity for identity in self._taken if identity in fliers and fliers[identity].band is None)
        again = next(follows, None)
        if again is not None:
            del self._taken[again]

    def add(self, motions: Mapping[VehicleId, ReportedMotion]) -> None:
        """Assign heights to those vehicles that have none; the others' don't change."""
        new = {identity: motion for identity, motion in motions.items() if identity not in self.heights_m}
        self.heights_m |= self._heights_m(new, [*self._taken.values()], self.heights_m)

    def raise_floor(self, floor_m: float) -> bool:
        """Raise the lowest height to `floor_m`; return whether that is a change."""
        raised = floor_m > self._floor_m
        self._floor_m = max(floor_m, self._floor_m)
        return raised

    def climb_m(self, motions: Mapping[VehicleId, ReportedMotion]) -> float:
        """Return the longest climb from these positions to the heights that they would be assigned."""
        heights_m = self._heights_m(motions)
        return max((heights_m[identity] - motion.height_m for identity, motion in motions.items()), default=0.0)

    def is_separated(self, fliers: dict[VehicleId, FlyingVehicle]) -> bool:
        """Return whether all steered vehicles are sent to their heights and vertically clear of all others."""
        names, each = list(fliers), list(fliers.values())
        for index, flier in enumerate(each):
            off_m = abs(flier.commanded_m - self.heights_m[names[index]]) if flier.steered else 0.0
            if off_m > COMMANDED_M and len(each) > 1:
                return False
        for index, flier in enumerate(each):
            for before in range(index):
                steered = flier.steered or each[before].steered
                if steered and not self._clear(names[index], flier, names[before], each[before]):
                    return False
        return True

    def _heights_m(
        self,
        motions: Mapping[VehicleId, ReportedMotion],
        taken: Sequence[Band] = (),
        kept_m: Mapping[VehicleId, float] = NO_HEIGHTS,
    ) -> dict[VehicleId, float]:
        floor_m, separation_m, first = self._floor_m, self._separation_m, self._first
        return loiter_heights(
            motions, floor_m, taken, separation_m, together=self._together, first=first, kept_m=kept_m
        )

    def _too_low(
        self, free: Mapping[VehicleId, ReportedMotion], fliers: Mapping[VehicleId, FlyingVehicle]
    ) -> dict[VehicleId, ReportedMotion]:
        """Return those that can be moved and are below one that lands before them."""
        return {
            identity: free[identity]
            for identity, before in self._first.items()
            if identity in free
            and any(self.heights_m[each] > self.heights_m[identity] for each in before if each in fliers)
        }

    def _in_the_way(self, identity: VehicleId, taken: list[Band]) -> bool:
        height_m = self.heights_m[identity]
        return any(low_m - self._separation_m < height_m < high_m + self._separation_m for low_m, high_m in taken)

    def _clear(self, name: VehicleId, one: FlyingVehicle, others_name: VehicleId, other: FlyingVehicle) -> bool:
        """Return whether two vehicles are vertically separated, or can't meet anyway."""
        low_m = high_m = one.motion.height_m
        others_low_m = others_high_m = other.motion.height_m
        moves_on = False
        if self._taken:
            moves_on = name in self._taken or others_name in self._taken
            low_m, high_m = self._taken.get(name, (low_m, high_m))
            others_low_m, others_high_m = self._taken.get(others_name, (others_low_m, others_high_m))
        if max(low_m - others_high_m, others_low_m - high_m) >= self._gap_m:
            return True
        return not (moves_on or self._together or may_meet(one.motion, other.motion))


def stacked(
    motions: Mapping[VehicleId, ReportedMotion],
    stack: HoldingStack,
    ground: GroundFloor,
    manner: End,
    ahead: Ahead,
    climb_mps: float,
    homes: Mapping[VehicleId, tuple[float, float]] = NOWHERE,
) -> float:
    """Raise a stack clear of the ground that vehicles reach until they circle; return the time limit of the climb, s.

    The formation flies on while it climbs. A higher stack takes longer to reach, and so leads over more ground: that is
    repeated until the ground ahead raises the stack no further.

    Args:
        motions: the vehicles' positions.
        stack: the heights of all circles.
        ground: the ground to keep clear of.
        manner: how the flight ends.
        ahead: the formation's displacements while it flies on.
        climb_mps: the climb rate of all vehicles.
        homes: positions north and east to which vehicles fly that don't loiter here.
    """
    seen, each = 0, [(motion, homes.get(identity)) for identity, motion in motions.items()]
    while True:
        limit_s = limit_of_climb_s(stack.climb_m(motions), climb_mps)
        path, leaves = ahead(limit_s), len(ahead(limit_s - MIN_S)) - 1  # earliest departure for home
        floor_m = _floor_m(each, path[seen:leaves], "loiter", ground)
        if not stack.raise_floor(max(floor_m, _floor_m(each, path[max(seen, leaves) :], manner, ground))):
            return limit_s
        seen = len(path)


def limit_of_climb_s(climb_m: float, climb_mps: float) -> float:
    """Return the time limit, s, of a separation in which a vehicle has to climb by `climb_m`."""
    return max(MIN_S, climb_m / climb_mps + RESERVE_S)


def _floor_m(
    each: Iterable[tuple[ReportedMotion, tuple[float, float] | None]],
    path: Sequence[tuple[float, float]],
    manner: End,
    ground: GroundFloor,
) -> float:
    """Return the lowest height for all circles: over the ground here and ahead or, to return, on the legs home.

    An unknown home is taken to be at the origin.
    """
    legs = [((at.north_m + north_m, at.east_m + east_m), home_m) for at, home_m in each for north_m, east_m in path]
    if manner != "loiter":
        return max((ground.over_leg(begin_m, home_m or ORIGIN) for begin_m, home_m in legs), default=-math.inf)
    return ground.highest(begin_m for begin_m, _ in legs).height_m


def motion_of(vehicle: Vehicle) -> ReportedMotion | None:
    """Return a vehicle's position; during its take-off with the height at which that ends."""
    motion = vehicle.telemetry.motion
    if motion is None or not vehicle.autopilot.climbs_out(vehicle.telemetry):
        return motion
    return climbed_out(motion, vehicle)


def home_of(vehicle: Vehicle) -> tuple[float, float] | None:
    """Return a vehicle's home, north and east of the origin, m: as reported, or where it was armed; None if unknown."""
    stood = vehicle.take_off.stood
    return vehicle.telemetry.home_m or (None if stood is None else (stood.north_m, stood.east_m))


def climbed_out(motion: ReportedMotion, vehicle: Vehicle) -> ReportedMotion:
    """Return a vehicle's position with the height at which its take-off ends."""
    height_m = motion.height_m - motion.above_home_m + vehicle.autopilot.take_off_m
    velocity = motion.north_mps, motion.east_mps, motion.climb_mps
    return ReportedMotion(motion.stamp_s, motion.north_m, motion.east_m, height_m, *velocity, motion.above_home_m)

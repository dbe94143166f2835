"""The opening of a formation at the end of its flight: everybody gets a height of their own before anybody circles.

So it makes no difference who hears that: whoever doesn't flies on at a height that nobody else has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from formation_scenario.orders import End
from gcs_formation.controller import FormationController
from gcs_formation.fleet.circle_heights import (
    OPENING_LIMIT_S,
    STACK_M,
    Band,
    GroundFloor,
    loiter_heights,
    may_meet,
    opening_limit_s,
)
from gcs_formation.recorder import VehicleLink
from gcs_formation.separation.unresponsive import FORGOTTEN_AFTER_S
from gcs_formation.vehicle.telemetry import ReportedMotion
from gcs_formation.vehicle.vehicle import Member, Vehicle

COMMANDED_M = 0.5
"""A vehicle counts as sent to its own height once it is told one this near to it, m."""
MOST_S = 300.0
"""For how long an opening may last at most where heights have to be given anew."""
UNMOVED_S = 5.0
"""For how long one may not answer before the others' heights are moved out of its way: links lose in bursts."""
STANDS_MPS = 0.5
"""Speed over ground below which what was to stop stands."""
BESIDE_M = 5.0
"""What circles are farther apart than vehicles must be, in calm air."""
SWAY_SIGMAS = 4.0
"""In air that isn't, this many standard deviations of how far it moves two that circle apart or together."""

ORIGIN = 0.0, 0.0
NOWHERE: Mapping[VehicleId, tuple[float, float]] = {}

Ahead = Callable[[float], Sequence[tuple[float, float]]]
"""How far north and east the formation gets in some seconds, m, point by point; in more seconds by more points."""


def stays(_: float) -> Sequence[tuple[float, float]]:
    """Return the way on of a formation that stays where it is: none."""
    return ((0.0, 0.0),)


class FlyingVehicle:
    """A vehicle in the air, at the end of a flight."""

    def __init__(
        self, place: ReportedMotion, commanded_m: float, band: Band | None = None, *, steered: bool = False
    ) -> None:
        """Take what is known of it.

        Args:
            place: where it is.
            commanded_m: the height that it was told last, or is left at.
            band: where its height may come to, of one that can't be moved: it doesn't answer or obey, or isn't ours to
                command.
            steered: whether it is commanded, and responds.
        """
        self.place = place
        self.commanded_m = commanded_m
        self.band = band
        self.steered = steered


class Stack:
    """Heights at which vehicles circle, one above the other."""

    def __init__(
        self,
        gap_m: float,
        floor_m: float = -math.inf,
        *,
        sway_m: float = 0.0,
        together: bool = False,
        stand: bool = False,
    ) -> None:
        """Start empty; nobody is given a height below `floor_m`.

        Args:
            gap_m: the distance that vehicles must be apart.
            floor_m: the lowest height.
            sway_m: how far the air moves vehicles off their heights, a standard deviation.
            together: whether all circle at one place, wherever they are now.
            stand: whether all stand where they are instead, at the heights that they have.
        """
        self.heights_m: dict[VehicleId, float] = {}
        """Everybody's height above the origin."""
        beside_m = max(BESIDE_M, SWAY_SIGMAS * math.sqrt(2.0) * sway_m)
        self._gap_m, self._apart_m = (-math.inf, 0.0) if stand else (gap_m, max(STACK_M, gap_m + beside_m))
        self._floor_m, self._together = floor_m, together
        self._taken: dict[VehicleId, Band] = {}

    def take(self, fliers: dict[VehicleId, FlyingVehicle]) -> bool:
        """Give a height to everybody who has none, and another one where somebody can't be moved out of the way.

        All others keep theirs: given anew from where all are on their way, they would begin their climb again. Return
        whether somebody has another one now.
        """
        for identity, flier in fliers.items():
            if flier.band is None:
                if self._taken:
                    self._taken.pop(identity, None)
            elif identity in self._taken:
                (low_m, high_m), (also_low_m, also_high_m) = self._taken[identity], flier.band
                self._taken[identity] = min(low_m, also_low_m), max(high_m, also_high_m)
            else:
                self._taken[identity], self.heights_m[identity] = flier.band, flier.commanded_m
        if not self._taken and all(identity in self.heights_m for identity in fliers):
            return False
        free = {identity: flier.place for identity, flier in fliers.items() if flier.band is None}
        taken = [self._taken[identity] for identity in fliers if identity in self._taken]
        moved = {
            identity: place
            for identity, place in free.items()
            if identity not in self.heights_m or self._in_way(identity, taken)
        }
        if moved:
            kept_m = [self.heights_m[identity] for identity in free if identity not in moved]
            self._assign(moved, [*taken, *((height_m, height_m) for height_m in kept_m)])
        return bool(moved)

    def add(self, places: Mapping[VehicleId, ReportedMotion]) -> None:
        """Give a height to those of the vehicles that have none; nobody else's changes."""
        new = {identity: place for identity, place in places.items() if identity not in self.heights_m}
        taken = [*self._taken.values(), *((height_m, height_m) for height_m in self.heights_m.values())]
        self._assign(new, taken)

    def lift(self, floor_m: float) -> bool:
        """Give nobody a height below `floor_m` either; return whether that changes anything."""
        raised = floor_m > self._floor_m
        self._floor_m = max(floor_m, self._floor_m)
        return raised

    def climb_m(self, places: Mapping[VehicleId, ReportedMotion]) -> float:
        """Return the longest climb from these places to the heights that they would be given."""
        heights_m = loiter_heights(places, self._floor_m, (), self._apart_m, together=self._together)
        return max((heights_m[identity] - place.height_m for identity, place in places.items()), default=0.0)

    def apart(self, fliers: dict[VehicleId, FlyingVehicle]) -> bool:
        """Return whether those that are steered are clear of all others in height, and fly to their own heights."""
        names, each = list(fliers), list(fliers.values())
        for place, flier in enumerate(each):
            off_m = abs(flier.commanded_m - self.heights_m[names[place]]) if flier.steered else 0.0
            if off_m > COMMANDED_M and len(each) > 1:
                return False
        for place, flier in enumerate(each):
            for before in range(place):
                steered = flier.steered or each[before].steered
                if steered and not self._clear(names[place], flier, names[before], each[before]):
                    return False
        return True

    def _assign(self, places: Mapping[VehicleId, ReportedMotion], taken: Sequence[Band]) -> None:
        self.heights_m |= loiter_heights(places, self._floor_m, taken, self._apart_m, together=self._together)

    def _in_way(self, identity: VehicleId, taken: list[Band]) -> bool:
        height_m = self.heights_m[identity]
        return any(low_m - self._apart_m < height_m < high_m + self._apart_m for low_m, high_m in taken)

    def _clear(self, name: VehicleId, one: FlyingVehicle, others_name: VehicleId, other: FlyingVehicle) -> bool:
        """Return whether two are far enough apart in height, or can't meet anyway."""
        low_m = high_m = one.place.height_m
        others_low_m = others_high_m = other.place.height_m
        moves_on = False
        if self._taken:
            moves_on = name in self._taken or others_name in self._taken
            low_m, high_m = self._taken.get(name, (low_m, high_m))
            others_low_m, others_high_m = self._taken.get(others_name, (others_low_m, others_high_m))
        if max(low_m - others_high_m, others_low_m - high_m) >= self._gap_m:
            return True
        return not (moves_on or self._together or may_meet(one.place, other.place))


def stacked(
    places: Mapping[VehicleId, ReportedMotion],
    stack: Stack,
    ground: GroundFloor,
    manner: End,
    ahead: Ahead,
    climb_mps: float,
    homes: Mapping[VehicleId, tuple[float, float]] = NOWHERE,
) -> float:
    """Raise a stack clear of the ground that comes while all climb to it; return for how long they may climb, s.

    Args:
        places: where everybody is.
        stack: the heights of all circles.
        ground: the ground to keep clear of.
        manner: how the flight ends.
        ahead: the formation's way on.
        climb_mps: how fast all of them climb.
        homes: where those fly that don't loiter here, north and east.
    """
    seen, each = 0, [(place, homes.get(identity)) for identity, place in places.items()]
    while True:
        limit_s = opening_limit_s(stack.climb_m(places), climb_mps)
        way, leaves = ahead(limit_s), len(ahead(limit_s - OPENING_LIMIT_S)) - 1  # nobody goes home sooner
        floor_m = _floor_m(each, way[seen:leaves], "loiter", ground)
        if not stack.lift(max(floor_m, _floor_m(each, way[max(seen, leaves) :], manner, ground))):
            return limit_s
        seen = len(way)


def _floor_m(
    each: Iterable[tuple[ReportedMotion, tuple[float, float] | None]],
    way: Sequence[tuple[float, float]],
    manner: End,
    ground: GroundFloor,
) -> float:
    """Return the lowest height for all circles: over the ground here and ahead or, to get home, on the ways there.

    A home that isn't known is taken to be at the origin.
    """
    legs = [((at.north_m + north_m, at.east_m + east_m), home_m) for at, home_m in each for north_m, east_m in way]
    if manner != "loiter":
        return max((ground.over_way(begin_m, home_m or ORIGIN) for begin_m, home_m in legs), default=-math.inf)
    return ground.highest(begin_m for begin_m, _ in legs).height_m


class Opening:
    """Opens a controller's formation, tick by tick."""

    def __init__(
        self,
        stack: Stack,
        controller: FormationController,
        vehicles: Mapping[VehicleId, Vehicle],
        now: Instant,
        limit_s: float,
        climb_mps: float,
        *,
        stops: bool = False,
    ) -> None:
        """Steer to the heights of `stack`, for `limit_s` at most, and longer where somebody has to be given another.

        `climb_mps`: how fast all of them climb; `stops`: it lasts until all that is steered stands, too.
        """
        self._stack, self._controller, self._climb_mps, self._stops = stack, controller, climb_mps, stops
        self._vehicles, self._since, self._limit_s = list(vehicles.values()), now, limit_s
        self._fliers = dict[VehicleId, FlyingVehicle]()

    def steer(self, links: list[VehicleLink], now: Instant) -> list[float]:
        """Look where everyone is, and return the heights (C,) to command now; NaN where there is none."""
        self._fliers = dict[VehicleId, FlyingVehicle]()
        for vehicle in self._vehicles:
            flier = self._flier(vehicle, links, now)
            if flier is not None:
                self._fliers[vehicle.identity] = flier
        if self._stack.take(self._fliers):
            self._allow_for_climb(now)
        heights_m, given_m = [math.nan] * len(links), self._stack.heights_m
        for vehicle in self._vehicles:
            heights_m[vehicle.column] = given_m.get(vehicle.identity, math.nan)
        return heights_m

    def _allow_for_climb(self, now: Instant) -> None:
        given_m, steered = self._stack.heights_m, ((i, each) for i, each in self._fliers.items() if each.steered)
        climb_m = max((given_m[identity] - each.place.height_m for identity, each in steered), default=0.0)
        needed_s = seconds_between(self._since, now) + opening_limit_s(climb_m, self._climb_mps)
        self._limit_s = max(self._limit_s, min(needed_s, MOST_S))

    def over(self, now: Instant) -> bool:
        """Return whether everyone may circle, or it must do."""
        late = seconds_between(self._since, now) >= self._limit_s
        return late or (self._stack.apart(self._fliers) and not (self._stops and self._moves()))

    def _moves(self) -> bool:
        """Return whether somebody who is steered doesn't stand yet."""
        steered = (flier.place for flier in self._fliers.values() if flier.steered)
        return any(math.hypot(place.north_mps, place.east_mps) > STANDS_MPS for place in steered)

    def _flier(self, vehicle: Vehicle, links: list[VehicleLink], now: Instant) -> FlyingVehicle | None:
        place, column = vehicle.telemetry.motion, vehicle.column
        unheard_s = seconds_between(vehicle.connection.last_heard, now)
        if place is None or not vehicle.telemetry.armed or unheard_s > FORGOTTEN_AFTER_S:
            return None
        if vehicle.autopilot.climbs_out(vehicle.telemetry):
            place = _climbed_out(place, vehicle)
            return FlyingVehicle(place, place.height_m)
        answers = seconds_between(vehicle.round_trips.heard_at(now), now) <= UNMOVED_S
        led = links[column].ready and links[self._controller.plan.leader].ready
        if led and answers and not links[column].disobeying:
            return FlyingVehicle(place, self._commanded_m(column), steered=True)
        orders_m = self._orders_m(vehicle, column, links, answers=answers)
        heights_m = [place.height_m, *(height_m for height_m in orders_m if math.isfinite(height_m))]
        return FlyingVehicle(place, heights_m[-1], (min(heights_m), max(heights_m)))

    def _orders_m(self, vehicle: Vehicle, column: int, links: list[VehicleLink], *, answers: bool) -> tuple[float, ...]:
        """Return the heights that one may be on its way to, the last order last; NaN where there was none."""
        if vehicle.member in (Member.HOLDING, Member.RETURNING):
            return self._heard_m(column, links), vehicle.holds_at_m
        return () if answers else (self._heard_m(column, links), self._commanded_m(column))

    def _heard_m(self, column: int, links: list[VehicleLink]) -> float:
        """Return the height that a vehicle was told when it was last known to hear."""
        _, _, height_m = self._controller.history.commanded(links[column].heard, column)
        return height_m

    def _commanded_m(self, column: int) -> float:
        tick = self._controller.last_tick
        return math.nan if tick is None else tick.setpoints[column][2]


def place_of(vehicle: Vehicle) -> ReportedMotion | None:
    """Return a vehicle's position; that of one that is taking off has the height at which it will be done."""
    motion = vehicle.telemetry.motion
    if motion is None or not vehicle.autopilot.climbs_out(vehicle.telemetry):
        return motion
    return _climbed_out(motion, vehicle)


def home_of(vehicle: Vehicle) -> tuple[float, float] | None:
    """Return a vehicle's home, north and east of the origin, m: as it tells, or where it was armed; None if unknown."""
    stood = vehicle.take_off.stood
    return vehicle.telemetry.home_m or (None if stood is None else (stood.north_m, stood.east_m))


def _climbed_out(motion: ReportedMotion, vehicle: Vehicle) -> ReportedMotion:
    height_m = motion.height_m - motion.above_home_m + vehicle.autopilot.take_off_m
    velocity = motion.north_mps, motion.east_mps, motion.climb_mps
    return ReportedMotion(motion.stamp_s, motion.north_m, motion.east_m, height_m, *velocity, motion.above_home_m)

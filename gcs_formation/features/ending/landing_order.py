"""Where vehicles land, and in which order, so that none comes in over the position of another, or rolls into it.

Fixed wings land where they took off and in that direction, or by the landing of their mission; vehicles that hover come
down over their homes. One that lands before another may stand in no other's way then: where one's approach leads over
another's position, it lands first. So vehicles of one line land over one common approach, the foremost first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from airlink.endpoint import VehicleId
from gcs_formation.features.ending.holding_stack import home_of
from gcs_formation.fleet.circle_heights import STACK_M, GroundFloor
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle

BEFORE_M, BEYOND_M, LATERAL_M = 150.0, 60.0, 25.0
"""Distances before, beyond and to the side of its home within which a landing aircraft is low, or rolls."""
BEYOND_LANDED_M: Final = 35.0
"""The same beyond its home, where one stands that has landed in this flight: of the 60 m that were between their homes
it may have used up 25, short of its own home. Tuned: m; 20 to 60; shown by `pytest
tests/gcs_formation/features/ending`."""
RESOLUTION_M: Final = 0.5
"""Least distance of two reported positions: in slots of 30 m vehicles are 60 m behind one another, to the cm. Tuned: m;
0.1 to 1; shown by `pytest tests/gcs_formation/features/ending`."""
OVER_M: Final = 3.0
"""Distance from its home within which one that comes down straight may touch another. Tuned: m; 2 to 6; by
judgement."""
APPROACH_M = 600.0
"""Distance from home within which its approach lies. Tuned: m; 300 to 1500; shown by `pytest
tests/gcs_formation/features/ending`."""
LEVEL_M = 5.0
"""How much higher than home the ground may be within that distance. Tuned: m; 2 to 10; shown by `pytest
tests/gcs_formation/features/ending`."""

Positions = Mapping[VehicleId, tuple[float, float]]
"""Where vehicles stand, or will, north and east, m."""


class Landing(NamedTuple):
    """Where a vehicle lands, north and east of the origin, m, and its approach's course, rad; NaN: straight down."""

    north_m: float
    east_m: float
    course_rad: float

    def reaches(self, position: tuple[float, float], beyond_m: float = BEYOND_M) -> bool:
        """Return whether it is low over a place, or rolls there, at most `beyond_m` past its home."""
        north_m, east_m = position[0] - self.north_m, position[1] - self.east_m
        if math.isnan(self.course_rad):
            return math.hypot(north_m, east_m) < OVER_M
        along_m = north_m * math.cos(self.course_rad) + east_m * math.sin(self.course_rad)
        lateral_m = east_m * math.cos(self.course_rad) - north_m * math.sin(self.course_rad)
        return -BEFORE_M < along_m < beyond_m - RESOLUTION_M and abs(lateral_m) < LATERAL_M


def is_ours(vehicle: Vehicle) -> bool:
    """Return whether a vehicle flies, and isn't its pilot's."""
    return vehicle.member is not Member.PARTED and vehicle.airborne


def landing_of(vehicle: Vehicle, *, planned: bool = False) -> Landing | str:
    """Return where a vehicle lands, or why that isn't known; `planned`: it stands where it will take off, and lands."""
    autopilot, seen, took_off = vehicle.autopilot, vehicle.telemetry, vehicle.take_off
    who = f"vehicle {vehicle.identity}"
    if not autopilot.land():
        return f"{who} can't land by itself"
    sequence = autopilot.landing
    if sequence is not None:
        return Landing(sequence.north_m, sequence.east_m, sequence.course_rad)
    if autopilot.hovers:
        home_m = home_of(vehicle)
        if home_m is None and planned and seen.motion is not None:
            home_m = seen.motion.north_m, seen.motion.east_m
        return Landing(*home_m, math.nan) if home_m else f"{who} lands at its home, which it hasn't reported"
    stood, course_rad = took_off.stood, took_off.course_rad
    if planned and stood is not None and seen.attitude is not None:
        course_rad = seen.attitude.yaw_rad
    if stood is None or course_rad is None:
        return f"{who} lands where it took off, and that was not seen"
    return Landing(stood.north_m, stood.east_m, course_rad)


class LandingOrder:
    """Which vehicles land, where, and which of them before which others."""

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle], ground: GroundFloor, *, planned: bool = False) -> None:
        """Find out for those in the air; `planned`: for all, as they stand before their take-off."""
        self.refusal: str | None = None
        """Why they can't land, in words."""
        self.first: dict[VehicleId, frozenset[VehicleId]] = {}
        """Those that must have landed before each: it would stand in their way."""
        self._landings = dict[VehicleId, Landing]()
        flying = {each: one for each, one in vehicles.items() if planned or is_ours(one)}
        stand = {
            each: (at.north_m, at.east_m)
            for each, one in vehicles.items()
            if each not in flying and (at := one.telemetry.motion)
        }
        self._landed = {each for each in stand if vehicles[each].take_off.flew}
        for each, vehicle in flying.items():
            climbs = not planned and _climbs_out(vehicle)
            landing = landing_of(vehicle, planned=planned)
            if isinstance(landing, Landing):
                self._landings[each] = landing
            elif not climbs:  # its take-off is being seen; this is asked again before it lands
                self.refusal = self.refusal or landing
        self.refusal = self.refusal or self._in_the_way(stand) or self._too_high(ground, flying)
        if self.refusal is None:
            self.refusal = self._order()

    def _in_the_way(self, stand: Positions) -> str | None:
        for each, landing in self._landings.items():
            for other, position in stand.items():
                if landing.reaches(position, BEYOND_LANDED_M if other in self._landed else BEYOND_M):
                    return _over(each, other)
        return None

    def _too_high(self, ground: GroundFloor, flying: Mapping[VehicleId, Vehicle]) -> str | None:
        for each, landing in self._landings.items():
            home_m = _home_height_m(flying[each])
            if home_m is None or math.isnan(landing.course_rad):
                continue
            above_m = ground.highest_m(landing.north_m, landing.east_m, APPROACH_M) - home_m
            if above_m > LEVEL_M:
                return f"the ground within {APPROACH_M:g} m of where vehicle {each} lands is {above_m:.0f} m higher"
        return None

    def _order(self) -> str | None:
        """Find who must land before whom; return in words whose positions block one another, None if none do."""
        for one, landing in self._landings.items():
            later = (other for other in self._landings if other != one)
            blocks = [other for other in later if landing.reaches(self._landings[other][:2])]
            for other in blocks:
                self.first[other] = self.first.get(other, frozenset()) | {one}
        left = dict(self.first)
        while left:
            free = [each for each, before in left.items() if not before & left.keys()]
            if not free:
                other, before = next(iter(left.items()))
                return _over(next(each for each in before if each in left), other)
            for each in free:
                del left[each]
        return None

    def why_not_now(self, following: Sequence[VehicleId]) -> str | None:
        """Return why the first of those that are to land in this order can't land now, None if it can."""
        return self.refusal or next(
            (_over(each, following[0]) for each in following[1:] if each in self.first.get(following[0], ())), None
        )


def lowest_circle_m(vehicles: Mapping[VehicleId, Vehicle]) -> float:
    """Return the lowest height of circles above the origin, m: above the approaches of all vehicles."""
    each = ((_home_height_m(vehicle), vehicle.autopilot.highest_approach_m) for vehicle in vehicles.values())
    return max((home_m + approach_m + STACK_M for home_m, approach_m in each if home_m is not None), default=-math.inf)


def _home_height_m(vehicle: Vehicle) -> float | None:
    """Return the height of a vehicle's home above the origin, m, None if unknown."""
    stood, seen = vehicle.take_off.stood, vehicle.telemetry.motion
    if stood is not None:
        return stood.height_m
    return None if seen is None else seen.height_m - seen.above_home_m


def _climbs_out(vehicle: Vehicle) -> bool:
    return vehicle.take_off.stood is not None and vehicle.autopilot.climbs_out(vehicle.telemetry)


def _over(one: VehicleId, other: VehicleId) -> str:
    return f"vehicle {one} would come in over the place of vehicle {other}"

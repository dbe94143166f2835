"""Landings one after another, each where the vehicle took off, and the reasons why they may not be possible.

All vehicles circle over their homes at separate heights. The lowest lands first; the next one follows when it stands
there disarmed. So no two vehicles land at the same time, and none lands where another stands.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from gcs_formation.features.ending.stack import home_of
from gcs_formation.fleet.circle_heights import CIRCLES_MEET_M, STACK_M, GroundFloor
from gcs_formation.mission.ending import may_be_armed
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.telemetry import ReportedMotion
from gcs_formation.vehicle.vehicle import Member, Vehicle

BEFORE_M, BEYOND_M, ASIDE_M = 150.0, 60.0, 25.0
"""Distances before, beyond and beside its home within which a landing aircraft is low, or rolls."""
APPROACH_M = 600.0
"""Distance from home within which its approach lies."""
LEVEL_M = 5.0
"""How much higher than home the ground may be within that distance."""
AT_HEIGHT_M = STACK_M / 3
REFUSED_FOR_S = 5.0
LANDING_LIMIT_S = 900.0
"""Longest wait for vehicles to circle over their homes, and for each to land."""


def why_not_land(vehicles: Mapping[VehicleId, Vehicle], ground: GroundFloor) -> str | None:
    """Return why the flying vehicles can't land where they took off, in words; None if they can."""
    flying = {each: vehicle for each, vehicle in vehicles.items() if _is_ours(vehicle)}
    places = {each: v.take_off.stood if each in flying else v.telemetry.motion for each, v in vehicles.items()}
    for each, vehicle in flying.items():
        home, course_rad = places[each], vehicle.take_off.course_rad
        if not vehicle.autopilot.land():
            return f"vehicle {each} can't land by itself"
        if home is not None and course_rad is None and vehicle.autopilot.climbs_out(vehicle.telemetry):
            continue  # its take-off is being seen; this is asked again before it lands
        if home is None or course_rad is None:
            return f"vehicle {each} lands where it took off, and that was not seen"
        others = ((other, place) for other, place in places.items() if other != each and place is not None)
        in_way = next((other for other, place in others if _in_way(home, course_rad, place)), None)
        if in_way is not None:
            return f"vehicle {each} would come in over the place of vehicle {in_way}"
        above_m = ground.highest_m(home.north_m, home.east_m, APPROACH_M) - home.height_m
        if above_m > LEVEL_M:
            return f"the ground within {APPROACH_M:g} m of where vehicle {each} lands is {above_m:.0f} m higher"
    return None


def lowest_circle_m(vehicles: Mapping[VehicleId, Vehicle]) -> float:
    """Return the lowest height of circles above the origin, m: above the approaches of all vehicles."""
    stood = ((vehicle.take_off.stood, vehicle.autopilot.approach_m) for vehicle in vehicles.values())
    return max((home.height_m + approach_m + STACK_M for home, approach_m in stood if home), default=-math.inf)


class Landings:
    """Lands the vehicles that circle over their homes, one at a time."""

    def __init__(self, refusal: Callable[[], str | None]) -> None:
        """Start empty; `refusal` is called before each landing and returns why it isn't possible, None if it is."""
        self._refusal = refusal
        self.failure: str | None = None
        """Why landing was stopped; vehicles that haven't landed go on circling."""
        self._waiting = deque[tuple[float, Vehicle]]()
        self._landing: Vehicle | None = None
        self._since: Instant | None = None

    def await_turn(self, vehicle: Vehicle, height_m: float) -> None:
        """Add a vehicle that was commanded to circle over its home at a height above the origin."""
        self._waiting = deque(sorted((*self._waiting, (height_m, vehicle)), key=lambda each: each[0]))

    def call_off(self) -> Landings | None:
        """Start no further landing; return this if one has begun, which is completed."""
        self._waiting.clear()
        return self if self._landing is not None else None

    def drop(self, vehicle: Vehicle) -> None:
        """Forget that a vehicle was commanded to circle over its home, or to land."""
        self._waiting = deque(each for each in self._waiting if each[1] is not vehicle)
        if self._landing is vehicle:
            self._landing = None

    def refuse(self, text: str) -> None:
        """Begin no further landing, for a reason."""
        self.failure = self.failure or text
        self._waiting.clear()

    @property
    def under_way(self) -> bool:
        """Whether a vehicle is landing or waiting to land."""
        return self._landing is not None or bool(self._waiting)

    def is_pending(self, vehicle: Vehicle) -> bool:
        """Return whether a vehicle is landing or waiting to land."""
        return vehicle is self._landing or any(vehicle is each for _, each in self._waiting)

    def advance(self, now: Instant, *, climbs_out: bool = False) -> None:
        """Command the next landing if none is in progress, no vehicle climbs out, and all circle at their heights."""
        if self._since is None:
            self._since = now
        if self._landing is not None:
            self._watch(self._landing, seconds_between(self._since, now), now)
        elif self._waiting and not climbs_out and all(_circles(each, height_m) for height_m, each in self._waiting):
            self._begin(now)
        elif self._waiting and seconds_between(self._since, now) > LANDING_LIMIT_S:
            self._give_up(
                f"not every vehicle circled over home at the height it was commanded within {LANDING_LIMIT_S:g} s"
            )

    def _begin(self, now: Instant) -> None:
        refusal = self._refusal()
        if refusal is not None:
            self._give_up(refusal)
            return
        _, self._landing = self._waiting.popleft()
        self._since = now
        self._landing.commands.begin(self._landing.autopilot.land(), now)

    def _watch(self, vehicle: Vehicle, waited_s: float, now: Instant) -> None:
        refusal = vehicle.commands.refusal
        if not may_be_armed(vehicle):
            self._landing, self._since = None, now
        elif vehicle.commands.outcome is not Outcome.ACCEPTED and refusal is not None and waited_s > REFUSED_FOR_S:
            vehicle.commands.begin((), now)
            said = vehicle.telemetry.last_words
            self._give_up(f"vehicle {vehicle.identity} refused to land ({m.name_of('MAV_RESULT', refusal[1])}){said}")
        elif waited_s > LANDING_LIMIT_S:
            self._give_up(f"vehicle {vehicle.identity} has not landed within {LANDING_LIMIT_S:g} s")

    def _give_up(self, text: str) -> None:
        self.failure, self._landing = text, None
        self._waiting.clear()


def _is_ours(vehicle: Vehicle) -> bool:
    return vehicle.member is not Member.PARTED and vehicle.airborne


def _in_way(home: ReportedMotion, course_rad: float, place: ReportedMotion) -> bool:
    """Return whether a vehicle that lands at `home` on this course is low at `place`, or rolls there."""
    north_m, east_m = place.north_m - home.north_m, place.east_m - home.east_m
    along_m = north_m * math.cos(course_rad) + east_m * math.sin(course_rad)
    aside_m = east_m * math.cos(course_rad) - north_m * math.sin(course_rad)
    return -BEFORE_M < along_m < BEYOND_M and abs(aside_m) < ASIDE_M


def _circles(vehicle: Vehicle, height_m: float) -> bool:
    """Return whether a vehicle circles over its home at the commanded height."""
    seen, home_m = vehicle.telemetry.motion, home_of(vehicle)
    if seen is None or home_m is None or vehicle.commands.outcome is not Outcome.ACCEPTED:
        return False
    away_m = math.hypot(seen.north_m - home_m[0], seen.east_m - home_m[1])
    return away_m < CIRCLES_MEET_M and abs(seen.height_m - height_m) < AT_HEIGHT_M

"""The end of a run: vehicles in the air circle at separate heights, here or at home, or land; others are disarmed.

A formation is opened first (`opening`): heights are separate before anyone is told to circle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from airlink.clock import Instant
from airlink.identity import VehicleId
from formation_scenario.orders import End
from gcs_formation.landing import Landings, lowest_circle_m, why_not
from gcs_formation.link.connection import TALKING
from gcs_formation.loitering import GroundFloor
from gcs_formation.membership import Member
from gcs_formation.opening import Opening, Stack, place_of
from gcs_formation.vehicle.commands import Outcome
from gcs_formation.vehicle.telemetry import Motion
from gcs_formation.vehicle.vehicle import Vehicle

LOITER_LIMIT_S = 20.0
"""Longest wait for vehicles to climb out and acknowledge that they loiter."""


class Ending:
    """Brings every vehicle to a state in which it may be left alone.

    A vehicle that is taking off climbs out first; one that its pilot has taken over is left to the pilot.
    """

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        now: Instant,
        manner: End = "loiter",
        ground: GroundFloor | None = None,
        landings: Landings | None = None,
        ahead: Sequence[tuple[float, float]] = ((0.0, 0.0),),
        gap_m: float = 0.0,
    ) -> None:
        """Keep vehicles on the ground there, whatever they were about to do.

        Args:
            vehicles: all of them.
            now: the present instant.
            manner: how the flight ends.
            ground: the ground to keep clear of.
            landings: those of an earlier order to land, where a vehicle is still landing; it is left to that.
            ahead: how far north and east the formation may have flown on when it leaves, m, point by point.
            gap_m: the distance that vehicles must be apart.
        """
        self.landings = landings or Landings(lambda: why_not(vehicles, ground) if ground else None)
        commanded = {identity: each for identity, each in vehicles.items() if not each.is_left}
        self._ours = {identity: each for identity, each in commanded.items() if not self.landings.is_pending(each)}
        places = [
            (place.north_m + north_m, place.east_m + east_m)
            for place in self._places().values()
            for north_m, east_m in ahead
        ]
        floor_m = _floor_m(places, manner, ground)
        if manner == "land":
            floor_m = max(floor_m, lowest_circle_m(vehicles))
        self.stack = Stack(gap_m, floor_m, together=manner != "loiter")
        self.loiter_s = 0.0
        """For how long vehicles loiter before the run is over."""
        self.opening: Opening | None = None
        """Has the formation opened first, if there is one."""
        self._manner: End = manner
        self._vehicles = vehicles
        self._left: dict[VehicleId, Vehicle] = {}
        for vehicle in self._ours.values():
            if not vehicle.autopilot.is_airborne(vehicle.telemetry):
                _keep_down(vehicle, now)

    def leave(self, now: Instant) -> None:
        """Begin to tell vehicles to circle or go home; those that have no height of their own yet get one."""
        self.stack.add(self._places())
        self._left = {i: vehicle for i, vehicle in self._ours.items() if vehicle.member is not Member.PARTED}
        self.advance(now)

    def advance(self, now: Instant) -> None:
        """Command vehicles that are in the air and have climbed out to loiter or go home; continue the landings."""
        for identity, vehicle in list(self._left.items()):
            autopilot, seen = vehicle.autopilot, vehicle.telemetry
            if seen.motion and autopilot.is_airborne(seen) and not autopilot.climbs_out(seen):
                height_m = self.stack.heights_m.get(identity, seen.motion.height_m)
                vehicle.commands.begin(autopilot.leave(self._manner, height_m, seen), now)
                del self._left[identity]
                if self._manner == "land":
                    self.landings.await_turn(vehicle, height_m)
        climbs_out = any(self._is_pending(identity, self._vehicles[identity]) for identity in self._left)
        self.landings.advance(now, climbs_out=climbs_out)

    def _places(self) -> dict[VehicleId, Motion]:
        armed = {identity: vehicle for identity, vehicle in self._ours.items() if vehicle.telemetry.armed}
        return {identity: place for identity, vehicle in armed.items() if (place := place_of(vehicle))}

    def hasten(self) -> None:
        """Begin no further landing, and wait for nothing but acknowledgements."""
        self.loiter_s = 0.0
        self.landings.called_off()

    def over(self, waited_s: float) -> bool:
        """Return whether the run is over, this long after vehicles were told to leave."""
        late = waited_s > self.loiter_s + LOITER_LIMIT_S and not self.landings.under_way
        return late or (waited_s >= self.loiter_s and not self.pending())

    def pending(self) -> list[Vehicle]:
        """Return the vehicles that can be reached and may not be left alone yet."""
        return [vehicle for identity, vehicle in self._vehicles.items() if self._is_pending(identity, vehicle)]

    def _is_pending(self, identity: VehicleId, vehicle: Vehicle) -> bool:
        if vehicle.connection.state not in TALKING:
            return False
        if vehicle.commands.outcome is Outcome.WAITING or self.landings.is_pending(vehicle):
            return True
        return identity in self._left and vehicle.telemetry.armed


def _floor_m(places: Sequence[tuple[float, float]], manner: End, ground: GroundFloor | None) -> float:
    """Return the lowest height for all circles: over the ground here or, with `rtl` and `land`, on the ways home."""
    if ground is None:
        return -math.inf
    if manner != "loiter":
        return max((ground.over_way_home(*place) for place in places), default=-math.inf)
    return max((ground.top(*place).height_m for place in places), default=-math.inf)


def _keep_down(vehicle: Vehicle, now: Instant) -> None:
    """Disarm a vehicle on the ground, even if an arming command is still pending."""
    unsafe = vehicle.telemetry.armed or vehicle.commands.outcome is Outcome.WAITING
    vehicle.commands.begin(vehicle.autopilot.stand_down() if unsafe else (), now)

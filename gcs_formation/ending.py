"""The end of a run: vehicles in the air circle at separate heights, here or at home, or land; others are disarmed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from airlink.clock import Instant
from airlink.identity import VehicleId
from formation_scenario.orders import End
from gcs_formation.landing import Landings, lowest_circle_m, why_not
from gcs_formation.link.connection import TALKING
from gcs_formation.loitering import GroundFloor, loiter_heights
from gcs_formation.membership import Member
from gcs_formation.vehicle.commands import Outcome
from gcs_formation.vehicle.telemetry import Motion
from gcs_formation.vehicle.vehicle import Vehicle


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
    ) -> None:
        """Assign heights; replace the pending commands of vehicles on the ground.

        `landings`: those of an earlier order to land, where a vehicle is still landing; it is left to that.
        """
        self.landings = landings or Landings(lambda: why_not(vehicles, ground) if ground else None)
        ours = {identity: vehicle for identity, vehicle in vehicles.items() if not self.landings.is_pending(vehicle)}
        places = {identity: _place(vehicle) for identity, vehicle in ours.items() if vehicle.telemetry.armed}
        floor_m = _floor_m([place for place in places.values() if place], manner, ground)
        if manner == "land":
            floor_m = max(floor_m, lowest_circle_m(vehicles))
        if manner != "loiter":  # they meet at home, wherever they are now
            places = {i: place._replace(north_m=0.0, east_m=0.0) if place else None for i, place in places.items()}
        self._heights_m = loiter_heights({identity: place for identity, place in places.items() if place}, floor_m)
        self._manner: End = manner
        self._vehicles = vehicles
        self._left = {i: vehicle for i, vehicle in ours.items() if vehicle.member is not Member.PARTED}
        for vehicle in ours.values():
            if not vehicle.autopilot.is_airborne(vehicle.telemetry):
                _keep_down(vehicle, now)
        self.advance(now)

    def advance(self, now: Instant) -> None:
        """Command vehicles that are in the air and have climbed out to loiter or go home; continue the landings."""
        for identity, vehicle in list(self._left.items()):
            autopilot, seen = vehicle.autopilot, vehicle.telemetry
            if seen.motion and autopilot.is_airborne(seen) and not autopilot.climbs_out(seen):
                height_m = self._heights_m.get(identity, seen.motion.height_m)
                vehicle.commands.begin(autopilot.leave(self._manner, height_m), now)
                del self._left[identity]
                if self._manner == "land":
                    self.landings.await_turn(vehicle, height_m)
        climbs_out = any(self._is_pending(identity, self._vehicles[identity]) for identity in self._left)
        self.landings.advance(now, climbs_out=climbs_out)

    def pending(self) -> list[Vehicle]:
        """Return the vehicles that can be reached and may not be left alone yet."""
        return [vehicle for identity, vehicle in self._vehicles.items() if self._is_pending(identity, vehicle)]

    def _is_pending(self, identity: VehicleId, vehicle: Vehicle) -> bool:
        if vehicle.connection.state not in TALKING:
            return False
        if vehicle.commands.outcome is Outcome.WAITING or self.landings.is_pending(vehicle):
            return True
        return identity in self._left and vehicle.telemetry.armed


def _floor_m(places: Sequence[Motion], manner: End, ground: GroundFloor | None) -> float:
    """Return the lowest height for all circles: over the ground here or, with `rtl` and `land`, on the ways home."""
    if ground is None:
        return -math.inf
    if manner != "loiter":
        return max((ground.over_way_home(place.north_m, place.east_m) for place in places), default=-math.inf)
    return max((ground.top(place.north_m, place.east_m).height_m for place in places), default=-math.inf)


def _place(vehicle: Vehicle) -> Motion | None:
    """Return a vehicle's position; that of one that is taking off has the height at which it will be done."""
    motion = vehicle.telemetry.motion
    if motion is None or not vehicle.autopilot.climbs_out(vehicle.telemetry):
        return motion
    return motion._replace(height_m=motion.height_m - motion.above_home_m + vehicle.autopilot.take_off_m)


def _keep_down(vehicle: Vehicle, now: Instant) -> None:
    """Disarm a vehicle on the ground, even if an arming command is still pending."""
    unsafe = vehicle.telemetry.armed or vehicle.commands.outcome is Outcome.WAITING
    vehicle.commands.begin(vehicle.autopilot.stand_down() if unsafe else (), now)

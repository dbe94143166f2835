"""The end of a run: the formation opens in height, then vehicles circle, here or at home, or land."""

from __future__ import annotations

import math
from collections.abc import Mapping

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from formation_scenario.orders import End
from gcs_formation.fleet.circle_heights import GroundFloor
from gcs_formation.link.link_health import TALKING
from gcs_formation.mission.landings import Landings, lowest_circle_m, may_be_armed, why_not_land
from gcs_formation.mission.vertical_separation import Ahead, Stack, home_of, place_of, stacked, stays
from gcs_formation.vehicle.acknowledgement import Outcome
from gcs_formation.vehicle.telemetry import ReportedMotion
from gcs_formation.vehicle.vehicle import Member, Vehicle

LOITER_LIMIT_S = 20.0
"""Longest wait for vehicles to climb out and acknowledge that they loiter."""


class Ending:
    """Brings every vehicle to a state in which it may be left alone.

    A vehicle that is taking off climbs out first; one that its pilot has taken over is left to the pilot.
    """

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        ground: GroundFloor,
        manner: End = "loiter",
        landings: Landings | None = None,
        ahead: Ahead = stays,
        gap_m: float = 0.0,
        sway_m: float = 0.0,
        climb_mps: float = math.inf,
    ) -> None:
        """Find everyone's place for the end; nobody is commanded yet.

        Args:
            vehicles: all of them.
            ground: the ground to keep clear of.
            manner: how the flight ends.
            landings: those of an earlier order to land, where a vehicle is still landing; it is left to that.
            ahead: the way on of a formation that is opened; by default vehicles leave where they are.
            gap_m: the distance that vehicles must be apart.
            sway_m: how far the air moves vehicles off their heights, a standard deviation.
            climb_mps: how fast all of them climb.
        """
        self.landings = landings or Landings(lambda: why_not_land(vehicles, ground))
        commanded = {identity: each for identity, each in vehicles.items() if not each.is_left}
        self._ours = {identity: each for identity, each in commanded.items() if not self.landings.is_pending(each)}
        stand = manner == "loiter" and all(each.autopilot.stands for each in self._ours.values())
        lowest_m = lowest_circle_m(vehicles) if manner == "land" else -math.inf
        self.stack = Stack(gap_m, lowest_m, sway_m=sway_m, together=manner != "loiter", stand=stand)
        homes = {identity: home for identity, each in self._ours.items() if (home := home_of(each))}
        self.limit_s = stacked(self._places(), self.stack, ground, manner, ahead, climb_mps, homes)
        """Longest time for which the formation is opened."""
        self._loiter_s = 0.0
        self._manner: End = manner
        self._vehicles = vehicles
        self._left: dict[VehicleId, Vehicle] = {}
        """Those that are still to be told to leave."""
        self._restarts: dict[VehicleId, int] = {}
        """How often each had restarted when it was told."""

    def begin(self, now: Instant, loiter_s: float = 0.0) -> None:
        """Keep vehicles on the ground there, whatever they were about to do; others loiter so long at the end."""
        self._loiter_s = loiter_s
        for vehicle in self._ours.values():
            if not vehicle.autopilot.is_airborne(vehicle.telemetry):
                _keep_down(vehicle, now)

    def leave(self, now: Instant) -> None:
        """Begin to tell vehicles to circle or go home; those that have no height of their own yet get one."""
        self.stack.add(self._places())
        self._left = {i: vehicle for i, vehicle in self._ours.items() if vehicle.member is not Member.PARTED}
        self.advance(now)

    def advance(self, now: Instant) -> None:
        """Command vehicles that are in the air and have climbed out to loiter or go home; continue the landings.

        One that has restarted since has forgotten that, and is commanded anew.
        """
        for identity, restarts in list(self._restarts.items()):
            vehicle = self._vehicles[identity]
            if vehicle.restarts > restarts:
                self.landings.drop(vehicle)
                self._left[identity] = vehicle
                del self._restarts[identity]
        for identity, vehicle in list(self._left.items()):
            autopilot, seen = vehicle.autopilot, vehicle.telemetry
            if seen.motion and autopilot.is_airborne(seen) and not autopilot.climbs_out(seen):
                height_m = self.stack.heights_m.get(identity, seen.motion.height_m)
                vehicle.commands.begin(autopilot.leave(self._manner, height_m, seen), now)
                del self._left[identity]
                self._restarts[identity] = vehicle.restarts
                if self._manner == "land":
                    self.landings.await_turn(vehicle, height_m)
        climbs_out = any(self._is_pending(identity, self._vehicles[identity]) for identity in self._left)
        self.landings.advance(now, climbs_out=climbs_out)

    def _places(self) -> dict[VehicleId, ReportedMotion]:
        armed = {identity: vehicle for identity, vehicle in self._ours.items() if vehicle.telemetry.armed}
        return {identity: place for identity, vehicle in armed.items() if (place := place_of(vehicle))}

    def hasten(self) -> None:
        """Begin no further landing, and wait for nothing but acknowledgements."""
        self._loiter_s = 0.0
        self.landings.call_off()

    def over(self, waited_s: float) -> bool:
        """Return whether the run is over, this long after vehicles were told to leave."""
        late = waited_s > self._loiter_s + LOITER_LIMIT_S and not self.landings.under_way
        return late or (waited_s >= self._loiter_s and not self.pending())

    def pending(self) -> list[Vehicle]:
        """Return the vehicles that can be reached and may not be left alone yet."""
        return [vehicle for identity, vehicle in self._vehicles.items() if self._is_pending(identity, vehicle)]

    def _is_pending(self, identity: VehicleId, vehicle: Vehicle) -> bool:
        if vehicle.connection.state not in TALKING:
            return False
        if vehicle.commands.outcome is Outcome.WAITING or self.landings.is_pending(vehicle):
            return True
        return identity in self._left and may_be_armed(vehicle)


def _keep_down(vehicle: Vehicle, now: Instant) -> None:
    """Disarm a vehicle on the ground, even if an arming command is still pending."""
    unsafe = vehicle.telemetry.armed or vehicle.commands.outcome is Outcome.WAITING
    vehicle.commands.begin(vehicle.autopilot.stand_down() if unsafe else (), now)

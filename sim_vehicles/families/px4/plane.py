# Compiled by mypyc: it runs every tick.

"""An emulated fixed-wing PX4."""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.messages.mission import MissionItemReached
from sim_vehicles.airframe.body import Body
from sim_vehicles.airframe.environment import Environment
from sim_vehicles.airframe.motion import Vector
from sim_vehicles.autopilot.autopilot import CRITICAL, GivenCommand, Setpoint
from sim_vehicles.autopilot.commands import ACCEPTED, position_of
from sim_vehicles.autopilot.mission_flight import MissionFlight
from sim_vehicles.autopilot.mission_items import Item
from sim_vehicles.autopilot.missions import Missions
from sim_vehicles.autopilot.modes_and_failsafe import PX4_AS_PLANE, FlightMode, Mode, Px4Mode, Request
from sim_vehicles.autopilot.pilot import PlanePilot
from sim_vehicles.config import FleetConfig
from sim_vehicles.families.px4.px4 import HANDLERS, Px4
from sim_vehicles.families.px4.stored_mission import Px4Missions

REFERENCE_CLIMB_MPS: Final = 3.0
"""A fixed wing's height reference begins at sea level at boot and rises this fast."""


def _land(vehicle: Px4Plane, _given: GivenCommand) -> int:
    """Fly the mission's landing; without one this is accepted too, and a text says that nothing follows."""
    if not vehicle.missions.choose_landing():
        vehicle.say(CRITICAL, "Planned mission landing not available")
    else:
        vehicle.switch(Px4Mode.MISSION)
    return ACCEPTED


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4Plane(Px4):
    """An emulated fixed-wing PX4."""

    emulates = "px4_plane"
    mav_type = m.MAV_TYPE_FIXED_WING
    flown = PX4_AS_PLANE
    boot_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    ground_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    air_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    handlers = HANDLERS | {m.MAV_CMD_DO_LAND_START: _land}
    flier: PlanePilot
    """Its pilot, typed as such."""

    def __init__(self, index: int, fleet: FleetConfig, body: Body, environment: Environment, now: Instant) -> None:
        """Boot at `now`."""
        super().__init__(index, fleet, body, environment, now)
        self._mission_flight = MissionFlight(self.missions, self.flier, self.parameters, self.origin)

    def make_missions(self, home: Item) -> Missions:
        """Return what stores its mission, whose items are numbered from 0."""
        return Px4Missions(home)

    @property
    def flies_mission(self) -> bool:
        """Whether it flies by its stored mission."""
        return self._mode is Px4Mode.MISSION and self.pilot.condition.armed

    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether that was allowed. MISSION needs items."""
        if number == Px4Mode.MISSION and not self.missions.flyable:
            self.say(CRITICAL, "Switching to Mission is currently not available")
            return False
        return super().switch(number)

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already; in MISSION the current item is begun."""
        before = self._mode
        super().enter(mode)
        if self._mode is not before:
            self.missions.in_mode = self._mode is Px4Mode.MISSION
            if before is Px4Mode.MISSION:
                self._mission_flight.pause()
            elif self.flies_mission:
                self._mission_flight.resume()

    def make_pilot(self) -> PlanePilot:
        """Return who flies a fixed wing."""
        self.flier = PlanePilot(self.config, self.body.steering, self.parameters)
        return self.flier

    def change_speed(self, speed_mps: float) -> None:
        """Fly at an airspeed in HOLD from now on."""
        self.flier.change_speed(self._airspeed(speed_mps), math.inf)

    def _airspeed(self, speed_mps: float) -> float:
        """Return an airspeed limited to its range; that it is limited is not reported."""
        return min(max(speed_mps, self.parameters["FW_AIRSPD_MIN"]), self.parameters["FW_AIRSPD_MAX"])

    def climb_to(self, height_m: float) -> None:
        """Circle at a height above the origin."""
        self.flier.change_height(height_m)

    def lift_off(self, height_m: float) -> None:
        """Roll and climb."""
        self.pilot.enter(Mode.TAKEOFF, self.body.motion)
        self.flier.take_off(height_m, self.body.motion)

    def follow(self, message: Setpoint) -> None:
        """Fly to a position at its trim speed, whatever speed is asked for; a velocity without one is ignored."""
        position_m = position_of(self, message)
        if position_m is not None:
            self.flier.change_speed(self.parameters["FW_AIRSPD_TRIM"], math.inf)
            self.flier.circle(*position_m)

    def follow_time(self) -> None:
        """Continue a mission; crash if it took off before its height reference had risen to the field's altitude."""
        super().follow_time()
        if self.flies_mission:
            for seq in self._mission_flight.turn(self.body.motion, self.now):
                self.broadcast(MissionItemReached(seq - 1))
            if self._mission_flight.ended:
                self.switch(Px4Mode.HOLD)
        climbs = self._mode is Px4Mode.TAKEOFF and self.pilot.airborne
        if climbs and REFERENCE_CLIMB_MPS * self.time_s < self.origin.alt_m:
            self.crash(Request.CRASH)

    def fly_there(self, position_m: Vector, speed_mps: float) -> None:
        """Fly straight to a position far away, and circle it."""
        if speed_mps > 0.0:
            self.flier.change_speed(self._airspeed(speed_mps), math.inf)
        self.flier.circle(*position_m)

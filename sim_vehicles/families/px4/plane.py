# Compiled by mypyc: it runs every tick.

"""An emulated fixed-wing PX4."""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from sim_vehicles.airframe.motion import Vector
from sim_vehicles.autopilot.autopilot import Setpoint
from sim_vehicles.autopilot.commands import place_of
from sim_vehicles.autopilot.modes_and_failsafe import PX4_AS_PLANE, Mode, Px4Mode, Request
from sim_vehicles.autopilot.pilot import PlanePilot
from sim_vehicles.families.px4.px4 import Px4

REFERENCE_CLIMB_MPS: Final = 3.0
"""A fixed wing's height reference begins at sea level at boot and rises this fast."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4Plane(Px4):
    """An emulated fixed-wing PX4."""

    emulates = "px4_plane"
    mav_type = m.MAV_TYPE_FIXED_WING
    flown = PX4_AS_PLANE
    boot_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    ground_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    air_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    flier: PlanePilot
    """Its pilot, typed as such."""

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
        """Fly to a place at its trim speed, whatever speed is asked for; a velocity without a place is ignored."""
        place_m = place_of(self, message)
        if place_m is not None:
            self.flier.change_speed(self.parameters["FW_AIRSPD_TRIM"], math.inf)
            self.flier.circle(*place_m)

    def follow_time(self) -> None:
        """Crash if it took off before its height reference had risen to the field's altitude."""
        super().follow_time()
        climbs = self._mode is Px4Mode.TAKEOFF and self.pilot.airborne
        if climbs and REFERENCE_CLIMB_MPS * self.time_s < self.origin.alt_m:
            self.crash(Request.CRASH)

    def fly_there(self, place_m: Vector, speed_mps: float) -> None:
        """Fly straight to a place far away, and circle it."""
        if speed_mps > 0.0:
            self.flier.change_speed(self._airspeed(speed_mps), math.inf)
        self.flier.circle(*place_m)

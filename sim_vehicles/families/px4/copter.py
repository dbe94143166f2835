# Compiled by mypyc: it runs every tick.

"""An emulated PX4 multirotor.

Source: PX4 user guide, "Parameter Reference" (MPC_TKO_SPEED, MPC_XY_CRUISE, NAV_MC_ALT_RAD, MPC_LAND_ALT1); the
multirotor's speeds and times are those of PX4 1.17's built-in simulator.
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from sim_vehicles.airframe.motion import Motion, Vector
from sim_vehicles.autopilot.autopilot import GivenCommand, Setpoint
from sim_vehicles.autopilot.commands import ACCEPTED, YAW_IGNORED, position_of, velocity_of, yaw_rate_of
from sim_vehicles.autopilot.copter_pilot import CM_PER_M, Circle, CopterPilot
from sim_vehicles.autopilot.modes_and_failsafe import PX4_AS_COPTER, CopterMode, Px4Mode
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.families.px4.px4 import HANDLERS, Px4

SPOOL_UP_S: Final = 4.0
"""From the order to take off until it leaves the ground."""
SLOW_TO_M: Final = 10.0
"""Height up to which it takes off at MPC_TKO_SPEED (MPC_LAND_ALT1)."""
NEAR_M: Final = 0.8
"""A take-off is complete this near its height (NAV_MC_ALT_RAD)."""
ORBIT: Final[tuple[float, ...]] = 1.0, 1.0
"""Radius, m, and speed, m/s, of a circle of which none is commanded."""


class Px4CopterPilot(CopterPilot):
    """Flies a multirotor as PX4 does, whose rotors spool up before a take-off."""

    _idle_cycles: int = 0
    """Cycles of the main loop until it leaves the ground."""

    def rise(self, height_m: float) -> bool:
        """Take off to a height; return whether that is possible."""
        self._idle_cycles = round(SPOOL_UP_S / LOOP_S)
        return super().rise(height_m)

    def _climb(self, motion: Motion, height_m: float) -> None:
        if self._idle_cycles > 0:
            self._idle_cycles -= 1
        else:
            super()._climb(motion, height_m)

    def _climb_max_mps(self, motion: Motion) -> float:
        return super()._climb_max_mps(motion) if motion.height_m > SLOW_TO_M else self._parameters["MPC_TKO_SPEED"]

    def _cruise_mps(self) -> float:
        """Return the speed of flights to positions: the highest one in OFFBOARD."""
        commanded = self.mode is CopterMode.GUIDED or "WPNAV_SPEED" in self.commanded_cmps
        return super()._cruise_mps() if commanded else self._parameters["MPC_XY_CRUISE"]


def _orbit(vehicle: Px4Copter, given: GivenCommand) -> int:
    """Change to ORBIT, and fly round a position, anticlockwise for a negative radius or speed.

    Where a value isn't finite, the present position and height, and the usual radius and speed are taken.
    """
    radius_m, speed_mps = (
        commanded if math.isfinite(commanded) else usual for commanded, usual in zip(given.params, ORBIT, strict=False)
    )
    here, origin = vehicle.body.motion, vehicle.origin
    centre_m = here.north_m, here.east_m
    if math.isfinite(given.lat_rad) and math.isfinite(given.lon_rad):
        north_m, east_m, _ = origin.to_ned(given.lat_rad, given.lon_rad, origin.alt_m)
        centre_m = north_m, east_m
    height_m = given.z - origin.alt_m if math.isfinite(given.z) else here.height_m
    vehicle.orbit((*centre_m, height_m, abs(radius_m), math.copysign(speed_mps, radius_m * speed_mps)))
    return ACCEPTED


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4Copter(Px4):
    """An emulated PX4 multirotor."""

    emulates = "px4_copter"
    mav_type = m.MAV_TYPE_QUADROTOR
    guided_mode = Px4Mode.OFFBOARD
    flown = PX4_AS_COPTER
    boot_mode = PX4_AS_COPTER[Px4Mode.HOLD]
    ground_mode = PX4_AS_COPTER[Px4Mode.HOLD]
    air_mode = PX4_AS_COPTER[Px4Mode.HOLD]
    handlers = HANDLERS | {m.MAV_CMD_DO_ORBIT: _orbit}
    flier: Px4CopterPilot
    """Its pilot, typed as such."""

    def make_pilot(self) -> Px4CopterPilot:
        """Return who flies a multirotor."""
        self.flier = Px4CopterPilot(self.config, self.body.steering, self.parameters)
        return self.flier

    def prepare(self, height_m: float) -> bool:
        """Change to TAKEOFF, to a height; armed or in flight it climbs. Return whether that was allowed."""
        if not self.pilot.airborne:
            return super().prepare(height_m)
        granted = self.switch(Px4Mode.TAKEOFF)
        if granted:
            self.flier.takeoff_m = height_m
        return granted

    def change_speed(self, speed_mps: float) -> None:
        """Fly at a speed in HOLD from now on."""
        self.flier.commanded_cmps["WPNAV_SPEED"] = CM_PER_M * speed_mps

    def climb_to(self, height_m: float) -> None:
        """Fly at a height above the origin, where it is."""
        if self.pilot.airborne:
            self.flier.go_to((self.body.motion.north_m, self.body.motion.east_m, height_m), None)

    def orbit(self, circle: Circle) -> None:
        """Change to ORBIT, and fly round a position."""
        self._intended, self._lost = Px4Mode.ORBIT, False
        self.enter(Px4Mode.ORBIT)
        self.flier.go_round(circle)

    def lift_off(self, height_m: float) -> None:
        """Climb straight up."""
        self.flier.mode = CopterMode.GUIDED
        self.flier.rise(height_m)

    def follow_time(self) -> None:
        """Change to HOLD once it is near the height of its take-off, and climb on to it."""
        rises_m, here = self.flier.takeoff_m, self.body.motion
        near = rises_m is not None and abs(rises_m - here.height_m) < NEAR_M
        if near and self._mode is Px4Mode.TAKEOFF:
            self.flier.takeoff_m = None
        super().follow_time()
        if near and rises_m is not None and self._mode is Px4Mode.HOLD:
            self.flier.go_to((here.north_m, here.east_m, rises_m), None)

    def follow(self, message: Setpoint) -> None:
        """Fly to a position, or at a velocity; stop for any other setpoint."""
        position_m, velocity_mps = position_of(self, message), velocity_of(self, message)
        yaw_rad = None if message.type_mask & YAW_IGNORED else message.yaw_rad
        nose_rad = self.flier.commanded_nose(self.body.shown().heading_rad)
        if position_m is not None:
            self.flier.go_to(position_m, yaw_rad)
        elif velocity_mps is not None:
            self.flier.obey(velocity_mps, yaw_rad, self.now)
        else:
            self.flier.stop()
        if rate_rps := yaw_rate_of(message):
            self.flier.turn_on(nose_rad, rate_rps)

    def fly_there(self, position_m: Vector, speed_mps: float) -> None:  # noqa: ARG002 - at its own speed
        """Fly straight to a position, its nose ahead, and stay there."""
        here = self.body.motion
        self.flier.go_to(position_m, math.atan2(position_m[1] - here.east_m, position_m[0] - here.north_m))

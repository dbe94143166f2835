# Compiled by mypyc: it runs every tick.

"""An emulated fixed-wing PX4 of a version that has Guided Course.

Source: PX4 user guide, "Guided Course Mode (Fixed-Wing)"; PX4's `navigator/course.cpp` and `navigator_main.cpp`.
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.messages.payload import DEG
from sim_vehicles.autopilot.autopilot import GivenCommand
from sim_vehicles.autopilot.commands import ACCEPTED, DENIED
from sim_vehicles.autopilot.modes_and_failsafe import PX4_AS_PLANE, FlightMode, Mode, Px4Mode
from sim_vehicles.families.px4 import plane
from sim_vehicles.families.px4.plane import Px4Plane

GUIDED_COURSE: Final = Px4Mode.GUIDED_COURSE


def _change_course(vehicle: Px4CoursePlane, given: GivenCommand) -> int:
    """Fly a course over ground; DENIED outside the mode, for another type, and for one that isn't finite."""
    kind, degrees = given.params[0], given.params[1]
    is_course = round(kind) == m.HEADING_TYPE_COURSE_OVER_GROUND if math.isfinite(kind) else False
    if vehicle.mode is not GUIDED_COURSE or not is_course or not math.isfinite(degrees):
        return DENIED
    vehicle.flier.steer(degrees * DEG, course=True, lateral_mps2=math.inf)
    return ACCEPTED


def _change_speed(vehicle: Px4CoursePlane, given: GivenCommand) -> int:
    """Fly an airspeed within its limits; 0 and less is that of cruise."""
    if vehicle.mode is not GUIDED_COURSE:
        return vehicle.earlier(m.MAV_CMD_DO_CHANGE_SPEED, given)
    asked_mps = given.params[1]
    vehicle.change_speed(asked_mps if 0.0 < asked_mps < math.inf else vehicle.parameters["FW_AIRSPD_TRIM"])
    return ACCEPTED


def _change_altitude(vehicle: Px4CoursePlane, given: GivenCommand) -> int:
    """Fly at an altitude above sea level; in other modes it changes to Hold."""
    if vehicle.mode is not GUIDED_COURSE:
        return vehicle.earlier(m.MAV_CMD_DO_CHANGE_ALTITUDE, given)
    if math.isfinite(given.params[0]):
        vehicle.climb_to(given.params[0] - vehicle.origin.alt_m)
    return ACCEPTED


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4CoursePlane(Px4Plane):
    """An emulated fixed-wing PX4 with Guided Course."""

    emulates = "px4_course"
    version = 1 << 24 | 18 << 16
    flown = PX4_AS_PLANE | {Px4Mode.GUIDED_COURSE: Mode.GUIDED}
    air_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    guided_mode = Px4Mode.GUIDED_COURSE
    handlers = Px4Plane.handlers | {
        m.MAV_CMD_GUIDED_CHANGE_HEADING: _change_course,
        m.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
        m.MAV_CMD_DO_CHANGE_ALTITUDE: _change_altitude,
    }

    def earlier(self, command: int, given: GivenCommand) -> int:
        """Carry out a command as earlier versions do."""
        return int(plane.Px4Plane.handlers[command](self, given))

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already; Guided Course goes on with course and altitude."""
        before = self._mode
        super().enter(mode)
        if self._mode is GUIDED_COURSE is not before and self.pilot.airborne:
            motion = self.body.motion
            course_rad = math.atan2(motion.velocity_east_mps, motion.velocity_north_mps)
            self.change_speed(self.parameters["FW_AIRSPD_TRIM"])
            self.climb_to(motion.height_m)
            self.flier.steer(course_rad, course=True, lateral_mps2=math.inf)

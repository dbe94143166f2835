# Compiled by mypyc: it runs every tick.

"""PX4 fixed wings in Guided Course, which versions from 1.18 have: course, airspeed and altitude by a command each.

It flies the commanded course over ground for ever; Hold is a mode like any other then, by which a pilot takes over.
Entering it captures course and altitude, and resets the airspeed to FW_AIRSPD_TRIM.

Source: PX4 user guide, "Guided Course Mode (Fixed-Wing)"; PX4's `navigator/course.cpp` and its handling of
MAV_CMD_GUIDED_CHANGE_HEADING (`navigator_main.cpp`), DENIED outside the mode and of other types than a course; the
mode's number is `PX4_CUSTOM_SUB_MODE_GUIDED_COURSE`. Flown by its simulator, version 1.18 (development, August 2026).
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.command import CommandInt
from flight_model.flight_state import FlightState, Setpoint
from gcs_formation.vehicle.autopilot_family import KnownSetpoints
from gcs_formation.vehicle.families.px4.plane import Px4Plane, course_over_ground_rad
from gcs_formation.vehicle.families.px4.px4 import LOITER, TAKEOFF
from gcs_formation.vehicle.mode_names import AUTO, px4_mode
from gcs_formation.vehicle.startup_step import Command, StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry

GUIDED_COURSE: Final = px4_mode(AUTO, 19)
HAS_COURSE: Final = (GUIDED_COURSE, TAKEOFF)
"""Modes that show that it has the mode: itself, and the one that follows."""
SPEED: Final = m.MAV_CMD_DO_CHANGE_SPEED
COURSE: Final = m.MAV_CMD_GUIDED_CHANGE_HEADING
ALTITUDE: Final = m.MAV_CMD_DO_CHANGE_ALTITUDE
AS_IT_IS: Final = -1.0
"""A throttle that isn't changed."""
DEGREES: Final = 180.0 / math.pi
ALL_ROUND_DEG: Final = 360.0 - 2.0**-16
"""The least course that rounds to 360 degrees as a 32-bit float."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4Course(Px4Plane):
    """A fixed-wing PX4, commanded in Guided Course."""

    family = "PX4 fixed wing in Guided Course"
    guided_mode = GUIDED_COURSE
    circling_mode = LOITER
    setpoint_commands = (SPEED, COURSE, ALTITUDE)
    setpoints_set_mode = False
    left_alone = "flies its last course for ever"

    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Command, ...]:
        """Return all three commands."""
        return (self._speed(setpoint, where), self._altitude(setpoint), self._course(setpoint, where))

    def changed(self, setpoint: Setpoint, where: FlightState, known: KnownSetpoints) -> list[Message]:
        """Return those commands of `setpoint` that aren't `known`."""
        speed, course, altitude = known
        found = list[Message]()
        if speed is None:
            found.append(self._speed(setpoint, where))
        else:
            self.keep_setpoint()
        if altitude is None:
            found.append(self._altitude(setpoint))
        if course is None:
            found.append(self._course(setpoint, where))
        return found

    def _waits(self) -> tuple[StartUpStep, ...]:
        """Return also one that sees on the ground whether it has the mode: earlier versions refuse it."""
        name = "set mode GUIDED_COURSE on the ground, which versions from 1.18 have"
        return (*super()._waits(), StartUpStep(name, self._has_course, lambda _: (self.set_mode(GUIDED_COURSE),)))

    def _has_course(self, seen: Telemetry) -> bool:
        return self.is_airborne(seen) or seen.armed or seen.custom_mode in HAS_COURSE

    def _speed(self, setpoint: Setpoint, where: FlightState) -> CommandInt:
        commanded_mps, lead = self.commanded_airspeed(setpoint.speed_mps), self._lead
        if lead is not None:
            commanded_mps = lead.lead(commanded_mps, self.commanded_airspeed(where.airspeed_mps))
        return self._guided(SPEED, m.SPEED_TYPE_AIRSPEED, commanded_mps, AS_IT_IS)

    def _altitude(self, setpoint: Setpoint) -> CommandInt:
        return self._guided(ALTITUDE, setpoint.height_m + self.origin.alt_m, m.MAV_FRAME_GLOBAL)

    def _course(self, setpoint: Setpoint, where: FlightState) -> CommandInt:
        degrees = course_over_ground_rad(setpoint, where) * DEGREES % 360.0
        return self._guided(COURSE, m.HEADING_TYPE_COURSE_OVER_GROUND, degrees if degrees < ALL_ROUND_DEG else 0.0)

    def _guided(self, command: int, param1: float, param2: float, param3: float = 0.0) -> CommandInt:
        frame = m.MAV_FRAME_GLOBAL_INT
        return CommandInt(self.system, m.MAV_COMP_ID_AUTOPILOT1, frame, command, 0, 0, param1, param2, param3)

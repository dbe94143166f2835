"""PX4, fixed wing, and its parameters on which a flight in formation depends.

It is commanded in AUTO.LOITER ("Hold") by a stream of MAV_CMD_DO_REPOSITION: outside of the circle around the place
it is sent to it flies straight there, so a place far ahead is a course. In OFFBOARD it takes no airspeed.

Sources: PX4 user guide, "Hold Mode (Fixed-Wing)", "Takeoff Mode (Fixed-Wing)", "Parameter Reference" and "Safety
Configuration (Failsafes)"; its acceptance and refusals as its simulator (SIH) showed them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from airlink import mavlink as m
from airlink.messages.command import CommandInt
from airlink.messages.system import Heartbeat
from flight_model.autopilot import FlightState
from gcs_formation.estimation.flight_state import Setpoint
from gcs_formation.vehicle.autopilot import Command, Step
from gcs_formation.vehicle.checks import Check, Demands, envelope_checks
from gcs_formation.vehicle.px4 import LOITER, RTL, TAKEOFF, UNCHANGED, Px4, heartbeats_lost
from gcs_formation.vehicle.telemetry import Telemetry

LARGEST_CIRCLE_M = 100.0
"""Radius for which circles at the end are kept apart, and beyond which a place 400 m ahead is no course."""
AIM_M = 400.0
"""Distance of the place ahead that a setpoint names. Nearer than the circle's radius (NAV_LOITER_RAD, 80 m) and 7 s of
flight (NPFG_PERIOD 10 s, damping 0.7), PX4 bends towards the circle; when setpoints stop it flies there and circles."""
REFERENCE_CLIMB_MPS = 3.0
"""After boot the height controller's reference begins at sea level and rises this fast (FW_T_CLMB_R_SP); who takes off
before it has come to the field's altitude dives into the ground. Seen in version 1.17 (development)."""
DEFAULT_SPEED = -1.0


def px4_plane_checks(asked: Demands) -> tuple[Check, ...]:
    """Return what to read from a fixed-wing PX4 of which a scenario asks this much."""
    return (
        heartbeats_lost("circles where the last setpoint led"),
        *envelope_checks(
            asked, "FW_AIRSPD_MIN", "FW_AIRSPD_MAX", "FW_AIRSPD_TRIM", "FW_R_LIM", ("raised to it", "lowered to it")
        ),
        Check(
            ("NAV_LOITER_RAD",),
            f"up to {LARGEST_CIRCLE_M:g} m; wider circles may meet, and bend the course",
            lambda value: abs(value) <= LARGEST_CIRCLE_M,
        ),
    )


class Px4Plane(Px4):
    """A fixed-wing PX4, commanded in AUTO.LOITER by MAV_CMD_DO_REPOSITION."""

    family = "PX4 fixed wing"
    take_off_m = 45.0
    take_off_to_m = 50.0
    guided_mode = LOITER
    setpoint_commands = (m.MAV_CMD_DO_REPOSITION,) * 3
    setpoints_set_mode = True
    """DO_REPOSITION without that (its second parameter) is UNSUPPORTED."""

    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is that of a fixed-wing PX4; its others don't fly by these commands."""
        return heartbeat.autopilot == m.MAV_AUTOPILOT_PX4 and heartbeat.type == m.MAV_TYPE_FIXED_WING

    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[Step, ...]:
        """Return the steps: streams, ready, take-off, which ends in HOLD; what is done already is left out."""
        return (
            Step("asked for telemetry", lambda seen: seen.complete, lambda _: self._questions(rates_hz), 20.0, True),
            Step("waited for it to be ready to arm", self._is_ready, timeout_s=90.0),
            Step("waited for its height controller to come up to the field", self._reference_is_up, timeout_s=1200.0),
            Step("told it to take off", self._is_taking_off, self._to_take_off, takes_off=True),
            Step("armed", lambda seen: seen.armed, self._to_arm, 30.0, takes_off=True),
            Step("waited for it to climb", self._has_climbed, timeout_s=120.0),
            Step("set mode HOLD", self.takes_setpoints, lambda _: (self.set_mode(LOITER),)),
        )

    def checks(self, asked: Demands) -> tuple[Check, ...]:
        """Return failsafe and limits."""
        return px4_plane_checks(asked)

    def climbs_out(self, telemetry: Telemetry) -> bool:
        """Return whether it is in TAKEOFF, below the height at which that ends."""
        motion = telemetry.motion
        return motion is not None and telemetry.custom_mode == TAKEOFF and motion.above_home_m <= self.take_off_m

    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Command, ...]:
        """Return one command: airspeed, altitude above sea level, and a place ahead.

        PX4 flies a course over ground: that of the airspeed along the heading, plus the wind as the station knows it.
        """
        north_mps = setpoint.speed_mps * math.cos(setpoint.heading_rad) + where.wind_north_mps
        east_mps = setpoint.speed_mps * math.sin(setpoint.heading_rad) + where.wind_east_mps
        course_rad = math.atan2(east_mps, north_mps)
        north_m = where.north_m + AIM_M * math.cos(course_rad)
        east_m = where.east_m + AIM_M * math.sin(course_rad)
        return (self._reposition(north_m, east_m, setpoint.height_m, setpoint.speed_mps),)

    def loiter(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
        """Return HOLD, then the place and height.

        When the mode is acknowledged no acknowledgement of an earlier setpoint, which is the same command as the
        place, is on its way any more.
        """
        place = seen.motion
        return (self.set_mode(LOITER), self._reposition(place.north_m, place.east_m, height_m)) if place else ()

    def go_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
        """Return HOLD over its home; RTL, whose height is the same for all, if it hasn't told where that is."""
        if seen.home_m is None:
            return (self.set_mode(RTL),)
        return (self.set_mode(LOITER), self._reposition(*seen.home_m, height_m))

    def _reposition(self, north_m: float, east_m: float, height_m: float, speed_mps: float = DEFAULT_SPEED) -> Command:
        lat_rad, lon_rad, alt_m = self.origin.from_ned(north_m, east_m, -height_m)
        return CommandInt(
            self.system,
            m.MAV_COMP_ID_AUTOPILOT1,
            m.MAV_FRAME_GLOBAL_INT,
            m.MAV_CMD_DO_REPOSITION,
            param1=speed_mps,
            param2=m.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE,
            param4=UNCHANGED,
            x=round(math.degrees(lat_rad) * 1e7),
            y=round(math.degrees(lon_rad) * 1e7),
            z=alt_m,
        )

    def _reference_is_up(self, seen: Telemetry) -> bool:
        motion = seen.motion
        risen_m = REFERENCE_CLIMB_MPS * motion.stamp_s if motion else 0.0
        return self.is_airborne(seen) or risen_m >= self._home_above_sea_m(seen)

# Compiled by mypyc: it runs every tick.

"""PX4 fixed wings: how they are commanded, and the parameters on which a flight depends.

A fixed wing is commanded in AUTO.LOITER ("Hold") by a stream of MAV_CMD_DO_REPOSITION. Outside the loiter circle around
the commanded position it flies straight there, so a position far ahead commands a course. In OFFBOARD it takes no
airspeed.

Sources: PX4 user guide, "Flight Modes" ("Hold" and "Takeoff" of fixed wings, "Offboard", "Return"), "Parameter
Reference" and "Safety Configuration (Failsafes)"; what it accepts and refuses was observed in its simulator (SIH).
"""

from __future__ import annotations

import math
from typing import ClassVar

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.messages.command import CommandInt
from flight_model.earth import GeodeticOrigin
from flight_model.flight_state import FlightState, Setpoint
from flight_model.slot import Vector3
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.estimation.airspeed import AirspeedScale
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.checks import Check, climb_check, envelope_checks, only_read
from gcs_formation.vehicle.craft import Craft
from gcs_formation.vehicle.families.px4.px4 import LOITER, RTL, UNCHANGED, Px4, heartbeats_lost
from gcs_formation.vehicle.own_fence import GEOFENCE_NAMES
from gcs_formation.vehicle.startup_step import Command, StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.velocity_setpoint import (
    SpeedLead,
    speed_lead,
)

LARGEST_CIRCLE_M = 100.0
"""Loiter radius for which circles at the end are separated, and up to which a position 400 m ahead is a course, m."""
AIM_M = 400.0
"""Distance to the position ahead that commands a course, m. Within the loiter radius (NAV_LOITER_RAD, 80 m) plus 7 s of
flight (NPFG_PERIOD 10 s, damping 0.7) PX4 would turn onto the circle. It circles there when setpoints stop."""
REFERENCE_CLIMB_MPS = 3.0
"""After boot the height controller's reference starts at sea level and rises at this rate (FW_T_CLMB_R_SP). A vehicle
that takes off before it reaches the field's altitude dives into the ground. Observed in version 1.17 (development)."""
DEFAULT_SPEED = -1.0


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4Plane(Px4):
    """A fixed-wing PX4, commanded in AUTO.LOITER by MAV_CMD_DO_REPOSITION."""

    family = "PX4 fixed wing"
    types = frozenset({m.MAV_TYPE_FIXED_WING})
    take_off_m = 45.0
    take_off_to_m = 50.0
    guided_mode = LOITER
    setpoint_commands = (m.MAV_CMD_DO_REPOSITION,) * 3
    setpoints_set_mode = True
    """DO_REPOSITION without the flag for this (its second parameter) is UNSUPPORTED."""
    left_alone: ClassVar[str] = "circles where the last setpoint led"
    """What it does without setpoints, in words."""
    flies_courses = True
    lands_by_mission = True
    landing_is_marked = False

    def __init__(
        self,
        system: int,
        origin: GeodeticOrigin,
        turn_rate_max_rps: float,
        airspeed_scale: AirspeedScale | None = None,
        lead: SpeedLead | None = None,
    ) -> None:
        """Address `system`; `lead`, in airspeed readings, compensates the slow integrator of its model."""
        super().__init__(system, origin, turn_rate_max_rps, airspeed_scale)
        self._lead = lead

    @classmethod
    def of(cls, craft: Craft) -> Autopilot:
        """Return the interface to a vehicle's autopilot."""
        return cls(
            craft.system,
            craft.origin,
            craft.model.turn_rate_max_rps,
            craft.airspeed_scale,
            speed_lead(craft.model, craft.tick_s),
        )

    def forget_setpoints(self) -> None:
        """Restart the lead compensation."""
        if self._lead is not None:
            self._lead.reinitialise()

    def checks(self, model: VehicleModel, path: PathPlan) -> tuple[Check, ...]:
        """Return the checks of failsafe and limits."""
        directions = "raised to it", "lowered to it"
        return (
            heartbeats_lost(self.left_alone),
            *envelope_checks(
                model,
                path,
                self.commanded_airspeed(path.begin_mps),
                "FW_AIRSPD_MIN",
                "FW_AIRSPD_MAX",
                "FW_AIRSPD_TRIM",
                "FW_R_LIM",
                directions,
            ),
            Check(
                ("NAV_LOITER_RAD",),
                f"up to {LARGEST_CIRCLE_M:g} m; wider circles may meet, and bend the course",
                lambda value: abs(value) <= LARGEST_CIRCLE_M,
                asks=LARGEST_CIRCLE_M,
            ),
            climb_check(("FW_T_CLMB_R_SP",), model),
            climb_check(("FW_T_SINK_R_SP",), model),
            *map(only_read, GEOFENCE_NAMES),
        )

    @property
    def speeds_mps(self) -> tuple[float, float] | None:
        """The part of a change left to its integrator takes a minute, so these are what the lead can reach now."""
        limits_mps, lead = super().speeds_mps, self._lead
        if lead is None:
            return limits_mps
        slowest_mps, fastest_mps = map(self.true_airspeed, lead.within_reach_mps)
        if limits_mps is None:
            return slowest_mps, fastest_mps
        return max(slowest_mps, limits_mps[0]), min(fastest_mps, limits_mps[1])

    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Command, ...]:
        """Return one command: airspeed, altitude above sea level, and a position ahead.

        PX4 flies a course over ground: the direction of airspeed along the heading plus the station's wind estimate.
        """
        course_rad = course_over_ground_rad(setpoint, where)
        north_m = where.north_m + AIM_M * math.cos(course_rad)
        east_m = where.east_m + AIM_M * math.sin(course_rad)
        commanded_mps, lead = self.commanded_airspeed(setpoint.speed_mps), self._lead
        if lead is not None:
            commanded_mps = lead.lead(commanded_mps, self.commanded_airspeed(where.airspeed_mps))
        return (self._reposition(north_m, east_m, setpoint.height_m, commanded_mps),)

    def quantities(self, setpoint: Setpoint, where: FlightState) -> Vector3:
        """Return the airspeed with its lead, the course over ground, and the height."""
        commanded_mps, lead = self.commanded_airspeed(setpoint.speed_mps), self._lead
        if lead is not None:
            commanded_mps = lead.led(commanded_mps, self.commanded_airspeed(where.airspeed_mps))
        return commanded_mps, course_over_ground_rad(setpoint, where), setpoint.height_m

    @property
    def prompt_share(self) -> float:
        """The model's."""
        return 1.0 if self._lead is None else self._lead.prompt_share

    def keep_setpoint(self) -> None:
        """Let the lead compensation go on from the airspeed that is held."""
        if self._lead is not None:
            self._lead.keep()

    def loiter(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
        """Return HOLD, then position and height if its position is known.

        Setpoints use the same command as the position. Once the mode is acknowledged, no acknowledgement of an earlier
        setpoint is still on its way.
        """
        motion = seen.motion
        if motion is None:
            return self.hold()
        return (*self.hold(), self._reposition(motion.north_m, motion.east_m, height_m))

    def go_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
        """Return HOLD over its home, or if that is unknown RTL, whose height is the same for all."""
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

    def _waits(self) -> tuple[StartUpStep, ...]:
        reference = "waited for its height controller to come up to the field"
        return (StartUpStep(reference, self._reference_is_up, timeout_s=1200.0),)

    def _reference_is_up(self, seen: Telemetry) -> bool:
        motion = seen.motion
        risen_m = REFERENCE_CLIMB_MPS * motion.stamp_s if motion else 0.0
        return self.is_airborne(seen) or risen_m >= self._home_above_sea_m(seen)


def course_over_ground_rad(setpoint: Setpoint, where: FlightState) -> float:
    """Return the course over ground of airspeed along a setpoint's heading, plus the wind."""
    north_mps = setpoint.speed_mps * math.cos(setpoint.heading_rad) + where.wind_north_mps
    east_mps = setpoint.speed_mps * math.sin(setpoint.heading_rad) + where.wind_east_mps
    return math.atan2(east_mps, north_mps)

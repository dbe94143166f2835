"""PX4 fixed wings and multirotors: how each is commanded, and the parameters on which a flight depends.

A fixed wing is commanded in AUTO.LOITER ("Hold") by a stream of MAV_CMD_DO_REPOSITION. Outside the loiter circle around
the commanded position it flies straight there, so a position far ahead commands a course. In OFFBOARD it takes no
airspeed.

A multirotor is commanded in OFFBOARD by a stream of SET_POSITION_TARGET_LOCAL_NED with velocity and yaw, which must
start before the mode is set and never pause for longer than COM_OF_LOSS_T.

Sources: PX4 user guide, "Flight Modes" ("Hold" and "Takeoff" of fixed wings, "Offboard", "Return"), "Parameter
Reference" and "Safety Configuration (Failsafes)"; what it accepts and refuses was observed in its simulator (SIH).
"""

from __future__ import annotations

import math
import struct
from abc import ABC
from collections.abc import Mapping
from typing import ClassVar

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.command import CommandInt, ParamValue
from airlink.messages.system import Heartbeat
from flight_model.autopilot_model import FlightState, Setpoint
from flight_model.earth import GeodeticOrigin
from flight_model.slot import Triple
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.estimation.airspeed import AirspeedScale
from gcs_formation.vehicle.autopilot_family import Autopilot, Command, Craft, StartUpStep
from gcs_formation.vehicle.checks import Check, envelope_checks, lowest_m
from gcs_formation.vehicle.mode_names import AUTO, PX4, px4_mode
from gcs_formation.vehicle.own_failsafe import OwnFailsafe, Parameters
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.velocity_setpoint import (
    MULTIROTOR_TYPES,
    TURNS_FROM_MPS,
    SpeedLead,
    VelocityLead,
    speed_lead,
    stands,
    velocity_lead,
    velocity_setpoint,
)

LEADS_AWAY = (1, 2, 3)
"""NAV_DLL_ACT: hold, return, land; 0 does nothing, 5 and 6 stop the motor."""
CHANGES_HZ = 50.0
"""Rate of CURRENT_MODE, sent on changes: a pilot's mode must be seen before the next setpoint overrides it."""
OFF_THE_GROUND = (m.MAV_LANDED_STATE_IN_AIR, m.MAV_LANDED_STATE_TAKEOFF, m.MAV_LANDED_STATE_LANDING)
"""Below 10 m PX4 reports for seconds that it takes off or lands."""
UNCHANGED = math.nan
LARGEST_CIRCLE_M = 100.0
"""Loiter radius for which circles at the end are separated, and up to which a position 400 m ahead is a course, m."""
AIM_M = 400.0
"""Distance to the position ahead that commands a course, m. Within the loiter radius (NAV_LOITER_RAD, 80 m) plus 7 s of
flight (NPFG_PERIOD 10 s, damping 0.7) PX4 would turn onto the circle. It circles there when setpoints stop."""
REFERENCE_CLIMB_MPS = 3.0
"""After boot the height controller's reference starts at sea level and rises at this rate (FW_T_CLMB_R_SP). A vehicle
that takes off before it reaches the field's altitude dives into the ground. Observed in version 1.17 (development)."""
DEFAULT_SPEED = -1.0
PATIENCE_S = 0.5
"""Least COM_OF_LOSS_T: a shorter timeout would trigger on a few lost setpoints."""
LINK_LOSS_S, STREAM_LOSS_S = 10.0, 1.0
"""Defaults of COM_DL_LOSS_T and COM_OF_LOSS_T."""
CUTS_MOTORS = (6, 7)
"""COM_OBL_RC_ACT: terminate, disarm."""
WITHOUT_STICKS = (0, 3, 4, 5)
"""COM_OBL_RC_ACT: position (return, without a transmitter), return, land, hold."""
STAND = Setpoint(0.0, 0.0, 0.0)
ANYWHERE = FlightState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


TAKEOFF, LOITER, RTL = px4_mode(AUTO, 2), px4_mode(AUTO, 3), px4_mode(AUTO, 5)
OFFBOARD = px4_mode(6)
LAND = px4_mode(AUTO, 6)
LEADS_TO = {1: frozenset({LOITER}), 2: frozenset({LOITER, RTL}), 3: frozenset({LOITER, LAND})}
"""NAV_DLL_ACT: the modes to which it leads, by a hold."""
STREAM_LEADS_TO = {4: frozenset({LOITER, LAND}), 5: frozenset({LOITER})}
"""COM_OBL_RC_ACT: the same; without a transmitter others are a hold and RTL."""
UNARMABLE = frozenset(PX4) - {TAKEOFF, LOITER}
"""Modes in which a PX4 may not be armable: those of a pilot need a transmitter, OFFBOARD setpoints, others a mission;
return and landing end a flight."""


def heartbeats_lost(otherwise: str) -> Check:
    """Return the check of the action on lost heartbeats; `otherwise`: what the vehicle does if none is set."""
    return Check(
        ("NAV_DLL_ACT",),
        f"1 (hold), 2 (return) or 3 (land) when our heartbeats stop; with 0 it {otherwise}",
        lambda value: value in LEADS_AWAY,
    )


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4(Autopilot, ABC):
    """What PX4's vehicles have in common."""

    loop_s = 0.0
    """It answers TIMESYNC and commands on arrival."""
    take_off_mode = TAKEOFF
    taken_off_mode = LOITER
    loiter_mode = LOITER
    home_mode = RTL
    slow_messages = (*Autopilot.slow_messages, m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    mounting_parameter = "SENS_BOARD_ROT"
    failsafe_words = ("failsafe", "lost")
    """As in "Offboard control signal lost" and "GCS connection lost"."""
    types: ClassVar[frozenset[int]]
    """MAV_TYPEs of the vehicles flown by these commands."""
    take_off_to_m: ClassVar[float]
    """Commanded take-off height above home, m."""
    mode_names: ClassVar = PX4
    failsafe_parameters: ClassVar[tuple[str, ...]] = ("NAV_DLL_ACT", "COM_DL_LOSS_T")
    unarmable_modes = UNARMABLE

    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is from a PX4 of one of these `types`."""
        return heartbeat.autopilot == m.MAV_AUTOPILOT_PX4 and heartbeat.type in self.types

    def own_failsafe(self, values: Parameters) -> OwnFailsafe | None:
        """Return its failsafe for lost heartbeats, None if it is off."""
        modes = LEADS_TO.get(int(values.get("NAV_DLL_ACT", 0)))
        return None if modes is None else OwnFailsafe(values.get("COM_DL_LOSS_T", LINK_LOSS_S), modes)

    def parameter(self, reported: ParamValue) -> float:
        """Return a parameter's value: PX4 sends an integer's bytes in the float field."""
        if reported.param_type != m.MAV_PARAM_TYPE_INT32:
            return reported.param_value
        return float(struct.unpack("<i", struct.pack("<f", reported.param_value))[0])

    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[StartUpStep, ...]:
        """Return the steps: streams, ready, take-off, which ends in HOLD, guided mode; those done are skipped."""
        guided, named = self.guided_mode, self.mode_names[self.guided_mode]
        return (
            *self._asked_and_ready(rates_hz),
            *self._waits(),
            StartUpStep("told it to take off", self._is_taking_off, self._to_take_off, takes_off=True),
            self._armable_step(),
            self._armed_step(),
            StartUpStep("waited for it to climb", self._has_climbed, timeout_s=120.0),
            StartUpStep(f"set mode {named}", self.takes_setpoints, lambda _: (self.set_mode(guided),)),
        )

    def _waits(self) -> tuple[StartUpStep, ...]:
        """Return the family's further waits before take-off."""
        return ()

    def says_airborne(self, telemetry: Telemetry) -> bool:
        """Return whether it reports IN_AIR, TAKEOFF or LANDING."""
        return telemetry.landed_state in OFF_THE_GROUND

    def says_grounded(self, telemetry: Telemetry) -> bool:
        """Return whether it reports ON_GROUND."""
        return telemetry.landed_state == m.MAV_LANDED_STATE_ON_GROUND

    def mode_asked(self, command: Command) -> int | None:
        """Return the main and sub mode that a command sets, as one number."""
        if command.command != m.MAV_CMD_DO_SET_MODE:
            return None
        return px4_mode(int(command.param2), int(command.param3))

    def set_mode(self, mode: int) -> Command:
        """Return MAV_CMD_DO_SET_MODE, with main mode and sub mode in separate fields."""
        own = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        return self._command(m.MAV_CMD_DO_SET_MODE, own, mode >> 16 & 0xFF, mode >> 24)

    def requests(self, rates_hz: Mapping[int, float]) -> tuple[Command, ...]:
        """Return also one for CURRENT_MODE: heartbeats, once a second, show modes too late."""
        changes = self.set_message_interval(m.MAVLINK_MSG_ID_CURRENT_MODE, CHANGES_HZ)
        return (*super().requests(rates_hz), changes)

    def _to_take_off(self, seen: Telemetry) -> tuple[Command, ...]:
        """Return NAV_TAKEOFF at its position; the altitude is above sea level."""
        place = (UNCHANGED, UNCHANGED, UNCHANGED, self._home_above_sea_m(seen) + self.take_off_to_m)
        return (self._command(m.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, *place),)

    def _home_above_sea_m(self, seen: Telemetry) -> float:
        motion = seen.motion
        return math.nan if motion is None else motion.height_m - motion.above_home_m + self.origin.alt_m

    def _lacks_to_arm(self, seen: Telemetry) -> str:
        status = m.MAV_STATE_STANDBY if seen.heartbeat is None else seen.heartbeat.system_status
        said = "" if status == m.MAV_STATE_STANDBY else f"its heartbeats say {m.name_of('MAV_STATE', status)}"
        return "; ".join(filter(None, (said, super()._lacks_to_arm(seen))))

    def _has_climbed(self, seen: Telemetry) -> bool:
        return self.is_airborne(seen) and seen.custom_mode != TAKEOFF


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
    flies_courses = True

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
            self._lead.forget()

    def checks(self, model: VehicleModel, path: PathPlan) -> tuple[Check, ...]:
        """Return the checks of failsafe and limits."""
        ways = "raised to it", "lowered to it"
        return (
            heartbeats_lost("circles where the last setpoint led"),
            *envelope_checks(
                model,
                path,
                self.airspeed_to_tell(path.begin_mps),
                "FW_AIRSPD_MIN",
                "FW_AIRSPD_MAX",
                "FW_AIRSPD_TRIM",
                "FW_R_LIM",
                ways,
            ),
            Check(
                ("NAV_LOITER_RAD",),
                f"up to {LARGEST_CIRCLE_M:g} m; wider circles may meet, and bend the course",
                lambda value: abs(value) <= LARGEST_CIRCLE_M,
            ),
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
        course_rad = _course_rad(setpoint, where)
        north_m = where.north_m + AIM_M * math.cos(course_rad)
        east_m = where.east_m + AIM_M * math.sin(course_rad)
        reading_mps, lead = self.airspeed_to_tell(setpoint.speed_mps), self._lead
        if lead is not None:
            reading_mps = lead.lead(reading_mps, self.airspeed_to_tell(where.airspeed_mps))
        return (self._reposition(north_m, east_m, setpoint.height_m, reading_mps),)

    def quantities(self, setpoint: Setpoint, where: FlightState) -> Triple:
        """Return the airspeed with its lead, the course over ground, and the height."""
        reading_mps, lead = self.airspeed_to_tell(setpoint.speed_mps), self._lead
        if lead is not None:
            reading_mps = lead.led(reading_mps, self.airspeed_to_tell(where.airspeed_mps))
        return reading_mps, _course_rad(setpoint, where), setpoint.height_m

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
        place = seen.motion
        if place is None:
            return self.hold()
        return (*self.hold(), self._reposition(place.north_m, place.east_m, height_m))

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


def _course_rad(setpoint: Setpoint, where: FlightState) -> float:
    """Return the course over ground of airspeed along a setpoint's heading, plus the wind."""
    north_mps = setpoint.speed_mps * math.cos(setpoint.heading_rad) + where.wind_north_mps
    east_mps = setpoint.speed_mps * math.sin(setpoint.heading_rad) + where.wind_east_mps
    return math.atan2(east_mps, north_mps)


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4Copter(Px4):
    """A PX4 multirotor or helicopter, commanded in OFFBOARD by velocity setpoints."""

    family = "PX4 multirotor"
    types = MULTIROTOR_TYPES
    take_off_m = 18.0
    take_off_to_m = 20.0
    guided_mode = OFFBOARD
    setpoint_commands = ()
    stands_after_s = 1.0
    """COM_OF_LOSS_T; then it stops, and returns or lands (COM_OBL_RC_ACT)."""
    returns_after_s = 6.0
    """COM_OF_LOSS_T plus COM_FAIL_ACT_T, during which some versions hold first."""
    stands = True
    failsafe_parameters = ("NAV_DLL_ACT", "COM_DL_LOSS_T", "COM_OBL_RC_ACT", "COM_OF_LOSS_T")
    acknowledges_early = True
    """DO_SET_MODE is acknowledged twice, the first time always with ACCEPTED."""

    def __init__(
        self, system: int, origin: GeodeticOrigin, turn_rate_max_rps: float, lead: VelocityLead | None = None
    ) -> None:
        """Address `system`; `lead` compensates the slow integrator of its model."""
        super().__init__(system, origin, turn_rate_max_rps)
        self._nose_rad, self._lead = math.nan, lead or VelocityLead()

    @classmethod
    def of(cls, craft: Craft) -> Autopilot:
        """Return the interface to a vehicle's autopilot."""
        return cls(craft.system, craft.origin, craft.model.turn_rate_max_rps, velocity_lead(craft.model, craft.tick_s))

    def forget_setpoints(self) -> None:
        """Restart the lead compensation."""
        self._lead.forget()

    def own_failsafe(self, values: Parameters) -> OwnFailsafe | None:
        """Return its failsafe for lost setpoints, which acts sooner than that for lost heartbeats, or both."""
        action, by_heartbeats = values.get("COM_OBL_RC_ACT"), super().own_failsafe(values)
        if action is None or action in CUTS_MOTORS:
            return by_heartbeats
        modes = STREAM_LEADS_TO.get(int(action), frozenset({LOITER, RTL}))
        more = frozenset[int]() if by_heartbeats is None else by_heartbeats.modes
        return OwnFailsafe(values.get("COM_OF_LOSS_T", STREAM_LOSS_S), modes | more)

    def stand_in(self) -> tuple[Message, ...]:
        """Return a setpoint of zero velocity."""
        return (velocity_setpoint(self.system, STAND, ANYWHERE, self._lead, self._nose_rad),)

    def checks(self, model: VehicleModel, path: PathPlan) -> tuple[Check, ...]:
        """Return the checks of failsafes and limits."""
        fastest, speed = model.speed_max_mps, path.begin_mps
        return (
            heartbeats_lost("flies on as long as setpoints come"),
            Check(
                ("COM_OF_LOSS_T",),
                f"{PATIENCE_S:g} s or more; setpoints come with every tick, and some are lost",
                lambda value: value >= PATIENCE_S,
            ),
            Check(
                ("COM_OBL_RC_ACT",),
                "0 or 3 (return), 4 (land) or 5 (hold) when setpoints stop; 1 and 2 need a pilot, "
                "6 and 7 stop the motors",
                lambda value: value in WITHOUT_STICKS,
                lambda value: value in CUTS_MOTORS,
            ),
            Check(
                ("MPC_XY_VEL_MAX",),
                f"{fastest:g} m/s or more, its model's speed_max_mps; it flies no faster",
                lambda value: value >= fastest,
                lambda value: value < speed,
                bounds=lambda value: ("speed_max_mps", value),
            ),
            Check(
                ("RTL_RETURN_ALT",),
                "at most the lowest height of the path: lower than that, nobody climbs into others on the way home",
                lambda value: value <= lowest_m(path),
            ),
        )

    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Message, ...]:
        """Return one message: velocity over ground, and the course as yaw while it moves.

        In hover the last yaw is repeated: with a yaw rate of 0 alone the heading drifts by tens of degrees. Setpoints
        are sent at every tick: COM_OF_LOSS_T after the last one the failsafe leaves OFFBOARD, until they resume.
        """
        if setpoint.speed_mps >= TURNS_FROM_MPS or stands(setpoint):
            self._nose_rad = setpoint.heading_rad
        return (velocity_setpoint(self.system, setpoint, where, self._lead, self._nose_rad),)

# Compiled by mypyc: it runs every tick.

"""An emulated ArduPlane: its commands, and how it differs from other families.

Source: ArduPilot documentation, "Plane: GUIDED mode" and "Plane parameters"; answers of ArduPlane 4.7. The climb rate
of MAV_CMD_GUIDED_CHANGE_ALTITUDE is ignored, because ArduPlane follows it far too slowly.
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.messages.command import SetPositionTargetGlobalInt
from airlink.messages.mission import MissionItemReached
from airlink.messages.payload import DEG
from flight_model.autopilot_model import finite
from sim_vehicles.airframe.body import Body
from sim_vehicles.airframe.environment import Environment
from sim_vehicles.autopilot import commands
from sim_vehicles.autopilot.autopilot import INFO, WARNING, GivenCommand, Setpoint
from sim_vehicles.autopilot.commands import (
    ACCEPTED,
    DENIED,
    FAILED,
    FULL_TURN_DEG,
    CommandHandlers,
    height_of,
    to_mode,
)
from sim_vehicles.autopilot.mission_flight import ON_CIRCLE, MissionFlight
from sim_vehicles.autopilot.modes_and_failsafe import (
    LONG_FAILSAFE,
    PLANE_NOT_ARMABLE,
    STRAIGHT_ON,
    FlightMode,
    GroundStationFailsafe,
    Mode,
    long_action,
    select,
)
from sim_vehicles.autopilot.parameters import (
    ParameterServer,
)
from sim_vehicles.autopilot.pilot import PlanePilot
from sim_vehicles.autopilot.streams import UNASKED
from sim_vehicles.board_clock import delayed
from sim_vehicles.config import FleetConfig
from sim_vehicles.families.arduplane.plane_parameters import plane_parameters
from sim_vehicles.vehicle import Vehicle

MIN_LATERAL_MPS2: Final = 0.05
"""Replacement of a lateral acceleration of 0, with which ArduPlane hardly turns."""
AIRSPEED: Final = m.SPEED_TYPE_AIRSPEED
AGAIN: Final = m.HEADING_TYPE_DEFAULT
COURSE: Final = m.HEADING_TYPE_COURSE_OVER_GROUND
HEADING: Final = m.HEADING_TYPE_HEADING
GUIDED: Final = Mode.GUIDED
SPEED_MODES: Final = (Mode.GUIDED, Mode.AUTO)
USUAL_SPEED: Final = -2.0
MAX_PERCENT: Final = 100.0


def _change_speed(vehicle: Plane, given: GivenCommand) -> int:
    kind, speed_mps, accel_mps2, _ = given.params
    if vehicle.flier.mode is not GUIDED:
        return FAILED
    if kind != AIRSPEED or not finite(speed_mps) or math.isnan(accel_mps2):
        return DENIED
    if not vehicle.parameters.is_airspeed(speed_mps):
        return FAILED
    vehicle.flier.guide_speed(speed_mps, abs(accel_mps2) or math.inf)
    return ACCEPTED


def _change_altitude(vehicle: Plane, given: GivenCommand) -> int:
    if vehicle.flier.mode is not GUIDED:
        return FAILED
    height_m = height_of(vehicle, given.z, given.frame)
    if height_m is None or given.z in (0.0, -1.0):
        return DENIED
    vehicle.flier.guide_height(height_m)
    return ACCEPTED


def _change_heading(vehicle: Plane, given: GivenCommand) -> int:
    kind, degrees, lateral_mps2, _ = given.params
    if vehicle.flier.mode is not GUIDED:
        return FAILED
    if not 0.0 <= degrees < FULL_TURN_DEG or math.isnan(lateral_mps2):
        return DENIED
    if kind == AGAIN:
        vehicle.flier.circle_again()
        return ACCEPTED
    course = kind == COURSE
    if not course and kind != HEADING:
        return DENIED
    vehicle.flier.steer(degrees * DEG, course=course, lateral_mps2=max(lateral_mps2, MIN_LATERAL_MPS2))
    return ACCEPTED


def _legacy_speed(vehicle: Plane, given: GivenCommand) -> int:
    """Change the airspeed setpoint; a ground speed only raises it, to the airspeed needed in still air.

    A throttle setting is accepted without effect.
    """
    kind, speed_mps, throttle, _ = given.params
    if vehicle.flier.mode not in SPEED_MODES:
        return FAILED
    if not math.isfinite(speed_mps):
        return DENIED
    if kind == m.SPEED_TYPE_GROUNDSPEED:
        speed_mps = max(vehicle.body.steering.speed_mps, min(speed_mps, vehicle.parameters["AIRSPEED_MAX"]))
    elif kind == AIRSPEED and speed_mps == USUAL_SPEED:
        speed_mps = vehicle.parameters["AIRSPEED_CRUISE"]
    elif kind != AIRSPEED or not vehicle.parameters.is_airspeed(speed_mps):
        return ACCEPTED if 0.0 < throttle <= MAX_PERCENT else FAILED
    if not vehicle.flier.guided_by_setpoints:
        vehicle.flier.change_speed(speed_mps, math.inf)
    return ACCEPTED


def _legacy_altitude(vehicle: Plane, given: GivenCommand) -> int:
    height_m = height_of(vehicle, given.params[0], given.params[1])
    if height_m is None:
        return DENIED
    vehicle.climb_to(height_m)
    return ACCEPTED


def _start_mission(vehicle: Plane, given: GivenCommand) -> int:
    """Start or resume the mission; first and last item aren't supported."""
    return DENIED if any(given.params[:2]) else ACCEPTED if vehicle.switch(Mode.AUTO) else FAILED


def _land_by_mission(vehicle: Plane, _given: GivenCommand) -> int:
    """Fly the mission from its DO_LAND_START on, in AUTO (`handle_command_int_packet`); FAILED if there is none."""
    if not (vehicle.pilot.airborne and vehicle.missions.choose_landing()):
        return FAILED
    vehicle.begin_landing()
    return ACCEPTED


NO_EFFECT = (
    m.MAV_CMD_DO_SET_RELAY,
    m.MAV_CMD_DO_SET_SERVO,
    m.MAV_CMD_DO_REPEAT_SERVO,
    m.MAV_CMD_DO_SET_ROI_LOCATION,
    m.MAV_CMD_DO_SET_ROI_NONE,
    m.MAV_CMD_DO_SET_ROI,
    m.MAV_CMD_DO_DIGICAM_CONTROL,
)
"""Payload commands, which are accepted; there is no payload."""
HANDLERS: Final[CommandHandlers[Plane]] = {
    **commands.HANDLERS,
    **dict.fromkeys(NO_EFFECT, lambda _vehicle, _given: ACCEPTED),
    m.MAV_CMD_DO_FENCE_ENABLE: lambda _vehicle, _given: FAILED,
    m.MAV_CMD_DO_GO_AROUND: lambda _vehicle, _given: FAILED,
    m.MAV_CMD_GUIDED_CHANGE_SPEED: _change_speed,
    m.MAV_CMD_GUIDED_CHANGE_ALTITUDE: _change_altitude,
    m.MAV_CMD_GUIDED_CHANGE_HEADING: _change_heading,
    m.MAV_CMD_NAV_TAKEOFF: lambda _vehicle, _given: FAILED,
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: to_mode(Mode.RTL),
    m.MAV_CMD_NAV_LOITER_UNLIM: to_mode(Mode.LOITER),
    m.MAV_CMD_MISSION_START: _start_mission,
    m.MAV_CMD_DO_LAND_START: _land_by_mission,
    m.MAV_CMD_DO_CHANGE_SPEED: _legacy_speed,
    m.MAV_CMD_DO_CHANGE_ALTITUDE: _legacy_altitude,
}


@mypyc_attr(allow_interpreted_subclasses=True)
class Plane(Vehicle):
    """An emulated ArduPlane."""

    emulates = "arduplane"
    mav_type = m.MAV_TYPE_FIXED_WING
    capabilities = 62319
    unasked = UNASKED
    boot_mode = Mode.INITIALISING
    ground_mode = Mode.MANUAL
    air_mode = Mode.GUIDED
    guided_mode = Mode.GUIDED
    by_hand = STRAIGHT_ON | {Mode.INITIALISING}
    reports_unarmable = True
    handlers = HANDLERS
    flier: PlanePilot
    """Its pilot, typed as such."""

    def __init__(self, index: int, fleet: FleetConfig, body: Body, environment: Environment, now: Instant) -> None:
        """Boot at `now`."""
        self._arrives = False
        """Whether it is on its way to a position that it was commanded in GUIDED."""
        self._pending: FlightMode | None = None
        """The failsafe's mode, while a take-off's climb goes on."""
        super().__init__(index, fleet, body, environment, now)
        self._mission_flight = MissionFlight(self.missions, self.flier, self.parameters, self.origin)

    def make_parameters(self) -> ParameterServer:
        """Return ArduPlane's parameters."""
        return plane_parameters(self.config, self.fleet.cruise_mps, self.fleet.station_system)

    def make_pilot(self) -> PlanePilot:
        """Return who flies a fixed wing."""
        self.flier = PlanePilot(self.config, self.body.steering, self.parameters)
        return self.flier

    def make_failsafe(self) -> GroundStationFailsafe:
        """Return its long failsafe, whose time runs from boot."""
        return GroundStationFailsafe(self.parameters, LONG_FAILSAFE, self._up)

    @property
    def armable(self) -> bool:
        """Whether it is ready, and armed already or in a mode that can be armed in."""
        return self.ready and (self.pilot.condition.armed or self.pilot.mode not in PLANE_NOT_ARMABLE)

    @property
    def unarmable(self) -> str:
        """Why it can't be armed: its mode, or its estimator."""
        return f"{self.pilot.mode.name} mode not armable" if self.ready else super().unarmable

    def lose_station(self) -> None:
        """Begin the long failsafe: on the ground too, but in the climb of a take-off only after that, unless it glides.

        Source: ArduPlane, `failsafe_long_on_event`.
        """
        self.failsafe.trigger()
        mode, climbs = long_action(self.pilot.mode, self.failsafe.action), self.flier.climbing_out
        self._pending = mode if climbs and mode is not Mode.FBWA else None
        if mode is not None and self._pending is None:
            self.enter(mode)
        self.say(WARNING, f"GCS Failsafe On: {self.pilot.mode.name}")

    @property
    def flies_mission(self) -> bool:
        """Whether it flies by its stored mission."""
        return self.pilot.mode is Mode.AUTO and self.pilot.condition.armed

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already, and report it at once. Without a mission AUTO becomes RTL."""
        if mode is Mode.AUTO and not self.missions.flyable:
            mode = Mode.RTL
        if mode is not self.pilot.mode:
            self._pending = None
            if self.pilot.mode is Mode.AUTO:
                self._mission_flight.pause()
            self.pilot.enter(mode, self.body.motion)
            self._arrives = False
            self.missions.in_mode = mode is Mode.AUTO
            self._begin_mission()
            self.tell_heartbeat()

    def begin_landing(self) -> None:
        """Fly the mission from the item that was chosen, in AUTO."""
        if self.pilot.mode is Mode.AUTO:
            self._begin_mission()
        else:
            self.enter(Mode.AUTO)

    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether that was allowed. AUTOLAND needs the take-off's direction."""
        mode = select(self.pilot.condition, number)
        if number not in frozenset(Mode):
            self.say(WARNING, f"No such mode {number:g}")
        if mode == Mode.AUTOLAND and (not self.pilot.airborne or self.flier.landing_rad is None):
            flies = self.pilot.airborne
            self.say(WARNING, "Takeoff initial direction not set" if flies else "Must already be flying!")
            return False
        if mode is not None:
            self.enter(Mode(mode))
        return mode is not None

    def arm(self, *, force: bool) -> bool:
        """Arm, and start the mission if that is its mode."""
        armed = super().arm(force=force)
        if armed:
            self._begin_mission()
        return armed

    def go_to(self, lat_rad: float, lon_rad: float, height_m: float) -> None:
        """Circle a position; a height that a setpoint has set is kept."""
        north_m, east_m, _ = self.origin.to_ned(lat_rad, lon_rad, self.origin.alt_m)
        if self.flier.guided_by_setpoints:
            height_m = self.body.steering.height_m
        self.flier.circle_guided(north_m, east_m, height_m)
        self._arrives = True

    def ask_circle(self, radius_m: float, side: float) -> None:
        """Take the radius and the side of the circles that it is commanded next in GUIDED."""
        self.flier.ask_circle(radius_m, side)

    def climb_to(self, height_m: float) -> None:
        """Climb or descend to a height, unless setpoints have given one."""
        if not self.flier.guided_by_setpoints:
            self.flier.change_height(height_m)

    def take_setpoint(self, setpoint: Setpoint) -> None:
        """Fly to the height of a setpoint in GUIDED; an ArduPlane takes nothing else of one.

        Source: ArduPlane, `handle_set_position_target_local_ned` and `..._global_int`.
        """
        if self.pilot.mode is Mode.GUIDED:
            height_m = self._commanded_height_m(setpoint)
            if height_m is not None:
                self.climb_to(height_m)

    def _commanded_height_m(self, setpoint: Setpoint) -> float | None:
        """Return the height above the origin that a setpoint tells, or None."""
        if isinstance(setpoint, SetPositionTargetGlobalInt):
            if setpoint.coordinate_frame not in commands.ABOVE_SEA_LEVEL + commands.ABOVE_HOME:
                self.say(WARNING, "Invalid coord frame in SET_POSTION_TARGET_GLOBAL_INT")
            ignored = setpoint.type_mask & m.POSITION_TARGET_TYPEMASK_Z_IGNORE
            return None if ignored else height_of(self, setpoint.alt_m, setpoint.coordinate_frame)
        if setpoint.coordinate_frame != m.MAV_FRAME_LOCAL_OFFSET_NED or not abs(setpoint.z_m) <= commands.HIGHEST_M:
            return None
        height_m = self.body.steering.height_m - setpoint.z_m
        self.say(INFO, f"Change alt to {height_m:.1f}")
        return height_m

    def mode_named(self, name: str) -> FlightMode:
        """Return a mode by its name."""
        return Mode[name]

    def landed(self) -> None:
        """Disarm a while after it has touched down."""
        self.disarm_at = delayed(self.now, self.parameters["LAND_DISARMDELAY"])

    def _begin_mission(self) -> None:
        if self.flies_mission:
            self._mission_flight.resume()

    def follow_time(self) -> None:
        """Continue a mission, report the arrival at a position, and end a take-off during which the failsafe began."""
        if self._pending is not None and not self.flier.climbing_out:
            pending, self._pending = self._pending, None
            if self.failsafe.active:
                self.enter(pending)
        if self._arrives and self.flier.to_go(self.body.motion)[1] < ON_CIRCLE * self.flier.radius_m:
            self._arrives = False
            self.broadcast(MissionItemReached(0))
        if self.flies_mission:
            for seq in self._mission_flight.turn(self.body.motion, self.now):
                self.broadcast(MissionItemReached(seq))
            if self._mission_flight.ended:
                self.enter(Mode.RTL)

# Compiled by mypyc: it runs every tick.

"""An emulated ArduCopter: its commands, and how it differs from other families.

Unlike a real one it has no transmitter, its RTL flies at one speed, its SMART_RTL straight home at the
height that it has, and in modes that leave thrust to the throttle it sinks instead of falling.

Source: ArduPilot documentation, "Copter Commands in Guided Mode"; answers of ArduCopter 4.7, and what it flew by them.
"""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.clock import NEVER, after
from airlink.messages.payload import DEG
from flight_model.autopilot_model import finite, wrap
from sim_vehicles.airframe.motion import Vector
from sim_vehicles.autopilot import commands
from sim_vehicles.autopilot.autopilot import CRITICAL, WARNING, GivenCommand, Setpoint
from sim_vehicles.autopilot.commands import (
    ACCEPTED,
    DENIED,
    FAILED,
    FULL_TURN_DEG,
    YAW_IGNORED,
    YAW_RATE_IGNORED,
    CommandHandlers,
    position_of,
    to_mode,
    velocity_of,
    yaw_rate_of,
)
from sim_vehicles.autopilot.copter_pilot import CM_PER_M, CopterPilot
from sim_vehicles.autopilot.modes_and_failsafe import (
    BY_THROTTLE,
    COPTER_FAILSAFE,
    CopterMode,
    FlightMode,
    GroundStationFailsafe,
    select,
)
from sim_vehicles.autopilot.parameters import (
    SYSTEM_NAMES,
    ParameterKind,
    ParameterServer,
    as_in_file,
    fence_parameters,
    floating,
)
from sim_vehicles.autopilot.streams import UNASKED_NS
from sim_vehicles.board_clock import delayed
from sim_vehicles.config import FleetConfig, VehicleConfig
from sim_vehicles.vehicle import Vehicle

TURNS_FROM_M = 2.0
"""Its nose turns to a position that is farther than this (WP_YAW_BEHAVIOR)."""
TURNS_FROM_MPS = 0.5
"""Its nose turns into the direction of a velocity from this speed on (5 % of WPNAV_SPEED)."""
DISARMS_S = 2.0
"""Time from touch-down until it detects that it has landed, and disarms."""
CIRCLE_M, CIRCLE_RPS = 10.0, math.radians(20.0)
"""CIRCLE_RADIUS, and CIRCLE_RATE, clockwise."""
ALL_MODES = frozenset(CopterMode)
BY_HAND = frozenset(
    {
        CopterMode.STABILIZE,
        CopterMode.ACRO,
        CopterMode.ALT_HOLD,
        CopterMode.DRIFT,
        CopterMode.GUIDED_NOGPS,
    }
)
HEARTBEAT_ALONE = {m.MAVLINK_MSG_ID_HEARTBEAT: UNASKED_NS}
SLEW_RPS: Final = math.radians(60.0)
"""Yaw rate where none is commanded, and the highest (ATC_SLEW_YAW)."""
SPEEDS: Final = {
    m.SPEED_TYPE_AIRSPEED: "WPNAV_SPEED",
    m.SPEED_TYPE_GROUNDSPEED: "WPNAV_SPEED",
    m.SPEED_TYPE_CLIMB_SPEED: "WPNAV_SPEED_UP",
    m.SPEED_TYPE_DESCENT_SPEED: "WPNAV_SPEED_DN",
}
"""SPEED_TYPE -> the parameter whose value DO_CHANGE_SPEED replaces."""


def _take_off(vehicle: Copter, given: GivenCommand) -> int:
    """Take off to a height above home, which no other frame gives."""
    if given.frame != m.MAV_FRAME_GLOBAL_RELATIVE_ALT:
        return DENIED
    return ACCEPTED if vehicle.take_off(given.z) else FAILED


def _turn_nose(vehicle: Copter, given: GivenCommand) -> int:
    """Turn the nose to a direction or by an angle; in other modes than GUIDED that is accepted and has no effect."""
    degrees, rate_dps, direction, relative = given.params
    if (
        not 0.0 <= degrees <= FULL_TURN_DEG
        or relative not in (0.0, 1.0)
        or not (finite(rate_dps) and finite(direction))
    ):
        return FAILED
    angle_rad, nose_rad = degrees * DEG, vehicle.nose_rad
    by_rad = angle_rad if direction > -1.0 else -angle_rad
    if not relative:
        by_rad = wrap(angle_rad - nose_rad)
        if abs(direction) >= 1.0 and by_rad * direction < 0.0:
            by_rad += math.copysign(math.tau, direction)
    if vehicle.guided:
        vehicle.flier.turn(nose_rad, by_rad, min(rate_dps * DEG, SLEW_RPS) if rate_dps > 0.0 else SLEW_RPS)
    return ACCEPTED


def _look(vehicle: Copter, given: GivenCommand) -> int:
    """Point the nose at a position from now on; in other modes than GUIDED that is accepted and has no effect."""
    if vehicle.guided:
        north_m, east_m, _ = vehicle.origin.to_ned(given.lat_rad, given.lon_rad, 0.0)
        vehicle.flier.look_at((north_m, east_m))
    return ACCEPTED


def _look_ahead(vehicle: Copter, _given: GivenCommand) -> int:
    vehicle.flier.look_at(None)
    return ACCEPTED


def _change_speed(vehicle: Copter, given: GivenCommand) -> int:
    """Change the speed of flights to positions; it holds until a velocity or another mode is commanded."""
    kind, speed_mps = given.params[0], given.params[1]
    if not 0.0 < speed_mps < math.inf:
        return DENIED
    if kind not in SPEEDS or vehicle.pilot.mode not in (CopterMode.GUIDED, CopterMode.RTL, CopterMode.SMART_RTL):
        return FAILED
    vehicle.flier.commanded_cmps[SPEEDS[int(kind)]] = CM_PER_M * speed_mps
    return ACCEPTED


def _pause(vehicle: Copter, given: GivenCommand) -> int:
    """Hover until it is commanded to go on."""
    goes_on = given.params[0]
    if goes_on not in (0.0, 1.0):
        return DENIED
    if not vehicle.guided:
        vehicle.say(m.MAV_SEVERITY_INFO, "Failed to resume" if goes_on else "Failed to pause")
        return FAILED
    vehicle.flier.paused = not goes_on
    if vehicle.flier.paused:
        vehicle.flier.hover()
    return ACCEPTED


def _choose_item(vehicle: Copter, given: GivenCommand) -> int:
    if given.params[0] == 0.0 and not vehicle.missions.flyable:
        return FAILED
    return commands.choose_item(vehicle, given)


HANDLERS: Final[CommandHandlers[Copter]] = {
    **commands.HANDLERS,
    m.MAV_CMD_NAV_TAKEOFF: _take_off,
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: to_mode(CopterMode.RTL),
    m.MAV_CMD_NAV_LAND: to_mode(CopterMode.LAND),
    m.MAV_CMD_NAV_LOITER_UNLIM: to_mode(CopterMode.LOITER),
    m.MAV_CMD_MISSION_START: to_mode(CopterMode.AUTO),
    m.MAV_CMD_CONDITION_YAW: _turn_nose,
    m.MAV_CMD_DO_SET_ROI_LOCATION: _look,
    m.MAV_CMD_DO_SET_ROI_NONE: _look_ahead,
    m.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    m.MAV_CMD_DO_PAUSE_CONTINUE: _pause,
    m.MAV_CMD_DO_SET_MISSION_CURRENT: _choose_item,
}
"""All others are UNSUPPORTED; so are MAV_CMD_GUIDED_CHANGE_SPEED, _HEADING and _ALTITUDE in a real ArduCopter."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Copter(Vehicle):
    """An emulated ArduCopter; missions aren't emulated."""

    emulates = "arducopter"
    mav_type = m.MAV_TYPE_QUADROTOR
    capabilities = 64495
    unasked = HEARTBEAT_ALONE
    tells_time_at_once = True
    boot_mode = CopterMode.STABILIZE
    ground_mode = CopterMode.STABILIZE
    air_mode = CopterMode.GUIDED
    guided_mode = CopterMode.GUIDED
    by_hand = BY_HAND
    handlers = HANDLERS
    armed_text = "Arming motors"
    disarmed_text = "Disarming motors"
    failsafe_off_text = "GCS Failsafe Cleared"
    reports_unarmable = True
    flier: CopterPilot
    """Its pilot, typed as a CopterPilot."""

    def make_parameters(self) -> ParameterServer:
        """Return ArduCopter's parameters."""
        kinds = copter_parameters(self.config, self.fleet)
        return ParameterServer(as_in_file(kinds, self.config.parameters, SYSTEM_NAMES))

    def make_pilot(self) -> CopterPilot:
        """Return who flies a multirotor."""
        self.flier = CopterPilot(self.config, self.body.steering, self.parameters)
        return self.flier

    def make_failsafe(self) -> GroundStationFailsafe:
        """Return its failsafe for the end of the ground station's heartbeats."""
        return GroundStationFailsafe(self.parameters, COPTER_FAILSAFE)

    @property
    def armable(self) -> bool:
        """Whether it is ready, and the ground station is received."""
        return self.ready and not (self.failsafe.active and not self.pilot.condition.armed)

    @property
    def unarmable(self) -> str:
        """Why it can't be armed: its failsafe, or its estimator."""
        return "GCS failsafe on" if self.ready else super().unarmable

    def lose_station(self) -> None:
        """Begin the failsafe: in the air change the mode, armed on the ground disarm, disarmed only say so.

        Source: ArduCopter, `failsafe_gcs_on_event`.
        """
        mode, armed = self.failsafe.trigger(), self.pilot.condition.armed
        grounded = armed and not self.pilot.airborne
        self.say(WARNING, "GCS Failsafe - Disarming" if grounded else "GCS Failsafe")
        if grounded:
            self.disarm(force=False)
        elif armed and mode is not None:
            self.enter(mode)

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already, and report it at once; CIRCLE's centre is ahead of the nose."""
        if mode is not self.pilot.mode:
            self.pilot.enter(mode, self.body.motion)
            if mode is CopterMode.CIRCLE:
                nose_rad, here = self.nose_rad, self.body.motion
                north_m, east_m = CIRCLE_M * math.cos(nose_rad), CIRCLE_M * math.sin(nose_rad)
                self.flier.go_round(
                    (here.north_m + north_m, here.east_m + east_m, math.nan, CIRCLE_M, CIRCLE_M * CIRCLE_RPS)
                )
            self.tell_heartbeat()

    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether there is such a mode and it can be entered."""
        mode = select(self.pilot.condition, number, ALL_MODES)
        if mode == CopterMode.AUTO:
            self.say(WARNING, "Mode change to AUTO failed: init failed")
            return False
        if mode is None:
            self.say(WARNING, f"No such mode {number:g}")
            return False
        self.enter(CopterMode(mode))
        return True

    def arm(self, *, force: bool) -> bool:
        """Arm, if the mode allows it; without a take-off it disarms by itself after DISARM_DELAY."""
        armed = super().arm(force=force)
        if not armed and self.armable:
            self.say(CRITICAL, f"Arm: {self.pilot.mode.name} mode not armable")
        if armed and not self.pilot.airborne:
            self.disarm_at = delayed(self.now, self.parameters["DISARM_DELAY"])
        return armed

    def take_off(self, height_m: float) -> bool:
        """Take off to a height above home; return whether it does."""
        rises = self.flier.rise(height_m)
        if rises:
            self.disarm_at = NEVER
            self.tell_heartbeat()
        return rises

    def mode_named(self, name: str) -> FlightMode:
        """Return a mode by its name; one that ArduCopter doesn't have becomes LOITER."""
        return CopterMode.__members__.get(name, CopterMode.LOITER)

    def landed(self) -> None:
        """Disarm once it has detected that it has landed."""
        found = after(self.now, DISARMS_S)
        idles = self.pilot.mode in BY_THROTTLE
        self.disarm_at = delayed(found, self.parameters["DISARM_DELAY"]) if idles else found

    @property
    def guided(self) -> bool:
        """Whether it is in GUIDED."""
        return self.pilot.mode is CopterMode.GUIDED

    @property
    def nose_rad(self) -> float:
        """Where its nose is commanded to point, or points."""
        return self.flier.commanded_nose(self.body.shown().heading_rad)

    def go_to(self, lat_rad: float, lon_rad: float, height_m: float) -> None:
        """Fly to a position and stay there."""
        north_m, east_m, _ = self.origin.to_ned(lat_rad, lon_rad, self.origin.alt_m)
        self._go_to((north_m, east_m, height_m), None)

    def follow_time(self) -> None:
        """Hover once the last velocity is too old."""
        if self.now >= self.pilot.silent_at:
            self.flier.stop()

    def _go_to(self, position_m: Vector, yaw_rad: float | None) -> None:
        """Fly to a position; the nose turns there first, unless it is commanded where to turn or that is near."""
        if self.flier.target_m is None:  # speeds hold from position to position
            self.flier.commanded_cmps.clear()
        here = self.body.motion
        north_m, east_m = position_m[0] - here.north_m, position_m[1] - here.east_m
        if yaw_rad is None and math.hypot(north_m, east_m) > TURNS_FROM_M:
            yaw_rad = math.atan2(east_m, north_m)
        self.flier.go_to(position_m, yaw_rad)

    def take_setpoint(self, setpoint: Setpoint) -> None:
        """Fly to a position, or a velocity, in GUIDED; whatever else is asked stops it, as does what isn't finite."""
        if self.pilot.mode is not CopterMode.GUIDED or self.pilot.takeoff_m:
            return
        mask, nose_rad = setpoint.type_mask, self.nose_rad
        position_m, velocity_mps = position_of(self, setpoint), velocity_of(self, setpoint)
        yaw_rad = None if mask & YAW_IGNORED or not math.isfinite(setpoint.yaw_rad) else setpoint.yaw_rad
        if position_m is not None:
            self._go_to(position_m, yaw_rad)
        elif velocity_mps is None:
            self.flier.stop()
        else:
            ahead = mask & YAW_IGNORED and mask & YAW_RATE_IGNORED
            if ahead and math.hypot(velocity_mps[0], velocity_mps[1]) > TURNS_FROM_MPS:
                yaw_rad = math.atan2(velocity_mps[1], velocity_mps[0])
            self.flier.obey(velocity_mps, yaw_rad, self.now)
        rate_rps = yaw_rate_of(setpoint)
        if rate_rps and (position_m is not None or velocity_mps is not None):
            self.flier.turn_on(nose_rad, rate_rps)


def copter_parameters(config: VehicleConfig, fleet: FleetConfig) -> dict[str, ParameterKind]:
    """Return a multirotor's parameters by their names, in ArduCopter's cm."""
    model = config.model
    return {
        "ARMING_CHECK": ParameterKind(m.MAV_PARAM_TYPE_INT32, 0, 2**24, 1),
        "DISARM_DELAY": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 127, 10),
        **fence_parameters(7),
        "FS_GCS_ENABLE": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 127, 0),
        "FS_GCS_TIMEOUT": floating(2, 1e6, 5),
        "GUID_TIMEOUT": floating(0.1, 1e6, 3),
        "LAND_SPEED": ParameterKind(m.MAV_PARAM_TYPE_INT16, 30, 200, 50),
        "MAV_GCS_SYSID": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 255, fleet.station_system),
        "MAV_SYSID": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 255, config.identity.system),
        "RTL_ALT": ParameterKind(m.MAV_PARAM_TYPE_INT32, 30, 300000, 1500),
        "RTL_LOIT_TIME": ParameterKind(m.MAV_PARAM_TYPE_INT32, 0, 60000, 5000),
        "WPNAV_ACCEL": floating(50, 500, math.ceil(100 * model.accel_max_mps2)),
        "WPNAV_SPEED": floating(10, 1e5, max(1000, math.ceil(100 * model.speed_max_mps))),
        "WPNAV_SPEED_DN": floating(10, 500, 150),
        "WPNAV_SPEED_UP": floating(10, 1000, 250),
    }

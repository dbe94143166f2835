"""An emulated ArduCopter: what it does in each mode, and what it answers otherwise than an ArduPlane.

Unlike a real one it has no transmitter and no battery, and its RTL flies at one speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.frame import Frame
from flight_model.autopilot_model import within
from sim_vehicles.airframe.motion import Motion, Steering
from sim_vehicles.autopilot import commands, position_targets
from sim_vehicles.autopilot.board_clock import NEVER
from sim_vehicles.autopilot.commands import ACCEPTED, DENIED, FAILED, GivenCommand, to_mode
from sim_vehicles.autopilot.failsafe import COPTER_FAILSAFE
from sim_vehicles.autopilot.modes import BY_THROTTLE, NOT_ARMABLE, Condition, CopterMode, FlightMode, Request, select
from sim_vehicles.autopilot.parameters import ParameterKind, ParameterServer, floating
from sim_vehicles.autopilot.pilot import Pilot
from sim_vehicles.autopilot.position_targets import Setpoint, Vector
from sim_vehicles.autopilot.telemetry import UNASKED_NS
from sim_vehicles.config import VehicleConfig
from sim_vehicles.vehicle import CRITICAL, WARNING, Vehicle

CM = 0.01
TAKEOFF_DONE_M = 0.05
LOW_M = 10.0
"""Height below which a landing goes on at LAND_SPEED (LAND_ALT_LOW)."""
TURNS_FROM_M = 2.0
"""Its nose turns to a place that is farther than this (WP_YAW_BEHAVIOR)."""
HOME_M = 0.5
"""A copter this near its home is over it."""
PER_S, BRAKES_MPS2 = 0.5, 1.5
"""How fast what is left of a way is flown off, and the deceleration of a long one (twice the mean)."""
TOUCH_DOWN_M = 0.05
AS_IT_IS = math.nan
SEEING = BY_THROTTLE | {CopterMode.RTL, CopterMode.LAND}
"""Modes in which it has to look where it is."""
HEARTBEAT_ALONE = {m.MAVLINK_MSG_ID_HEARTBEAT: UNASKED_NS}
LIKE_PLANES = (
    m.MAV_CMD_DO_SET_MODE,
    m.MAV_CMD_COMPONENT_ARM_DISARM,
    m.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
    m.MAV_CMD_DO_REPOSITION,
    m.MAV_CMD_GET_MESSAGE_INTERVAL,
    m.MAV_CMD_SET_MESSAGE_INTERVAL,
    m.MAV_CMD_REQUEST_MESSAGE,
    m.MAV_CMD_GET_HOME_POSITION,
    m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
)


class CopterPilot(Pilot):
    """One multirotor's condition and mode, and the resulting velocities."""

    def __init__(self, config: VehicleConfig, steering: Steering, parameters: ParameterServer) -> None:
        """Start in the condition of booting."""
        self._home_over = False
        self._place_m: Vector | None = None
        """Where it flies to, or stays: north, east and above the origin."""
        self._place_yaw_rad = AS_IT_IS
        super().__init__(config, steering, parameters)
        self.mode = CopterMode.STABILIZE

    @property
    def under_way(self) -> bool:
        """Whether it has to look where it is: it takes off, flies to a place, comes home, lands or sinks."""
        return (self.takeoff_m is not None or self._place_m is not None or self.mode in SEEING) and self.airborne

    @property
    def landed_state(self) -> int:
        """MAV_LANDED_STATE, take-offs and landings too."""
        if self.condition is not Condition.FLYING:
            return m.MAV_LANDED_STATE_ON_GROUND
        if self.takeoff_m is not None:
            return m.MAV_LANDED_STATE_TAKEOFF
        lands = self.mode is CopterMode.LAND or (self.mode is CopterMode.RTL and self._home_over)
        return m.MAV_LANDED_STATE_LANDING if lands else m.MAV_LANDED_STATE_IN_AIR

    def arm(self, motion: Motion) -> bool:  # noqa: ARG002 - it stands until it takes off
        """Arm; return whether the mode and the condition allow it."""
        return self.mode not in NOT_ARMABLE and self.request(Request.ARM)

    def enter(self, mode: FlightMode, motion: Motion) -> None:  # noqa: ARG002 - it stands where it is
        """Change the mode; it stands until that has it do something."""
        self.mode = CopterMode(mode)
        self.takeoff_m, self._home_over = None, False
        self.stop()

    def fly_straight(self, motion: Motion) -> None:  # noqa: ARG002 - likewise
        """Stand: that is what one without setpoints does."""
        self.stop()

    def stop(self) -> None:
        """Stand where it is."""
        self.silent_at, self._place_m = NEVER, None
        self._fly(0.0, 0.0, 0.0)

    def go_to(self, place_m: Vector, yaw_rad: float | None) -> None:
        """Fly to a place and stay there; `yaw_rad` None: the nose stays where it is."""
        self.silent_at, self._place_m = NEVER, place_m
        self._place_yaw_rad = AS_IT_IS if yaw_rad is None else yaw_rad

    def obey(self, velocity_mps: Vector, yaw_rad: float | None, now: Instant) -> None:
        """Fly a velocity, north, east and down, until GUID_TIMEOUT; `yaw_rad` None: the nose stays where it is."""
        self._place_m = None
        north, east, down = velocity_mps
        most_mps, speed = CM * self._parameters["WPNAV_SPEED"], math.hypot(north, east)
        share = min(1.0, most_mps / speed) if speed > 0.0 else 0.0
        self._fly(share * north, share * east, down, AS_IT_IS if yaw_rad is None else yaw_rad)
        self.silent_at = after(now, self._parameters["GUID_TIMEOUT"])

    def rise(self, height_m: float) -> bool:
        """Take off to a height; return whether that is possible."""
        if self.mode is not CopterMode.GUIDED or self.condition is not Condition.ARMED or height_m <= 0.0:
            return False
        self.takeoff_m = height_m
        return self.request(Request.LIFT_OFF)

    def progress(self, motion: Motion) -> bool:
        """Continue a take-off, a way home or a landing; return whether it has just touched the ground."""
        if self.takeoff_m is not None:
            self._climb(motion, self.takeoff_m)
            return False
        if self._place_m is not None:
            self._fly_towards(motion, *self._place_m, self._place_yaw_rad)
            return False
        sink_mps = CM * self._parameters["WPNAV_SPEED_DN"]
        if self.mode is CopterMode.RTL and not self._home_over:
            self._go_home(motion)
            return False
        if self.mode in (CopterMode.RTL, CopterMode.LAND) and motion.height_m < LOW_M:
            sink_mps = CM * self._parameters["LAND_SPEED"]
        self._fly(0.0, 0.0, sink_mps)
        if motion.height_m > TOUCH_DOWN_M:
            return False
        self.stop()
        return self.request(Request.TOUCH_DOWN)

    def _climb(self, motion: Motion, height_m: float) -> None:
        left_m = height_m - motion.height_m
        if left_m < TAKEOFF_DONE_M:
            self.takeoff_m = None
            self.stop()
        else:
            self._fly(0.0, 0.0, -min(PER_S * left_m + TAKEOFF_DONE_M, self._climb_most_mps(motion)))

    def _climb_most_mps(self, motion: Motion) -> float:  # noqa: ARG002 - the same at every height
        """Return how fast it climbs in a take-off, at most."""
        return CM * self._parameters["WPNAV_SPEED_UP"]

    def _cruise_mps(self) -> float:
        """Return how fast it flies to a place, at most."""
        return CM * self._parameters["WPNAV_SPEED"]

    def _go_home(self, motion: Motion) -> None:
        """Climb to RTL_ALT, unless it is higher already, and fly straight home."""
        start, height_m = self._config.start, CM * self._parameters["RTL_ALT"]
        self._home_over = math.hypot(start.north_m - motion.north_m, start.east_m - motion.east_m) < HOME_M
        if height_m - motion.height_m > HOME_M and not self._home_over:
            self._fly_towards(motion, motion.north_m, motion.east_m, height_m)
        else:
            self._fly_towards(motion, start.north_m, start.east_m, motion.height_m)

    def _fly_towards(
        self, motion: Motion, north_m: float, east_m: float, height_m: float, yaw_rad: float = AS_IT_IS
    ) -> None:
        """Fly straight to a place, and brake before it."""
        to_north_m, to_east_m = north_m - motion.north_m, east_m - motion.east_m
        away_m, below_m = math.hypot(to_north_m, to_east_m), height_m - motion.height_m
        speed = min(PER_S * away_m, math.sqrt(BRAKES_MPS2 * away_m), self._cruise_mps())
        sinks, climbs = CM * self._parameters["WPNAV_SPEED_DN"], CM * self._parameters["WPNAV_SPEED_UP"]
        sink_mps = -within(PER_S * below_m, -sinks, climbs)
        self._fly(speed * to_north_m / max(away_m, HOME_M), speed * to_east_m / max(away_m, HOME_M), sink_mps, yaw_rad)

    def _fly(self, north_mps: float, east_mps: float, down_mps: float, yaw_rad: float = AS_IT_IS) -> None:
        self._steering.velocity_mps = (north_mps, east_mps, down_mps)
        self._steering.yaw_rad = yaw_rad


def _take_off(vehicle: Copter, given: GivenCommand) -> int:
    """Take off to a height above home, which no other frame gives."""
    if given.frame != m.MAV_FRAME_GLOBAL_RELATIVE_ALT:
        return DENIED
    return ACCEPTED if vehicle.take_off(given.z) else FAILED


HANDLERS: dict[int, Callable[[Any, GivenCommand], int]] = {
    **{command: commands.HANDLERS[command] for command in LIKE_PLANES},
    m.MAV_CMD_NAV_TAKEOFF: _take_off,
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: to_mode(CopterMode.RTL),
    m.MAV_CMD_NAV_LAND: to_mode(CopterMode.LAND),
    m.MAV_CMD_NAV_LOITER_UNLIM: to_mode(CopterMode.LOITER),
    m.MAV_CMD_MISSION_START: to_mode(CopterMode.AUTO),
}
"""All others are UNSUPPORTED, as MAV_CMD_GUIDED_CHANGE_SPEED and its like are by a real one."""


def copters(config: VehicleConfig) -> dict[str, ParameterKind]:
    """Return a multirotor's parameters by their names, in ArduCopter's cm."""
    model = config.model
    return {
        "ARMING_CHECK": ParameterKind(m.MAV_PARAM_TYPE_INT32, 0, 2**24, 1),
        "DISARM_DELAY": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 127, 10),
        "FS_GCS_ENABLE": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 7, 0),
        "FS_GCS_TIMEOUT": floating(2, 120, 5),
        "GUID_TIMEOUT": floating(0.1, 5, 3),
        "LAND_SPEED": ParameterKind(m.MAV_PARAM_TYPE_INT16, 30, 200, 50),
        "MAV_GCS_SYSID": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 255, 255),
        "MAV_SYSID": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 255, config.identity.system),
        "RTL_ALT": ParameterKind(m.MAV_PARAM_TYPE_INT32, 30, 300000, 1500),
        "WPNAV_ACCEL": floating(50, 500, math.ceil(100 * model.accel_max_mps2)),
        "WPNAV_SPEED": floating(10, 2000, max(1000, math.ceil(100 * model.speed_max_mps))),
        "WPNAV_SPEED_DN": floating(10, 500, 150),
        "WPNAV_SPEED_UP": floating(10, 1000, 250),
    }


class Copter(Vehicle):
    """An emulated ArduCopter; missions aren't emulated."""

    mav_type = m.MAV_TYPE_QUADROTOR
    capabilities = 64495
    unasked = HEARTBEAT_ALONE
    guided_mode = CopterMode.GUIDED
    ground_mode = CopterMode.STABILIZE
    boot_mode = CopterMode.STABILIZE
    by_hand = frozenset({CopterMode.STABILIZE, CopterMode.ALT_HOLD})
    failsafe_keys = COPTER_FAILSAFE
    armed_text = "Arming motors"
    disarmed_text = "Disarming motors"
    handlers = HANDLERS
    flier: CopterPilot
    """Its pilot, typed as a CopterPilot."""

    def parameters_of(self, config: VehicleConfig) -> ParameterServer:
        """Return ArduCopter's parameters."""
        return ParameterServer(copters(config))

    def pilot_of(self, config: VehicleConfig, steering: Steering) -> CopterPilot:
        """Return who flies a multirotor."""
        self.flier = CopterPilot(config, steering, self.parameters)
        return self.flier

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already, and report it at once."""
        if mode is not self.pilot.mode:
            self.pilot.enter(mode, self.body.motion)
            self.tell_heartbeat()

    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether there is such a mode and it has what it needs."""
        mode = select(self.pilot.condition, number, frozenset(CopterMode))
        if mode == CopterMode.AUTO:
            self.say(WARNING, "Mode change to AUTO failed: init failed")
            return False
        if mode is None:
            self.say(WARNING, f"No such mode {number:g}")
            return False
        self.enter(CopterMode(mode))
        return True

    def arm(self, *, force: bool) -> bool:
        """Arm, where the mode allows it; one that doesn't take off disarms by itself."""
        armed = super().arm(force=force)
        if not armed and self.ready:
            self.say(CRITICAL, f"Arm: {self.pilot.mode.name} mode not armable")
        if armed and not self.pilot.airborne:
            self.disarm_at = after(self.now, self.parameters["DISARM_DELAY"])
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
        """Disarm at once."""
        self.disarm(force=False)

    def take_other(self, frame: Frame) -> bool:
        """Take a setpoint; return whether the frame is one."""
        message = frame.message
        if not isinstance(message, position_targets.MESSAGES):
            return False
        if self.pilot.mode is CopterMode.GUIDED and not self.ignores and not self.pilot.takeoff_m:
            self._take_setpoint(message)
        return True

    def go_to(self, lat_rad: float, lon_rad: float, height_m: float) -> None:
        """Fly to a place and stay there."""
        north_m, east_m, _ = self.fleet.origin.to_ned(lat_rad, lon_rad, self.fleet.origin.alt_m)
        self._go_to((north_m, east_m, height_m), None)

    def follow_time(self) -> None:
        """Stand once the last velocity is too old."""
        if self.now >= self.pilot.silent_at:
            self.flier.stop()

    def _go_to(self, place_m: Vector, yaw_rad: float | None) -> None:
        """Fly to a place; the nose turns there first, unless it is told where to turn or the place is near."""
        here = self.body.motion
        north_m, east_m = place_m[0] - here.north_m, place_m[1] - here.east_m
        if yaw_rad is None and math.hypot(north_m, east_m) > TURNS_FROM_M:
            yaw_rad = math.atan2(east_m, north_m)
        self.flier.go_to(place_m, yaw_rad)

    def _take_setpoint(self, message: Setpoint) -> None:
        """Fly to a place, or a velocity; whatever else is asked stops it, as does what isn't finite."""
        mask = message.type_mask
        place_m, velocity_mps = position_targets.place_of(self, message), position_targets.velocity_of(self, message)
        yaw_rad = None if mask & position_targets.YAW or not math.isfinite(message.yaw_rad) else message.yaw_rad
        if place_m is not None:
            self._go_to(place_m, yaw_rad)
        elif velocity_mps is None:
            self.flier.stop()
        else:
            if (
                mask & position_targets.YAW and mask & position_targets.YAW_RATE
            ):  # the nose then turns to where it flies
                yaw_rad = math.atan2(velocity_mps[1], velocity_mps[0])
            self.flier.obey(velocity_mps, yaw_rad, self.now)

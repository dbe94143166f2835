"""Commands and setpoints as ArduPilot's vehicles take them alike; what one family alone takes is beside its class.

Sources: MAVLink guide, "Command Protocol"; MAVLink common message set, "SET_POSITION_TARGET_LOCAL_NED" and
"SET_POSITION_TARGET_GLOBAL_INT"; answers of ArduPlane 4.7, ArduCopter 4.7 and PX4 1.17. One difference is deliberate:
NaN in a used field is denied, where ArduPlane accepts it. If a setpoint has position and velocity, only the position is
used.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, TypeVar

from airlink import mavlink as m
from airlink.messages.command import CommandInt, CommandLong, MessageInterval, SetPositionTargetGlobalInt
from airlink.messages.mission import MissionItem, MissionItemInt
from airlink.messages.payload import DEGE7
from sim_vehicles.airframe.motion import Vector
from sim_vehicles.autopilot.autopilot import Autopilot, GivenCommand, Setpoint
from sim_vehicles.autopilot.mission_items import from_message

V = TypeVar("V")
CommandHandlers = dict[int, Callable[[V, GivenCommand], int]]
"""MAV_CMD -> what carries it out on a vehicle, and returns the MAV_RESULT."""
ACCEPTED: Final = m.MAV_RESULT_ACCEPTED
DENIED: Final = m.MAV_RESULT_DENIED
FAILED: Final = m.MAV_RESULT_FAILED
UNSUPPORTED: Final = m.MAV_RESULT_UNSUPPORTED
ABOVE_SEA_LEVEL: Final = (m.MAV_FRAME_GLOBAL, m.MAV_FRAME_GLOBAL_INT)
ABOVE_HOME: Final = (
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)
"""The ground is level, so heights above terrain are heights above home."""
FORCE: Final = 21196
FULL_TURN_DEG: Final = 360.0
POLE_DEG: Final = 90.0
HIGHEST_M: Final = 2**31 / 100
"""ArduPlane stores heights as 32-bit integers of centimetres."""
MAX_POSITION_HEIGHT_M: Final = 83000.0
HIGHEST_MESSAGE_ID: Final = 2**16 - 1
UNAVAILABLE: Final = 0
"""MESSAGE_INTERVAL of a message that can't be sent."""
POSITION_NOW: Final = 2
HEIGHT_NOW: Final = 3
AT_ONCE: Final = (POSITION_NOW, HEIGHT_NOW)
"""Values of `current` for an item to be flown at once instead of stored: a position, or only a height."""
POSITION_IGNORED: Final = (
    m.POSITION_TARGET_TYPEMASK_X_IGNORE | m.POSITION_TARGET_TYPEMASK_Y_IGNORE | m.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
VELOCITY_IGNORED: Final = (
    m.POSITION_TARGET_TYPEMASK_VX_IGNORE | m.POSITION_TARGET_TYPEMASK_VY_IGNORE | m.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
YAW_IGNORED: Final = m.POSITION_TARGET_TYPEMASK_YAW_IGNORE
YAW_RATE_IGNORED: Final = m.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
FROM_NOSE: Final = (m.MAV_FRAME_BODY_NED, m.MAV_FRAME_BODY_OFFSET_NED)
FROM_HERE: Final = (m.MAV_FRAME_LOCAL_OFFSET_NED, *FROM_NOSE)


def received(message: CommandInt | CommandLong) -> GivenCommand:
    """Return the command in a message. COMMAND_LONG has heights above home, and degrees as floats."""
    params = (message.param1, message.param2, message.param3, message.param4)
    if isinstance(message, CommandInt):
        position = message.x * DEGE7, message.y * DEGE7
        return GivenCommand(
            message.command, message.frame, params, position[0], position[1], message.z, in_integers=True
        )
    position = math.radians(message.param5), math.radians(message.param6)
    frame, z = m.MAV_FRAME_GLOBAL_RELATIVE_ALT, message.param7
    return GivenCommand(message.command, frame, params, position[0], position[1], z, in_integers=False)


def height_of(vehicle: Autopilot, z: float, frame: float) -> float | None:
    """Return a height above the fleet's origin, None for a frame or height that isn't accepted."""
    if not abs(z) <= HIGHEST_M:
        return None
    if frame in ABOVE_SEA_LEVEL:
        return z - vehicle.origin.alt_m
    return z if frame in ABOVE_HOME else None


def _flag(value: float, flag: int) -> bool:
    """Return whether a float, as an integer, has a flag set; NaN and infinities have none."""
    return math.isfinite(value) and bool(int(value) & flag)


def _set_mode(vehicle: Autopilot, given: GivenCommand) -> int:
    if not _flag(given.params[0], m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED):
        return DENIED
    return ACCEPTED if vehicle.switch(given.params[1]) else FAILED


def to_mode(mode: int, refused: int = FAILED) -> Callable[[Autopilot, GivenCommand], int]:
    """Return the handler of a command that changes the mode."""
    return lambda vehicle, _given: ACCEPTED if vehicle.switch(mode) else refused


def reboot(refused: int) -> Callable[[Autopilot, GivenCommand], int]:
    """Return the handler that restarts a vehicle after the acknowledgement; an armed vehicle refuses."""

    def carry_out(vehicle: Autopilot, given: GivenCommand) -> int:
        vehicle.reboots = given.params[0] == 1.0 and not vehicle.pilot.condition.armed
        return ACCEPTED if vehicle.reboots else refused

    return carry_out


def _arm_disarm(vehicle: Autopilot, given: GivenCommand) -> int:
    arm, force = given.params[0], given.params[1] == FORCE
    if arm not in (0.0, 1.0):
        return UNSUPPORTED
    granted = vehicle.arm(force=force) if arm else vehicle.disarm(force=force)
    return ACCEPTED if granted else FAILED


def _reposition(vehicle: Autopilot, given: GivenCommand) -> int:
    """Fly to a position and stay there; ArduPilot accepts this only as COMMAND_INT."""
    if not given.in_integers:
        return UNSUPPORTED
    height_m = height_of(vehicle, given.z, given.frame) if abs(given.z) <= MAX_POSITION_HEIGHT_M else None
    on_earth = abs(given.lat_rad) <= math.radians(POLE_DEG) and abs(given.lon_rad) <= math.pi
    if height_m is None or not on_earth or (given.lat_rad, given.lon_rad) == (0.0, 0.0):
        return DENIED
    guided = vehicle.guided_mode
    if vehicle.pilot.mode is not guided and not _flag(given.params[1], m.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE):
        return FAILED
    if not vehicle.switch(guided):
        return FAILED
    vehicle.ask_circle(given.params[2], given.params[3])
    vehicle.go_to(given.lat_rad, given.lon_rad, height_m)
    return ACCEPTED


def fly_to(vehicle: Autopilot, item: MissionItem | MissionItemInt) -> int:
    """Fly at once to a position or height sent as a mission item; return the MAV_MISSION_RESULT."""
    found = from_message(item)
    if isinstance(found, int):
        return found
    height_m = height_of(vehicle, found.z, found.frame)
    if height_m is None or (item.current == POSITION_NOW and vehicle.pilot.mode is not vehicle.guided_mode):
        return m.MAV_MISSION_ERROR
    if item.current == POSITION_NOW:
        vehicle.ask_circle(0.0, 0.0)
        vehicle.go_to(found.x * DEGE7, found.y * DEGE7, height_m)
    else:
        vehicle.climb_to(height_m)
    return m.MAV_MISSION_ACCEPTED


def choose_item(vehicle: Autopilot, given: GivenCommand) -> int:
    """Go on with an item of the mission, and report it."""
    if not vehicle.missions.choose(given.params[0]):
        return DENIED
    _send(vehicle, m.MAVLINK_MSG_ID_MISSION_CURRENT)
    return ACCEPTED


def _set_interval(vehicle: Autopilot, given: GivenCommand) -> int:
    message_id, interval_us = given.params[0], given.params[1]
    known = message_id in vehicle.builders and math.isfinite(interval_us)
    taken = known and vehicle.streams.set_interval(int(message_id), interval_us, vehicle.now)
    return ACCEPTED if taken else DENIED


def _get_interval(vehicle: Autopilot, given: GivenCommand) -> int:
    """Report a message's interval, or that it isn't available."""
    if not 0.0 <= given.params[0] <= HIGHEST_MESSAGE_ID:
        return DENIED
    message_id = int(given.params[0])
    known = message_id in vehicle.builders
    interval_us = vehicle.streams.interval_us(message_id) if known else UNAVAILABLE
    vehicle.answer(MessageInterval(message_id, interval_us))
    return ACCEPTED if known else FAILED


def request_message(vehicle: Autopilot, given: GivenCommand) -> int:
    """Send a message once."""
    return _send(vehicle, given.params[0])


def _send(vehicle: Autopilot, message_id: float) -> int:
    if message_id not in vehicle.builders:
        return FAILED
    vehicle.answer(vehicle.builders[int(message_id)](vehicle))
    return ACCEPTED


def position_of(vehicle: Autopilot, setpoint: Setpoint) -> Vector | None:
    """Return the position, m north, east and above the fleet's origin; None without a valid one."""
    if setpoint.type_mask & POSITION_IGNORED:
        return None
    start, origin = vehicle.config.start, vehicle.origin
    if isinstance(setpoint, SetPositionTargetGlobalInt):
        above_m = height_of(vehicle, setpoint.alt_m, setpoint.coordinate_frame)
        north_m, east_m, _ = origin.to_ned(setpoint.lat_int_rad, setpoint.lon_int_rad, origin.alt_m)
        return None if above_m is None else (north_m, east_m, above_m)
    if not all(map(math.isfinite, (setpoint.x_m, setpoint.y_m, setpoint.z_m))):
        return None
    north_m, east_m = _turned(vehicle, setpoint, setpoint.x_m, setpoint.y_m)
    if setpoint.coordinate_frame in FROM_HERE:
        here = vehicle.body.motion
        return here.north_m + north_m, here.east_m + east_m, here.height_m - setpoint.z_m
    return start.north_m + north_m, start.east_m + east_m, -setpoint.z_m


def velocity_of(vehicle: Autopilot, setpoint: Setpoint) -> Vector | None:
    """Return the velocity north, east and down, m/s; None without a finite one, or if there is a position too."""
    velocity_mps = setpoint.vx_mps, setpoint.vy_mps, setpoint.vz_mps
    if (
        setpoint.type_mask & VELOCITY_IGNORED
        or not setpoint.type_mask & POSITION_IGNORED
        or not all(map(math.isfinite, velocity_mps))
    ):
        return None
    return *_turned(vehicle, setpoint, setpoint.vx_mps, setpoint.vy_mps), setpoint.vz_mps


def yaw_rate_of(setpoint: Setpoint) -> float:
    """Return the yaw rate, rad/s, clockwise; 0 if there is none, or a yaw instead."""
    given = (
        setpoint.type_mask & YAW_IGNORED
        and not setpoint.type_mask & YAW_RATE_IGNORED
        and math.isfinite(setpoint.yaw_rate_radps)
    )
    return setpoint.yaw_rate_radps if given else 0.0


def _turned(vehicle: Autopilot, setpoint: Setpoint, ahead: float, right: float) -> tuple[float, float]:
    """Return north and east components of a setpoint that may be relative to the nose."""
    if setpoint.coordinate_frame not in FROM_NOSE:
        return ahead, right
    nose_rad = vehicle.body.shown().heading_rad
    cos, sin = math.cos(nose_rad), math.sin(nose_rad)
    return ahead * cos - right * sin, ahead * sin + right * cos


HANDLERS: CommandHandlers[Autopilot] = {
    m.MAV_CMD_DO_SET_MODE: _set_mode,
    m.MAV_CMD_COMPONENT_ARM_DISARM: _arm_disarm,
    m.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: reboot(FAILED),
    m.MAV_CMD_DO_REPOSITION: _reposition,
    m.MAV_CMD_DO_SET_MISSION_CURRENT: choose_item,
    m.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    m.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    m.MAV_CMD_REQUEST_MESSAGE: request_message,
    m.MAV_CMD_GET_HOME_POSITION: lambda vehicle, _: _send(vehicle, m.MAVLINK_MSG_ID_HOME_POSITION),
    m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: lambda vehicle, _: _send(vehicle, m.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
}
"""What all ArduPilots take."""
REQUESTS: Final = frozenset(
    {
        m.MAV_CMD_GET_MESSAGE_INTERVAL,
        m.MAV_CMD_SET_MESSAGE_INTERVAL,
        m.MAV_CMD_REQUEST_MESSAGE,
        m.MAV_CMD_GET_HOME_POSITION,
        m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
    }
)
"""Commands that change only what the vehicle sends; all others are orders."""

"""Commands as ArduPlane takes and refuses them.

Sources: MAVLink guide, "Command Protocol"; ArduPilot documentation, "Plane: GUIDED mode"; answers of ArduPlane 4.7.
One difference is on purpose: NaN in a used field is denied here, where the real one would take it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from airlink import mavlink as m
from airlink.messages import CommandInt, CommandLong
from sim_vehicles.modes import Mode, Request, select
from sim_vehicles.telemetry import BUILDERS

if TYPE_CHECKING:
    from sim_vehicles.vehicle import Vehicle

ACCEPTED, DENIED, FAILED = m.MAV_RESULT_ACCEPTED, m.MAV_RESULT_DENIED, m.MAV_RESULT_FAILED
UNSUPPORTED = m.MAV_RESULT_UNSUPPORTED
DEGREES_E7 = math.pi / 180e7
ABOVE_SEA_LEVEL = (m.MAV_FRAME_GLOBAL, m.MAV_FRAME_GLOBAL_INT)
ABOVE_HOME = (
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)
"""The ground is level, so heights above terrain are heights above home."""
LEAST_LATERAL_MPS2 = 0.05
"""What a heading's lateral acceleration of 0 becomes: it hardly turns."""
FORCE = 21196
FULL_TURN_DEG, POLE_DEG = 360.0, 90.0


class Order(NamedTuple):
    """A command, whichever message brought it; latitude and longitude in radians."""

    command: int
    frame: int
    params: tuple[float, float, float, float]
    lat_rad: float
    lon_rad: float
    z: float


def order(message: CommandInt | CommandLong) -> Order:
    """Return what a message orders. COMMAND_LONG has heights above home and degrees as floats."""
    params = (message.param1, message.param2, message.param3, message.param4)
    if isinstance(message, CommandInt):
        place = message.x * DEGREES_E7, message.y * DEGREES_E7
        return Order(message.command, message.frame, params, *place, message.z)
    place = math.radians(message.param5), math.radians(message.param6)
    return Order(message.command, m.MAV_FRAME_GLOBAL_RELATIVE_ALT, params, *place, message.param7)


def execute(vehicle: Vehicle, given: Order) -> int:
    """Carry out an order; return its MAV_RESULT."""
    handler = HANDLERS.get(given.command)
    return UNSUPPORTED if handler is None else handler(vehicle, given)


def _height_m(vehicle: Vehicle, z: float, frame: int) -> float | None:
    """Return a height above the fleet's origin, None for a frame that isn't taken."""
    if frame in ABOVE_SEA_LEVEL:
        return z - vehicle.origin_alt_m
    return z + vehicle.pilot.home_height_m if frame in ABOVE_HOME else None


def _change_speed(vehicle: Vehicle, given: Order) -> int:
    kind, speed, acceleration, _ = given.params
    if vehicle.pilot.mode is not Mode.GUIDED:
        return FAILED
    if kind != m.SPEED_TYPE_AIRSPEED or not math.isfinite(speed) or math.isnan(acceleration):
        return DENIED
    frame = vehicle.config.airframe
    if not frame.speed_min_mps <= speed <= frame.speed_max_mps:
        return FAILED
    vehicle.pilot.guided_by_setpoints = True
    vehicle.steering.speed_mps[vehicle.index] = speed
    return ACCEPTED


def _change_altitude(vehicle: Vehicle, given: Order) -> int:
    if vehicle.pilot.mode is not Mode.GUIDED:
        return FAILED
    height_m = _height_m(vehicle, given.z, given.frame)
    if height_m is None or not math.isfinite(given.z) or given.z in (0.0, -1.0):
        return DENIED
    vehicle.pilot.guided_by_setpoints = True
    vehicle.steering.height_m[vehicle.index] = height_m
    return ACCEPTED


def _change_heading(vehicle: Vehicle, given: Order) -> int:
    kind, degrees, lateral_mps2, _ = given.params
    if vehicle.pilot.mode is not Mode.GUIDED:
        return FAILED
    if kind == m.HEADING_TYPE_DEFAULT:
        vehicle.circle_here()
        return ACCEPTED
    known = kind in (m.HEADING_TYPE_COURSE_OVER_GROUND, m.HEADING_TYPE_HEADING)
    if not known or not 0.0 <= degrees < FULL_TURN_DEG or math.isnan(lateral_mps2):
        return DENIED
    course = kind == m.HEADING_TYPE_COURSE_OVER_GROUND
    vehicle.pilot.steer(math.radians(degrees), course=course, lateral_mps2=max(lateral_mps2, LEAST_LATERAL_MPS2))
    return ACCEPTED


def _set_mode(vehicle: Vehicle, given: Order) -> int:
    if not int(given.params[0] if math.isfinite(given.params[0]) else 0) & m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return DENIED
    return _enter(vehicle, given.params[1])


def _enter(vehicle: Vehicle, number: float) -> int:
    mode = select(vehicle.pilot.condition, number)
    if mode is None:
        return FAILED
    vehicle.enter(mode)
    return ACCEPTED


def _arm_disarm(vehicle: Vehicle, given: Order) -> int:
    arm, force = given.params[0], given.params[1]
    if arm not in (0.0, 1.0):
        return DENIED
    if arm:
        return ACCEPTED if vehicle.arm(force=force == FORCE) else FAILED
    return ACCEPTED if vehicle.disarm(Request.FORCE_DISARM if force == FORCE else Request.DISARM) else FAILED


def _legacy_speed(vehicle: Vehicle, given: Order) -> int:
    kind, speed = given.params[0], given.params[1]
    frame = vehicle.config.airframe
    if not math.isfinite(speed) or kind not in (m.SPEED_TYPE_AIRSPEED, m.SPEED_TYPE_GROUNDSPEED):
        return DENIED
    if not frame.speed_min_mps <= speed <= frame.speed_max_mps:
        return FAILED
    if not vehicle.pilot.guided_by_setpoints:
        vehicle.steering.speed_mps[vehicle.index] = speed
    return ACCEPTED


def _legacy_altitude(vehicle: Vehicle, given: Order) -> int:
    z, frame = given.params[0], given.params[1]
    height_m = _height_m(vehicle, z, int(frame)) if math.isfinite(frame) else None
    if height_m is None or not math.isfinite(z):
        return DENIED
    if vehicle.pilot.airborne and not vehicle.pilot.guided_by_setpoints:
        vehicle.steering.height_m[vehicle.index] = height_m
    return ACCEPTED


def _reposition(vehicle: Vehicle, given: Order) -> int:
    height_m = _height_m(vehicle, given.z, given.frame)
    place = abs(given.lat_rad) <= math.radians(POLE_DEG) and abs(given.lon_rad) <= math.pi
    if height_m is None or not place or not math.isfinite(given.z):
        return DENIED
    change = math.isfinite(given.params[1]) and int(given.params[1]) & m.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
    if vehicle.pilot.mode is not Mode.GUIDED and not change:
        return DENIED
    if vehicle.pilot.mode is not Mode.GUIDED:
        vehicle.enter(Mode.GUIDED)
    vehicle.go_to(given.lat_rad, given.lon_rad, height_m)
    return ACCEPTED


def _message_interval(vehicle: Vehicle, given: Order) -> int:
    message_id, interval_us = given.params[0], given.params[1]
    if message_id not in BUILDERS or not math.isfinite(interval_us):
        return DENIED
    return ACCEPTED if vehicle.streams.set_interval(int(message_id), interval_us / 1e6) else DENIED


def _request_message(vehicle: Vehicle, given: Order) -> int:
    build = BUILDERS.get(int(given.params[0])) if math.isfinite(given.params[0]) else None
    if build is None:
        return FAILED
    vehicle.answer(build(vehicle))
    return ACCEPTED


def _home(vehicle: Vehicle, _: Order) -> int:
    vehicle.answer(BUILDERS[m.MAVLINK_MSG_ID_HOME_POSITION](vehicle))
    return ACCEPTED


def _capabilities(vehicle: Vehicle, _: Order) -> int:
    vehicle.answer(BUILDERS[m.MAVLINK_MSG_ID_AUTOPILOT_VERSION](vehicle))
    return ACCEPTED


HANDLERS: dict[int, Callable[[Vehicle, Order], int]] = {
    m.MAV_CMD_GUIDED_CHANGE_SPEED: _change_speed,
    m.MAV_CMD_GUIDED_CHANGE_ALTITUDE: _change_altitude,
    m.MAV_CMD_GUIDED_CHANGE_HEADING: _change_heading,
    m.MAV_CMD_DO_SET_MODE: _set_mode,
    m.MAV_CMD_COMPONENT_ARM_DISARM: _arm_disarm,
    m.MAV_CMD_NAV_TAKEOFF: lambda _vehicle, _given: FAILED,
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda vehicle, _: _enter(vehicle, Mode.RTL),
    m.MAV_CMD_NAV_LOITER_UNLIM: lambda vehicle, _: _enter(vehicle, Mode.LOITER),
    m.MAV_CMD_MISSION_START: lambda vehicle, _: _enter(vehicle, Mode.RTL),
    m.MAV_CMD_DO_CHANGE_SPEED: _legacy_speed,
    m.MAV_CMD_DO_CHANGE_ALTITUDE: _legacy_altitude,
    m.MAV_CMD_DO_REPOSITION: _reposition,
    m.MAV_CMD_SET_MESSAGE_INTERVAL: _message_interval,
    m.MAV_CMD_REQUEST_MESSAGE: _request_message,
    m.MAV_CMD_GET_HOME_POSITION: _home,
    m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _capabilities,
}

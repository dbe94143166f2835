"""Commands, accepted and refused as by ArduPlane.

Sources: MAVLink guide, "Command Protocol"; ArduPilot documentation, "Plane: GUIDED mode"; answers of ArduPlane 4.7. Two
differences are deliberate: NaN in a used field is denied, where ArduPlane accepts it; and the climb rate of
MAV_CMD_GUIDED_CHANGE_ALTITUDE is ignored, because ArduPlane follows it far too slowly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.messages.command import CommandInt, CommandLong, MessageInterval
from airlink.messages.mission import MissionItem, MissionItemInt
from flight_model.autopilot_model import finite
from sim_vehicles.autopilot.mission_items import from_message
from sim_vehicles.autopilot.modes_and_failsafe import Mode

if TYPE_CHECKING:
    from sim_vehicles.plane import Plane
    from sim_vehicles.vehicle import Vehicle

ACCEPTED: Final = m.MAV_RESULT_ACCEPTED
DENIED: Final = m.MAV_RESULT_DENIED
FAILED: Final = m.MAV_RESULT_FAILED
UNSUPPORTED: Final = m.MAV_RESULT_UNSUPPORTED
DEGREE: Final = math.pi / 180
DEGREES_E7: Final = math.pi / 180e7
ABOVE_SEA_LEVEL: Final = (m.MAV_FRAME_GLOBAL, m.MAV_FRAME_GLOBAL_INT)
ABOVE_HOME: Final = (
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)
"""The ground is level, so heights above terrain are heights above home."""
LEAST_LATERAL_MPS2: Final = 0.05
"""Replacement of a lateral acceleration of 0, with which ArduPlane hardly turns."""
AIRSPEED: Final = m.SPEED_TYPE_AIRSPEED
AGAIN: Final = m.HEADING_TYPE_DEFAULT
COURSE: Final = m.HEADING_TYPE_COURSE_OVER_GROUND
HEADING: Final = m.HEADING_TYPE_HEADING
FORCE: Final = 21196
GUIDED: Final = Mode.GUIDED
SPEED_MODES: Final = (Mode.GUIDED, Mode.AUTO)
USUAL_SPEED: Final = -2.0
MOST_PERCENT: Final = 100.0
FULL_TURN_DEG: Final = 360.0
POLE_DEG: Final = 90.0
HIGHEST_M: Final = 2**31 / 100
"""ArduPlane stores heights as 32-bit integers of centimetres."""
HIGHEST_PLACE_M: Final = 83000.0
HIGHEST_MESSAGE_ID: Final = 2**16 - 1
UNAVAILABLE: Final = 0
"""MESSAGE_INTERVAL of a message that can't be sent."""
AT_ONCE = PLACE_NOW, HEIGHT_NOW = 2, 3
"""Values of `current` for an item to be flown at once instead of stored: a position, or only a height."""


@mypyc_attr(acyclic=True, free_list_len=1)
class GivenCommand:
    """A command, from either kind of message."""

    def __init__(
        self,
        command: int,
        frame: int,
        params: tuple[float, float, float, float],
        lat_rad: float,
        lon_rad: float,
        z: float,
        *,
        in_integers: bool,
    ) -> None:
        """Take MAV_CMD, MAV_FRAME, `param1` to `param4`, and a position, whose `z` refers to the frame.

        `in_integers`: the position was sent as integers, in COMMAND_INT.
        """
        self.command = command
        self.frame = frame
        self.params = params
        self.lat_rad = lat_rad
        self.lon_rad = lon_rad
        self.z = z
        self.in_integers = in_integers


CommandHandlers = dict[int, Callable[[Any, GivenCommand], int]]
"""MAV_CMD -> what carries it out on a vehicle, and returns the MAV_RESULT."""


def received(message: CommandInt | CommandLong) -> GivenCommand:
    """Return the command in a message. COMMAND_LONG has heights above home, and degrees as floats."""
    params = (message.param1, message.param2, message.param3, message.param4)
    if isinstance(message, CommandInt):
        place = message.x * DEGREES_E7, message.y * DEGREES_E7
        return GivenCommand(message.command, message.frame, params, place[0], place[1], message.z, in_integers=True)
    place = math.radians(message.param5), math.radians(message.param6)
    frame, z = m.MAV_FRAME_GLOBAL_RELATIVE_ALT, message.param7
    return GivenCommand(message.command, frame, params, place[0], place[1], z, in_integers=False)


def height_of(vehicle: Vehicle, z: float, frame: float) -> float | None:
    """Return a height above the fleet's origin, None for a frame or height that isn't accepted."""
    if not abs(z) <= HIGHEST_M:
        return None
    if frame in ABOVE_SEA_LEVEL:
        return z - vehicle.fleet.origin.alt_m
    return z if frame in ABOVE_HOME else None


def _flag(value: float, flag: int) -> bool:
    """Return whether a float, as an integer, has a flag set; NaN and infinities have none."""
    return math.isfinite(value) and bool(int(value) & flag)


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
    vehicle.flier.steer(degrees * DEGREE, course=course, lateral_mps2=max(lateral_mps2, LEAST_LATERAL_MPS2))
    return ACCEPTED


def _set_mode(vehicle: Vehicle, given: GivenCommand) -> int:
    if not _flag(given.params[0], m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED):
        return DENIED
    return _enter(vehicle, given.params[1])


def _enter(vehicle: Vehicle, number: float) -> int:
    return ACCEPTED if vehicle.switch(number) else FAILED


def to_mode(mode: int, refused: int = FAILED) -> Callable[[Any, GivenCommand], int]:
    """Return the handler of a command that changes the mode."""
    return lambda vehicle, _given: ACCEPTED if vehicle.switch(mode) else refused


def reboot(refused: int) -> Callable[[Any, GivenCommand], int]:
    """Return the handler that restarts a vehicle after the acknowledgement; an armed vehicle refuses."""

    def carry_out(vehicle: Vehicle, given: GivenCommand) -> int:
        vehicle.reboots = given.params[0] == 1.0 and not vehicle.pilot.condition.armed
        return ACCEPTED if vehicle.reboots else refused

    return carry_out


def _arm_disarm(vehicle: Vehicle, given: GivenCommand) -> int:
    arm, force = given.params[0], given.params[1] == FORCE
    if arm not in (0.0, 1.0):
        return UNSUPPORTED
    granted = vehicle.arm(force=force) if arm else vehicle.disarm(force=force)
    return ACCEPTED if granted else FAILED


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
        return ACCEPTED if 0.0 < throttle <= MOST_PERCENT else FAILED
    if not vehicle.flier.guided_by_setpoints:
        vehicle.flier.change_speed(speed_mps, math.inf)
    return ACCEPTED


def _legacy_altitude(vehicle: Vehicle, given: GivenCommand) -> int:
    height_m = height_of(vehicle, given.params[0], given.params[1])
    if height_m is None:
        return DENIED
    vehicle.climb_to(height_m)
    return ACCEPTED


def reposition(vehicle: Vehicle, given: GivenCommand) -> int:
    """Fly to a position and stay there; ArduPilot accepts this only as COMMAND_INT."""
    if not given.in_integers:
        return UNSUPPORTED
    height_m = height_of(vehicle, given.z, given.frame) if abs(given.z) <= HIGHEST_PLACE_M else None
    on_earth = abs(given.lat_rad) <= math.radians(POLE_DEG) and abs(given.lon_rad) <= math.pi
    if height_m is None or not on_earth or (given.lat_rad, given.lon_rad) == (0.0, 0.0):
        return DENIED
    guided = vehicle.guided_mode
    if vehicle.pilot.mode is not guided and not _flag(given.params[1], m.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE):
        return FAILED
    if _enter(vehicle, guided) != ACCEPTED:
        return FAILED
    vehicle.ask_circle(given.params[2], given.params[3])
    vehicle.go_to(given.lat_rad, given.lon_rad, height_m)
    return ACCEPTED


def fly_to(vehicle: Vehicle, item: MissionItem | MissionItemInt) -> int:
    """Fly at once to a position or height sent as a mission item; return the MAV_MISSION_RESULT."""
    found = from_message(item)
    if isinstance(found, int):
        return found
    height_m = height_of(vehicle, found.z, found.frame)
    if height_m is None or (item.current == PLACE_NOW and vehicle.pilot.mode is not vehicle.guided_mode):
        return m.MAV_MISSION_ERROR
    if item.current == PLACE_NOW:
        vehicle.ask_circle(0.0, 0.0)
        vehicle.go_to(found.x * DEGREES_E7, found.y * DEGREES_E7, height_m)
    else:
        vehicle.climb_to(height_m)
    return m.MAV_MISSION_ACCEPTED


def _start_mission(vehicle: Vehicle, given: GivenCommand) -> int:
    """Start or resume the mission; first and last item aren't supported."""
    return DENIED if any(given.params[:2]) else _enter(vehicle, Mode.AUTO)


def _choose_item(vehicle: Vehicle, given: GivenCommand) -> int:
    if not vehicle.missions.choose(given.params[0]):
        return DENIED
    _send(vehicle, m.MAVLINK_MSG_ID_MISSION_CURRENT)
    return ACCEPTED


def _set_interval(vehicle: Vehicle, given: GivenCommand) -> int:
    message_id, interval_us = given.params[0], given.params[1]
    known = message_id in vehicle.builders and math.isfinite(interval_us)
    taken = known and vehicle.streams.set_interval(int(message_id), interval_us, vehicle.now)
    return ACCEPTED if taken else DENIED


def _get_interval(vehicle: Vehicle, given: GivenCommand) -> int:
    """Report a message's interval, or that it isn't available."""
    if not 0.0 <= given.params[0] <= HIGHEST_MESSAGE_ID:
        return DENIED
    message_id = int(given.params[0])
    known = message_id in vehicle.builders
    interval_us = vehicle.streams.interval_us(message_id) if known else UNAVAILABLE
    vehicle.messages.answer(MessageInterval(message_id, interval_us))
    return ACCEPTED if known else FAILED


def _request_message(vehicle: Vehicle, given: GivenCommand) -> int:
    return _send(vehicle, given.params[0])


def _send(vehicle: Vehicle, message_id: float) -> int:
    if message_id not in vehicle.builders:
        return FAILED
    vehicle.messages.answer(vehicle.builders[int(message_id)](vehicle))
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
HANDLERS: CommandHandlers = {
    **dict.fromkeys(NO_EFFECT, lambda _vehicle, _given: ACCEPTED),
    m.MAV_CMD_DO_FENCE_ENABLE: lambda _vehicle, _given: FAILED,
    m.MAV_CMD_DO_GO_AROUND: lambda _vehicle, _given: FAILED,
    m.MAV_CMD_GUIDED_CHANGE_SPEED: _change_speed,
    m.MAV_CMD_GUIDED_CHANGE_ALTITUDE: _change_altitude,
    m.MAV_CMD_GUIDED_CHANGE_HEADING: _change_heading,
    m.MAV_CMD_DO_SET_MODE: _set_mode,
    m.MAV_CMD_COMPONENT_ARM_DISARM: _arm_disarm,
    m.MAV_CMD_NAV_TAKEOFF: lambda _vehicle, _given: FAILED,
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: to_mode(Mode.RTL),
    m.MAV_CMD_NAV_LOITER_UNLIM: to_mode(Mode.LOITER),
    m.MAV_CMD_MISSION_START: _start_mission,
    m.MAV_CMD_DO_SET_MISSION_CURRENT: _choose_item,
    m.MAV_CMD_DO_CHANGE_SPEED: _legacy_speed,
    m.MAV_CMD_DO_CHANGE_ALTITUDE: _legacy_altitude,
    m.MAV_CMD_DO_REPOSITION: reposition,
    m.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: reboot(FAILED),
    m.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    m.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    m.MAV_CMD_REQUEST_MESSAGE: _request_message,
    m.MAV_CMD_GET_HOME_POSITION: lambda vehicle, _: _send(vehicle, m.MAVLINK_MSG_ID_HOME_POSITION),
    m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: lambda vehicle, _: _send(vehicle, m.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
}

ORDERS = frozenset(HANDLERS) - {
    m.MAV_CMD_GET_MESSAGE_INTERVAL,
    m.MAV_CMD_SET_MESSAGE_INTERVAL,
    m.MAV_CMD_REQUEST_MESSAGE,
    m.MAV_CMD_GET_HOME_POSITION,
    m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
}
"""Commands that change what the vehicle does, not only what it sends."""

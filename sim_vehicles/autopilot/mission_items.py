"""The items of a mission as ArduPlane stores them: accepted commands, and what is stored of each.

Source: ArduPilot, AP_Mission::mavlink_int_to_mission_cmd; answers of ArduPlane 4.7. Two differences are deliberate:
heights above terrain are heights above home (the ground is level), and the position fields of commands without a
position aren't stored (DO_DIGICAM_CONTROL and others use them).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from airlink import mavlink as m
from airlink.messages.mission import MissionItem, MissionItemInt
from formation_scenario.stored_landing import LandingItem

E7 = 1e7
HIGHEST_M = 2**23 / 100
"""ArduPlane stores heights of items as 24-bit integers of centimetres."""
FRAMES = {
    m.MAV_FRAME_MISSION: m.MAV_FRAME_GLOBAL,
    m.MAV_FRAME_GLOBAL: m.MAV_FRAME_GLOBAL,
    m.MAV_FRAME_GLOBAL_INT: m.MAV_FRAME_GLOBAL,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT: m.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: m.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT: m.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: m.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}
"""Accepted frames, and the frame with which an item is read back; items without a position may have any."""
BYTE, WORD = 255, 65535


def _turns(turns: float) -> float:
    """Return the stored number of turns: whole ones, or 256ths below one."""
    return math.floor(256.0 * turns) / 256.0 if 0.0 < turns < 1.0 else float(min(int(turns), BYTE))


def _radius(radius_m: float) -> float:
    """Return the stored radius of counted turns, m: a byte of metres, above that a byte of tens of metres."""
    size_m = abs(radius_m)
    kept_m = int(size_m) if size_m <= BYTE else 10 * min(int(0.1 * size_m), BYTE)
    return math.copysign(kept_m, radius_m)


FORMS: dict[str, Callable[[float], float]] = {
    ".": lambda _: 0.0,
    "f": float,
    "i": lambda value: float(max(min(int(value), WORD), -WORD)),
    "b": lambda value: float(max(min(int(value), BYTE), 0)),
    "s": lambda value: -1.0 if value < 0.0 else 1.0,
    "+": lambda value: float(value > 0.0),
    "t": _turns,
    "r": _radius,
}
"""What is stored of a parameter: nothing, a float, an integer, a byte, a sign, a flag, turns, a radius."""
WITH_POSITION = {
    m.MAV_CMD_NAV_WAYPOINT: ".bb.",
    m.MAV_CMD_NAV_LOITER_UNLIM: "..i.",
    m.MAV_CMD_NAV_LOITER_TURNS: "t.r+",
    m.MAV_CMD_NAV_LOITER_TIME: "i.s+",
    m.MAV_CMD_NAV_LAND: "i..s",
    m.MAV_CMD_NAV_TAKEOFF: "i...",
    m.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT: "i...",
    m.MAV_CMD_NAV_LOITER_TO_ALT: ".i.+",
    m.MAV_CMD_NAV_VTOL_TAKEOFF: "....",
    m.MAV_CMD_NAV_VTOL_LAND: "i...",
    m.MAV_CMD_NAV_GUIDED_ENABLE: "i...",
    m.MAV_CMD_NAV_PAYLOAD_PLACE: "f...",
    m.MAV_CMD_DO_SET_HOME: "i...",
    m.MAV_CMD_DO_LAND_START: "....",
    m.MAV_CMD_DO_GO_AROUND: "....",
    m.MAV_CMD_DO_SET_ROI_LOCATION: "i...",
    m.MAV_CMD_DO_SET_ROI: "i...",
}
"""Accepted commands with a position, and the forms in which their four parameters are stored (`FORMS`)."""
WITHOUT_POSITION = {
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: "....",
    m.MAV_CMD_NAV_ALTITUDE_WAIT: "fff.",
    m.MAV_CMD_NAV_DELAY: "ffff",
    m.MAV_CMD_CONDITION_DELAY: "f...",
    m.MAV_CMD_CONDITION_DISTANCE: "f...",
    m.MAV_CMD_CONDITION_YAW: "ffff",
    m.MAV_CMD_DO_JUMP: "ii..",
    m.MAV_CMD_JUMP_TAG: "i...",
    m.MAV_CMD_DO_JUMP_TAG: "ii..",
    m.MAV_CMD_DO_CHANGE_SPEED: "iff.",
    m.MAV_CMD_DO_SET_RELAY: "ii..",
    m.MAV_CMD_DO_REPEAT_RELAY: "iif.",
    m.MAV_CMD_DO_SET_SERVO: "ii..",
    m.MAV_CMD_DO_REPEAT_SERVO: "iiif",
    m.MAV_CMD_DO_SET_ROI_NONE: "i...",
    m.MAV_CMD_DO_DIGICAM_CONFIGURE: "iiii",
    m.MAV_CMD_DO_DIGICAM_CONTROL: "iiii",
    m.MAV_CMD_DO_MOUNT_CONTROL: "fff.",
    m.MAV_CMD_DO_SET_CAM_TRIGG_DIST: "f.i.",
    m.MAV_CMD_DO_FENCE_ENABLE: "i...",
    m.MAV_CMD_DO_PARACHUTE: "i...",
    m.MAV_CMD_DO_INVERTED_FLIGHT: "i...",
    m.MAV_CMD_DO_GRIPPER: "ii..",
    m.MAV_CMD_DO_AUTOTUNE_ENABLE: "i...",
    m.MAV_CMD_DO_AUX_FUNCTION: "ii..",
    m.MAV_CMD_DO_GUIDED_LIMITS: "ifff",
    m.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: "ffff",
    m.MAV_CMD_DO_VTOL_TRANSITION: "i...",
    m.MAV_CMD_IMAGE_START_CAPTURE: "ifii",
    m.MAV_CMD_IMAGE_STOP_CAPTURE: "i...",
    m.MAV_CMD_VIDEO_START_CAPTURE: "i...",
    m.MAV_CMD_VIDEO_STOP_CAPTURE: "i...",
}
"""The same for commands without a position: they are read back with position and frame 0."""
HELD = WITH_POSITION | WITHOUT_POSITION
YAW_MAY_BE_NAN = frozenset(
    {
        m.MAV_CMD_NAV_WAYPOINT,
        m.MAV_CMD_NAV_LOITER_UNLIM,
        m.MAV_CMD_NAV_LAND,
        m.MAV_CMD_NAV_TAKEOFF,
        m.MAV_CMD_NAV_VTOL_TAKEOFF,
        m.MAV_CMD_NAV_VTOL_LAND,
    }
)


class Item(NamedTuple):
    """A stored item: latitude and longitude in 1e-7 degrees, height in m relative to its frame."""

    command: int
    frame: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float


def from_message(message: MissionItem | MissionItemInt) -> Item | int:
    """Return the item of a message, or the MAV_MISSION_RESULT that refuses it."""
    held = HELD.get(message.command)
    if held is None:
        return m.MAV_MISSION_UNSUPPORTED
    given = message.param1, message.param2, message.param3, message.param4
    for index, value in enumerate(given):
        yaw = index == 3 and message.command in YAW_MAY_BE_NAN
        if not (math.isfinite(value) or (yaw and math.isnan(value))):
            return m.MAV_MISSION_INVALID_PARAM1 + index
    first, second, third, fourth = (FORMS[form](value) for form, value in zip(held, given, strict=True))
    params = first, second, third, fourth
    if message.command not in WITH_POSITION:
        return Item(message.command, m.MAV_FRAME_GLOBAL, params, 0, 0, 0.0)
    where = _position(message)
    return where if isinstance(where, int) else Item(message.command, FRAMES[message.frame], params, *where)


def of_landing(item: LandingItem) -> Item:
    """Return the stored item of a landing's."""
    lat_e7, lon_e7 = item.position_e7 or (0, 0)
    frame = m.MAV_FRAME_MISSION if item.position_e7 is None else m.MAV_FRAME_GLOBAL_RELATIVE_ALT
    return Item(item.command, frame, (0.0, item.reached_m, 0.0, 0.0), lat_e7, lon_e7, item.height_m)


def to_message(item: Item, seq: int, system: int, component: int, *, current: bool) -> MissionItemInt:
    """Return the message with which an item is read back."""
    fields = item.frame, item.command, int(current), 1, *item.params, item.x, item.y, item.z
    return MissionItemInt(system, component, seq, *fields)


def in_degrees(message: MissionItemInt) -> MissionItem:
    """Return the older form of an item, with latitude and longitude as floats in degrees."""
    fields: dict[str, Any] = message.values() | {"x": message.x / E7, "y": message.y / E7}
    return MissionItem(**fields)


def _position(message: MissionItem | MissionItemInt) -> tuple[int, int, float] | int:
    """Return latitude, longitude in 1e-7 degrees and height, or the MAV_MISSION_RESULT that refuses them."""
    if message.frame not in FRAMES:
        return m.MAV_MISSION_UNSUPPORTED_FRAME
    scale = 1.0 if isinstance(message, MissionItemInt) else E7
    lat, lon = message.x * scale, message.y * scale
    if not abs(lat) <= 90 * E7:
        return m.MAV_MISSION_INVALID_PARAM5_X
    if not abs(lon) <= 180 * E7:
        return m.MAV_MISSION_INVALID_PARAM6_Y
    if not abs(message.z) <= HIGHEST_M:
        return m.MAV_MISSION_INVALID_PARAM7
    return round(lat), round(lon), message.z

"""Mission items: which are accepted, what is kept of them, and how they are read back.

Sources: MAVLink guide, "Mission Protocol"; answers of ArduPlane 4.7, which keeps only those parts of an item that it
uses. Two differences are deliberate: heights above terrain are heights above home (the ground is level), and commands
that the emulator can't fly, such as NAV_LAND, are refused rather than kept.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from airlink import mavlink as m
from airlink.messages.mission import MissionItem, MissionItemInt

E7 = 1e7
HIGHEST_M = 2**23 / 100
"""ArduPlane keeps heights of items as 24-bit integers of centimetres."""
FRAMES = {
    m.MAV_FRAME_GLOBAL: m.MAV_FRAME_GLOBAL,
    m.MAV_FRAME_GLOBAL_INT: m.MAV_FRAME_GLOBAL,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT: m.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: m.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT: m.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: m.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}
"""Accepted frames -> the frame with which an item is read back."""
KEPT: dict[int, tuple[bool, bool, bool, bool]] = {
    m.MAV_CMD_NAV_WAYPOINT: (False, True, True, False),
    m.MAV_CMD_NAV_LOITER_UNLIM: (False, False, True, False),
    m.MAV_CMD_NAV_LOITER_TURNS: (True, False, True, True),
    m.MAV_CMD_NAV_LOITER_TIME: (True, False, False, False),
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: (False, False, False, False),
    m.MAV_CMD_NAV_TAKEOFF: (True, False, False, False),
    m.MAV_CMD_DO_JUMP: (True, True, False, False),
    m.MAV_CMD_DO_CHANGE_SPEED: (True, True, True, False),
}
"""Accepted commands -> which of their four parameters are kept."""
PLACELESS = frozenset({m.MAV_CMD_NAV_RETURN_TO_LAUNCH, m.MAV_CMD_DO_JUMP, m.MAV_CMD_DO_CHANGE_SPEED})
YAW_MAY_BE_NAN = frozenset({m.MAV_CMD_NAV_WAYPOINT, m.MAV_CMD_NAV_LOITER_UNLIM, m.MAV_CMD_NAV_TAKEOFF})


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
    kept = KEPT.get(message.command)
    if kept is None:
        return m.MAV_MISSION_UNSUPPORTED
    given = message.param1, message.param2, message.param3, message.param4
    for place, value in enumerate(given):
        yaw = place == 3 and message.command in YAW_MAY_BE_NAN
        if not (math.isfinite(value) or (yaw and math.isnan(value))):
            return m.MAV_MISSION_INVALID_PARAM1 + place
    params = given[0] * kept[0], given[1] * kept[1], given[2] * kept[2], given[3] if kept[3] else 0.0
    if message.command in PLACELESS:
        return Item(message.command, m.MAV_FRAME_GLOBAL, params, 0, 0, 0.0)
    place = _place(message)
    return place if isinstance(place, int) else Item(message.command, FRAMES[message.frame], params, *place)


def to_message(item: Item, seq: int, system: int, component: int, *, current: bool) -> MissionItemInt:
    """Return the message with which an item is read back."""
    fields = item.frame, item.command, int(current), 1, *item.params, item.x, item.y, item.z
    return MissionItemInt(system, component, seq, *fields)


def in_degrees(message: MissionItemInt) -> MissionItem:
    """Return the older form of an item, with latitude and longitude as floats in degrees."""
    return MissionItem(*message._replace(x=0, y=0))._replace(x=message.x / E7, y=message.y / E7)


def _place(message: MissionItem | MissionItemInt) -> tuple[int, int, float] | int:
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

"""Position and velocity setpoints, from either message and in any frame.

Source: MAVLink common message set, "SET_POSITION_TARGET_LOCAL_NED" and "SET_POSITION_TARGET_GLOBAL_INT"; answers of
ArduCopter 4.7 and PX4 1.17. If a setpoint has position and velocity, only the position is used.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from airlink import mavlink as m
from airlink.messages.command import SetPositionTargetGlobalInt, SetPositionTargetLocalNed
from sim_vehicles.autopilot.commands import height_of

if TYPE_CHECKING:
    from sim_vehicles.vehicle import Vehicle

PLACE: Final = (
    m.POSITION_TARGET_TYPEMASK_X_IGNORE | m.POSITION_TARGET_TYPEMASK_Y_IGNORE | m.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
VELOCITY: Final = (
    m.POSITION_TARGET_TYPEMASK_VX_IGNORE | m.POSITION_TARGET_TYPEMASK_VY_IGNORE | m.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
YAW: Final = m.POSITION_TARGET_TYPEMASK_YAW_IGNORE
YAW_RATE: Final = m.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
FROM_NOSE: Final = (m.MAV_FRAME_BODY_NED, m.MAV_FRAME_BODY_OFFSET_NED)
FROM_HERE: Final = (m.MAV_FRAME_LOCAL_OFFSET_NED, *FROM_NOSE)
ALL_IGNORED: Final = (
    PLACE
    | VELOCITY
    | m.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | m.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | m.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)
PX4_LOCAL_FRAMES: Final = (m.MAV_FRAME_LOCAL_NED, m.MAV_FRAME_BODY_NED)
PX4_GLOBAL_FRAMES: Final = (
    m.MAV_FRAME_GLOBAL_INT,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)
Setpoint = SetPositionTargetLocalNed | SetPositionTargetGlobalInt
Vector = tuple[float, float, float]


def place_of(vehicle: Vehicle, setpoint: Setpoint) -> Vector | None:
    """Return the position, m north, east and above the fleet's origin; None without a valid one."""
    if setpoint.type_mask & PLACE:
        return None
    start, origin = vehicle.config.start, vehicle.fleet.origin
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


def velocity_of(vehicle: Vehicle, setpoint: Setpoint) -> Vector | None:
    """Return the velocity north, east and down, m/s; None without a finite one, or if there is a position too."""
    velocity_mps = setpoint.vx_mps, setpoint.vy_mps, setpoint.vz_mps
    if setpoint.type_mask & VELOCITY or not setpoint.type_mask & PLACE or not all(map(math.isfinite, velocity_mps)):
        return None
    return *_turned(vehicle, setpoint, setpoint.vx_mps, setpoint.vy_mps), setpoint.vz_mps


def yaw_rate_of(setpoint: Setpoint) -> float:
    """Return the yaw rate, rad/s, clockwise; 0 if there is none, or a yaw instead."""
    told = setpoint.type_mask & YAW and not setpoint.type_mask & YAW_RATE and math.isfinite(setpoint.yaw_rate_radps)
    return setpoint.yaw_rate_radps if told else 0.0


def refusal_of_px4(setpoint: Setpoint) -> str | None:
    """Return PX4's text on refusing a setpoint, None for an accepted one."""
    name, frame = setpoint.kind().name, setpoint.coordinate_frame
    if isinstance(setpoint, SetPositionTargetLocalNed) and frame not in PX4_LOCAL_FRAMES:
        return f"{name} coordinate frame {frame} unsupported"
    if isinstance(setpoint, SetPositionTargetGlobalInt) and frame not in PX4_GLOBAL_FRAMES:
        return f"{name} invalid coordinate frame {frame}"
    from_nose = frame == m.MAV_FRAME_BODY_NED and not setpoint.type_mask & PLACE
    return f"{name} invalid" if from_nose or setpoint.type_mask & ALL_IGNORED == ALL_IGNORED else None


def _turned(vehicle: Vehicle, setpoint: Setpoint, ahead: float, right: float) -> tuple[float, float]:
    """Return north and east components of a setpoint that may be relative to the nose."""
    if setpoint.coordinate_frame not in FROM_NOSE:
        return ahead, right
    nose_rad = vehicle.body.shown().heading_rad
    cos, sin = math.cos(nose_rad), math.sin(nose_rad)
    return ahead * cos - right * sin, ahead * sin + right * cos

"""What all multirotors are commanded, whoever flies them: velocities over ground, and where the nose points.

What the law calls airspeed and heading are ground speed and course here. Heights are held by the station: the vertical
velocity is the error of height by `HEIGHT_S`, for in the stream of velocities a height is taken only with a place.

Source: MAVLink guide, "SET_POSITION_TARGET_LOCAL_NED"; acceptance as the simulators of ArduCopter and PX4 showed it.
"""

from __future__ import annotations

import math
from typing import Final

from airlink import mavlink as m
from airlink.messages.command import SetPositionTargetLocalNed
from flight_model.autopilot import FlightState, Setpoint
from flight_model.slot import hovering_course, slot_axis
from gcs_formation.vehicle.lead import VelocityLead

MULTIROTOR_TYPES: Final = frozenset(
    {
        m.MAV_TYPE_QUADROTOR,
        m.MAV_TYPE_COAXIAL,
        m.MAV_TYPE_HELICOPTER,
        m.MAV_TYPE_HEXAROTOR,
        m.MAV_TYPE_OCTOROTOR,
        m.MAV_TYPE_TRICOPTER,
        m.MAV_TYPE_DODECAROTOR,
        m.MAV_TYPE_DECAROTOR,
    }
)
HEIGHT_S: Final = 1.5
"""Time in which an error of height would be flown off: (7)'s two lags of height add up to it."""
TURNS_FROM_MPS: Final = 1.0
"""Ground speed from which the nose turns to where it flies; slower, and standing, it keeps its heading."""
NO_PLACE: Final = (
    m.POSITION_TARGET_TYPEMASK_X_IGNORE | m.POSITION_TARGET_TYPEMASK_Y_IGNORE | m.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
NO_PUSH: Final = (
    m.POSITION_TARGET_TYPEMASK_AX_IGNORE | m.POSITION_TARGET_TYPEMASK_AY_IGNORE | m.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)
VELOCITY_AND_YAW: Final = NO_PLACE | NO_PUSH | m.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
VELOCITY_ALONE: Final = NO_PLACE | NO_PUSH | m.POSITION_TARGET_TYPEMASK_YAW_IGNORE
"""With a yaw rate of 0: where both are to be ignored, ArduCopter's nose turns by WP_YAW_BEHAVIOR."""


def stands(setpoint: Setpoint) -> bool:
    """Return whether it is to stand: a leader, whose heading is then its nose's."""
    return setpoint.speed_mps == 0.0


def velocity_setpoint(
    system: int,
    setpoint: Setpoint,
    where: FlightState,
    nose_rad: float = math.nan,
    lead: VelocityLead | None = None,
) -> SetPositionTargetLocalNed:
    """Return a setpoint of the law as a velocity over ground, and the course as yaw where it moves.

    Where it stands its nose is told to be at `nose_rad`, NaN: to turn no further.
    """
    yaw_rad = setpoint.heading_rad if setpoint.speed_mps >= TURNS_FROM_MPS else nose_rad
    turns = math.isfinite(yaw_rad)
    velocity_mps = (
        setpoint.speed_mps * math.cos(setpoint.heading_rad),
        setpoint.speed_mps * math.sin(setpoint.heading_rad),
    )
    north_mps, east_mps = velocity_mps if lead is None else lead.lead(*velocity_mps)
    return SetPositionTargetLocalNed(
        0.0,
        system,
        m.MAV_COMP_ID_AUTOPILOT1,
        m.MAV_FRAME_LOCAL_NED,
        VELOCITY_AND_YAW if turns else VELOCITY_ALONE,
        vx_mps=north_mps,
        vy_mps=east_mps,
        vz_mps=(where.height_m - setpoint.height_m) / HEIGHT_S,
        yaw_rad=math.remainder(yaw_rad, math.tau) if turns else 0.0,
    )


def ground_motion(yaw_rad: float, north_mps: float, east_mps: float, *, leads: bool) -> tuple[float, float]:
    """Return ground speed and course; of a leader, its slots' axis and its speed along that, backwards negative."""
    if not leads:
        return math.hypot(north_mps, east_mps), hovering_course(yaw_rad, north_mps, east_mps)
    axis_rad = slot_axis(yaw_rad, north_mps, east_mps)
    return north_mps * math.cos(axis_rad) + east_mps * math.sin(axis_rad), axis_rad

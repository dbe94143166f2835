"""The messages with which an emulated PX4 reports its state, where they aren't an ArduPlane's, and how often.

Source: MAVLink common message set, "HEARTBEAT" and "CURRENT_MODE";
what PX4's simulator (SIH, version 1.17, development) answers, refuses and begins with.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from airlink import mavlink as m
from airlink.clock import NANOSECONDS
from airlink.messages import Message
from airlink.messages.system import CurrentMode, Heartbeat
from airlink.messages.telemetry import GpsRawInt, VfrHud
from sim_vehicles.autopilot import telemetry
from sim_vehicles.autopilot.modes_and_failsafe import PX4_BY_STICKS, Px4Mode

if TYPE_CHECKING:
    from sim_vehicles.px4 import Px4
    from sim_vehicles.vehicle import Vehicle

SPEED, SOON, SLOW = NANOSECONDS // 50, NANOSECONDS // 4, NANOSECONDS
STREAMS: Final = {
    m.MAVLINK_MSG_ID_HEARTBEAT: SLOW,
    m.MAVLINK_MSG_ID_SYS_STATUS: SLOW,
    m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: SLOW,
    m.MAVLINK_MSG_ID_GPS_RAW_INT: SLOW,
    m.MAVLINK_MSG_ID_HOME_POSITION: 2 * SLOW,
    m.MAVLINK_MSG_ID_VFR_HUD: SOON,
    m.MAVLINK_MSG_ID_ATTITUDE: SPEED,
    m.MAVLINK_MSG_ID_LOCAL_POSITION_NED: SPEED,
    m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: SPEED,
}
"""What a ground station's link carries without a request, and every how many ns."""
FOLLOWS: Final = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | m.MAV_MODE_FLAG_STABILIZE_ENABLED
FINDS_ITS_WAY: Final = FOLLOWS | m.MAV_MODE_FLAG_GUIDED_ENABLED | m.MAV_MODE_FLAG_AUTO_ENABLED
"""HEARTBEAT's flags in OFFBOARD and in the modes without a pilot, by which pymavlink and others tell these."""
FLAGS: Final = dict.fromkeys(PX4_BY_STICKS, telemetry.MODE_FLAGS) | {
    Px4Mode.ACRO: m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | m.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED,
    Px4Mode.OFFBOARD: FOLLOWS,
    Px4Mode.ORBIT: FOLLOWS,
}


def heartbeat(v: Px4) -> Message:
    """Return HEARTBEAT: ACTIVE as soon as it is armed, CRITICAL in a failsafe."""
    armed = v.pilot.condition.armed
    flags = FLAGS.get(v.mode, FINDS_ITS_WAY) | (m.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    up = m.MAV_STATE_STANDBY if v.armable else m.MAV_STATE_UNINIT
    state = m.MAV_STATE_CRITICAL if armed and v.in_failsafe else m.MAV_STATE_ACTIVE if armed else up
    return Heartbeat(v.mav_type, m.MAV_AUTOPILOT_PX4, flags, int(v.mode), state)


def current_mode(v: Px4) -> Message:
    """Return CURRENT_MODE, with the mode that was asked for last."""
    return CurrentMode(0, int(v.mode), int(v.intended))


def gps_raw_int(v: Vehicle) -> Message:
    """Return GPS_RAW_INT; it has no time stamp."""
    reported = telemetry.gps_raw_int(v)
    assert isinstance(reported, GpsRawInt)
    return reported.but(time_usec=0)


def vfr_hud(v: Px4) -> Message:
    """Return VFR_HUD; a multirotor measures no airspeed."""
    reported = telemetry.vfr_hud(v)
    assert isinstance(reported, VfrHud)
    return reported.but(airspeed_mps=math.nan) if v.config.model.hovers else reported


BUILDERS: Final[telemetry.Builders] = {
    each: telemetry.BUILDERS[each]
    for each in (
        m.MAVLINK_MSG_ID_SYS_STATUS,
        m.MAVLINK_MSG_ID_SYSTEM_TIME,
        m.MAVLINK_MSG_ID_ATTITUDE,
        m.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        m.MAVLINK_MSG_ID_MISSION_CURRENT,
        m.MAVLINK_MSG_ID_BATTERY_STATUS,
        m.MAVLINK_MSG_ID_HOME_POSITION,
        m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        m.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    )
} | {
    m.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    m.MAVLINK_MSG_ID_CURRENT_MODE: current_mode,
    m.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    m.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
}

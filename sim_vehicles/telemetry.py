"""The messages by which an emulated ArduPlane tells its state, and how often."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from airlink import mavlink as m
from airlink.messages import (
    Attitude,
    AutopilotVersion,
    EkfStatusReport,
    ExtendedSysState,
    GlobalPositionInt,
    GpsRawInt,
    Heartbeat,
    HomePosition,
    LocalPositionNed,
    Message,
    NavControllerOutput,
    SysStatus,
    SystemTime,
    VfrHud,
    Wind,
)
from sim_vehicles.modes import Condition, system_status

if TYPE_CHECKING:
    from sim_vehicles.vehicle import Vehicle

G_MPS2 = 9.80665
SENSORS = (
    m.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | m.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | m.MAV_SYS_STATUS_SENSOR_3D_MAG
    | m.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | m.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
    | m.MAV_SYS_STATUS_SENSOR_GPS
    | m.MAV_SYS_STATUS_AHRS
    | m.MAV_SYS_STATUS_SENSOR_BATTERY
)
EKF_READY = 831
EKF_STARTING = 1024
EPOCH_2020_US = 1_577_836_800_000_000
CAPABILITIES = 62319
VERSION_4_7 = 4 << 24 | 7 << 16
BATTERY_V, BATTERY_A, BATTERY_PERCENT = 12.4, 8.0, 95
HDOP, SATELLITES = 70, 14


def heartbeat(v: Vehicle) -> Message:
    """Return HEARTBEAT."""
    mode_flags = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | m.MAV_MODE_FLAG_STABILIZE_ENABLED
    armed = m.MAV_MODE_FLAG_SAFETY_ARMED if v.pilot.condition.armed else 0
    return Heartbeat(
        m.MAV_TYPE_FIXED_WING,
        m.MAV_AUTOPILOT_ARDUPILOTMEGA,
        mode_flags | armed,
        int(v.pilot.mode),
        system_status(v.pilot.condition),
    )


def sys_status(v: Vehicle) -> Message:
    """Return SYS_STATUS: the pre-arm bit is healthy when the vehicle may be armed."""
    healthy = SENSORS | (m.MAV_SYS_STATUS_PREARM_CHECK if v.ready else 0)
    known = SENSORS | m.MAV_SYS_STATUS_PREARM_CHECK
    return SysStatus(known, known, healthy, 200, BATTERY_V, BATTERY_A, BATTERY_PERCENT)


def system_time(v: Vehicle) -> Message:
    """Return SYSTEM_TIME; unix time counts from 2020 at the start of the clock."""
    return SystemTime(EPOCH_2020_US + v.now // 1000, v.time_s)


def gps_raw_int(v: Vehicle) -> Message:
    """Return GPS_RAW_INT: a 3-D fix."""
    lat, lon, alt = v.geodetic()
    north, east, _ = v.ground_velocity()
    course = math.atan2(east, north) % math.tau
    fix = m.GPS_FIX_TYPE_3D_FIX
    return GpsRawInt(v.time_ns // 1000, fix, lat, lon, alt, HDOP, HDOP, math.hypot(north, east), course, SATELLITES)


def attitude(v: Vehicle) -> Message:
    """Return ATTITUDE; bank and pitch are those that the turn and the climb take."""
    rate, speed = v.turn_rate(), max(v.state("airspeed_mps"), 1.0)
    heading = math.remainder(v.state("heading_rad"), math.tau)
    roll = math.atan(rate * speed / G_MPS2)
    pitch = math.asin(min(max(v.state("climb_mps") / speed, -1.0), 1.0))
    return Attitude(v.time_s, roll, pitch, heading, 0.0, 0.0, rate)


def local_position_ned(v: Vehicle) -> Message:
    """Return LOCAL_POSITION_NED, from home."""
    start, height = v.config.start, v.state("height_m") - v.pilot.home_height_m
    north, east = v.state("north_m") - start.north_m, v.state("east_m") - start.east_m
    return LocalPositionNed(v.time_s, north, east, -height, *v.ground_velocity())


def global_position_int(v: Vehicle) -> Message:
    """Return GLOBAL_POSITION_INT."""
    lat, lon, alt = v.geodetic()
    above_home = v.state("height_m") - v.pilot.home_height_m
    heading = v.state("heading_rad") % math.tau
    return GlobalPositionInt(v.time_s, lat, lon, alt, above_home, *v.ground_velocity(), heading)


def nav_controller_output(v: Vehicle) -> Message:
    """Return NAV_CONTROLLER_OUTPUT."""
    heading, target = v.state("heading_rad"), v.commanded("heading_rad")
    roll = math.atan(v.turn_rate() * v.state("airspeed_mps") / G_MPS2)
    height_error = v.commanded("height_m") - v.state("height_m")
    speed_error = v.commanded("speed_mps") - v.state("airspeed_mps")
    bearings = (math.remainder(heading, math.tau), math.remainder(target, math.tau))
    return NavControllerOutput(roll, 0.0, *bearings, 0.0, height_error, speed_error, 0.0)


def vfr_hud(v: Vehicle) -> Message:
    """Return VFR_HUD."""
    north, east, down = v.ground_velocity()
    airspeed, heading = v.state("airspeed_mps"), v.state("heading_rad") % math.tau
    throttle = 50 if v.pilot.airborne else 0
    return VfrHud(airspeed, math.hypot(north, east), heading, throttle, v.geodetic()[2], -down)


def wind(v: Vehicle) -> Message:
    """Return WIND: where it comes from."""
    north, east, down = v.drift()
    return Wind(math.remainder(math.atan2(-east, -north), math.tau), math.hypot(north, east), down)


def ekf_status_report(v: Vehicle) -> Message:
    """Return EKF_STATUS_REPORT."""
    return EkfStatusReport(EKF_READY if v.ready else EKF_STARTING, 0.02, 0.02, 0.02, 0.01, 0.0)


def home_position(v: Vehicle) -> Message:
    """Return HOME_POSITION."""
    return HomePosition(*v.home(), 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), time_usec=v.time_ns // 1000)


def extended_sys_state(v: Vehicle) -> Message:
    """Return EXTENDED_SYS_STATE."""
    flying = v.pilot.condition is Condition.FLYING
    landed = m.MAV_LANDED_STATE_IN_AIR if flying else m.MAV_LANDED_STATE_ON_GROUND
    return ExtendedSysState(m.MAV_VTOL_STATE_UNDEFINED, landed)


def autopilot_version(_: Vehicle) -> Message:
    """Return AUTOPILOT_VERSION."""
    return AutopilotVersion(CAPABILITIES, VERSION_4_7)


BUILDERS: dict[int, Callable[[Vehicle], Message]] = {
    m.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    m.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    m.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    m.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    m.MAVLINK_MSG_ID_ATTITUDE: attitude,
    m.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    m.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: nav_controller_output,
    m.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    m.MAVLINK_MSG_ID_WIND: wind,
    m.MAVLINK_MSG_ID_EKF_STATUS_REPORT: ekf_status_report,
    m.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
    m.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
}
UNASKED_HZ = 1.0
UNASKED = (
    m.MAVLINK_MSG_ID_HEARTBEAT,
    m.MAVLINK_MSG_ID_SYS_STATUS,
    m.MAVLINK_MSG_ID_SYSTEM_TIME,
    m.MAVLINK_MSG_ID_GPS_RAW_INT,
    m.MAVLINK_MSG_ID_ATTITUDE,
    m.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    m.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
    m.MAVLINK_MSG_ID_VFR_HUD,
    m.MAVLINK_MSG_ID_WIND,
    m.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
)
"""What flows without being asked for."""

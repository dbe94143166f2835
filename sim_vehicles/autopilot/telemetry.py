"""The messages with which emulated autopilots report their state; PX4's own are in `families/px4/services`."""

from __future__ import annotations

import math
from typing import Final

from airlink import mavlink as m
from airlink.clock import seconds_between
from airlink.messages import EKF_READY, Message
from airlink.messages.system import AutopilotVersion, Heartbeat, SystemTime
from airlink.messages.telemetry import (
    Attitude,
    BatteryStatus,
    EkfStatusReport,
    ExtendedSysState,
    GlobalPositionInt,
    GpsRawInt,
    HomePosition,
    LocalPositionNed,
    NavControllerOutput,
    SysStatus,
    VfrHud,
    Wind,
)
from flight_model.autopilot_model import signed
from flight_model.energy import GRAVITY_MPS2
from sim_vehicles.airframe.motion import Motion
from sim_vehicles.autopilot.autopilot import Autopilot
from sim_vehicles.autopilot.modes_and_failsafe import system_status
from sim_vehicles.autopilot.onboard_log import OnboardLog
from sim_vehicles.autopilot.streams import Builders

SENSORS: Final = (
    m.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | m.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | m.MAV_SYS_STATUS_SENSOR_3D_MAG
    | m.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | m.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
    | m.MAV_SYS_STATUS_SENSOR_GPS
    | m.MAV_SYS_STATUS_AHRS
    | m.MAV_SYS_STATUS_SENSOR_BATTERY
)
EKF_STARTING: Final = 1024
SLOW_S: Final = 10.0
ALIGNS: Final[tuple[tuple[float, int], ...]] = (
    (0.2, m.ESTIMATOR_ATTITUDE),
    (0.4, m.ESTIMATOR_VELOCITY_VERT | m.ESTIMATOR_POS_VERT_ABS),
    (0.6, m.ESTIMATOR_VELOCITY_HORIZ),
    (0.8, m.ESTIMATOR_POS_HORIZ_REL),
)
"""From which share of the time to get ready on an estimator that takes longer than `SLOW_S` has which estimates."""
UNFIXED_RADPS: Final = 1e-6
"""How fast latitude and longitude drift without a fix, rad/s: 6 m/s north and east."""
LOAD_PERMILLE: Final = 200
CRUISE_THROTTLE_PERCENT: Final = 50
BATTERY_V: Final = 12.4
BATTERY_A: Final = 8.0
BATTERY_PERCENT: Final = 95
CELLS_V: Final[tuple[float, ...]] = (BATTERY_V, *[math.nan] * 9)
NO_TEMPERATURE: Final = 2**15 - 1
NOT_COUNTED: Final = -1
HDOP: Final = 70
SATELLITES: Final = 14
UNKNOWN_DOP: Final = 2**16 - 1
NO_FIX: Final = m.GPS_FIX_TYPE_NO_FIX
FIX: Final = m.GPS_FIX_TYPE_3D_FIX
ARDUPILOT: Final = m.MAV_AUTOPILOT_ARDUPILOTMEGA
MODE_FLAGS: Final = (
    m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | m.MAV_MODE_FLAG_STABILIZE_ENABLED | m.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
)
STEERS: Final = m.MAV_MODE_FLAG_GUIDED_ENABLED
ARMED: Final = m.MAV_MODE_FLAG_SAFETY_ARMED
RECEIVER: Final = m.MAV_SYS_STATUS_SENSOR_GPS
FENCE: Final = m.MAV_SYS_STATUS_GEOFENCE
PREARM_CHECK: Final = m.MAV_SYS_STATUS_PREARM_CHECK
_asin: Final = math.asin
_atan: Final = math.atan
_atan2: Final = math.atan2
"""Compiled code finds module names faster than attributes of `math`."""


def heartbeat(v: Autopilot) -> Message:
    """Return HEARTBEAT: type, mode, and whether it is armed."""
    flags = MODE_FLAGS if v.pilot.mode in v.by_hand else MODE_FLAGS | STEERS
    return Heartbeat(
        v.mav_type,
        ARDUPILOT,
        flags | ARMED if v.pilot.condition.armed else flags,
        int(v.pilot.mode),
        m.MAV_STATE_CRITICAL if v.in_failsafe else system_status(v.pilot.condition),
    )


def sys_status(v: Autopilot) -> Message:
    """Return SYS_STATUS; the pre-arm bit is healthy once the vehicle may be armed, the missing fence always."""
    working = SENSORS if v.estimate.received else SENSORS & ~RECEIVER
    healthy = working | FENCE | (PREARM_CHECK if _passes(v) else 0)
    known = SENSORS | PREARM_CHECK
    battery = v.battery
    if battery is None:
        return SysStatus(known, known, healthy, LOAD_PERMILLE, BATTERY_V, BATTERY_A, BATTERY_PERCENT)
    v.drain()
    return SysStatus(known, known, healthy, LOAD_PERMILLE, battery.voltage_v, battery.current_a, battery.percent)


def _passes(v: Autopilot) -> bool:
    """Return whether its pre-arm checks pass, as they do for good once it is armed."""
    return v.ready if v.pilot.condition.armed else v.armable


def battery_status(v: Autopilot) -> Message:
    """Return BATTERY_STATUS of the battery in SYS_STATUS; its cells are unknown."""
    battery = v.battery
    if battery is None:
        return BatteryStatus(0, 0, 0, NO_TEMPERATURE, CELLS_V, BATTERY_A, NOT_COUNTED, NOT_COUNTED, BATTERY_PERCENT)
    v.drain()
    total_v = (battery.voltage_v, *[math.nan] * 9)
    used_mah = int(battery.consumed_mah)
    return BatteryStatus(0, 0, 0, NO_TEMPERATURE, total_v, battery.current_a, used_mah, NOT_COUNTED, battery.percent)


def system_time(v: Autopilot) -> Message:
    """Return SYSTEM_TIME: the vehicle's UTC, and its time since boot."""
    return SystemTime(v.utc_us, v.time_s)


def gps_raw_int(v: Autopilot) -> GpsRawInt:
    """Return GPS_RAW_INT: the receiver's own 3-D fix, or no fix without a receiver."""
    received = v.estimate.received
    if received is None:
        return GpsRawInt(v.time_ns // 1000, NO_FIX, 0.0, 0.0, 0.0, UNKNOWN_DOP, UNKNOWN_DOP, 0.0, 0.0, 0)
    lat, lon, alt = v.origin.from_ned(received.north_m, received.east_m, -received.height_m)
    north, east = received.velocity_north_mps, received.velocity_east_mps
    course = _atan2(east, north) % math.tau
    return GpsRawInt(v.time_ns // 1000, FIX, lat, lon, alt, HDOP, HDOP, _length(north, east), course, SATELLITES)


def attitude(v: Autopilot) -> Message:
    """Return ATTITUDE; bank and pitch follow from turn rate and climb rate, plus the estimate's errors."""
    motion, estimate = v.sensed, v.estimate
    pitch = _asin(min(max(motion.climb_mps / max(motion.airspeed_mps, 1.0), -1.0), 1.0)) + estimate.pitch_error_rad
    bank = _bank(motion) + estimate.bank_error_rad
    return Attitude(v.time_s, bank, pitch, signed(motion.heading_rad), 0.0, 0.0, motion.yaw_rate_radps)


def local_position_ned(v: Autopilot) -> Message:
    """Return LOCAL_POSITION_NED, relative to home."""
    start, motion = v.config.start, v.sensed
    north, east = motion.north_m - start.north_m, motion.east_m - start.east_m
    return LocalPositionNed(
        v.time_s,
        north,
        east,
        -motion.height_m,
        motion.velocity_north_mps,
        motion.velocity_east_mps,
        motion.velocity_down_mps,
    )


def global_position_int(v: Autopilot) -> Message:
    """Return GLOBAL_POSITION_INT: position, heights above sea level and home, ground velocity, as sensed.

    Until an estimator that takes long has a position, ArduPilot tells one near latitude and longitude 0, that drifts.
    """
    motion = v.sensed
    lat, lon, alt = v.origin.from_ned(motion.north_m, motion.east_m, -motion.height_m)
    if v.fleet.ready_s > SLOW_S and not v.ready and not _aligned(v) & m.ESTIMATOR_POS_HORIZ_REL:
        lat = lon = UNFIXED_RADPS * v.time_s
    return GlobalPositionInt(
        v.time_s,
        lat,
        lon,
        alt,
        motion.height_m,
        motion.velocity_north_mps,
        motion.velocity_east_mps,
        motion.velocity_down_mps,
        motion.heading_rad % math.tau,
    )


def nav_controller_output(v: Autopilot) -> Message:
    """Return NAV_CONTROLLER_OUTPUT: the target's bearing and distance; errors of height, airspeed and track."""
    motion = v.sensed
    bearing, distance, cross_track = v.pilot.to_go(motion)
    bearing = signed(bearing)
    high = motion.height_setpoint_m - motion.height_m
    fast = _read(v, motion.airspeed_setpoint_mps - motion.airspeed_mps)
    return NavControllerOutput(_bank(motion), 0.0, bearing, bearing, distance, high, fast, cross_track)


def _read(v: Autopilot, true_mps: float) -> float:
    """Return the indicated airspeed (IAS) at a true airspeed."""
    pitot = v.body.pitot
    return true_mps if pitot is None else pitot.indicated(true_mps, v.sensed.height_m)


def vfr_hud(v: Autopilot) -> VfrHud:
    """Return VFR_HUD, the only message with the airspeed."""
    motion = v.sensed
    speed = _length(motion.velocity_north_mps, motion.velocity_east_mps)
    altitude = v.origin.alt_m + motion.height_m
    heading = motion.heading_rad % math.tau
    throttle = CRUISE_THROTTLE_PERCENT if v.pilot.airborne else 0
    return VfrHud(_read(v, motion.airspeed_mps), speed, heading, throttle, altitude, -motion.velocity_down_mps)


def wind(v: Autopilot) -> Message:
    """Return WIND; its direction is where the wind comes from."""
    motion = v.sensed
    north, east, down = motion.drift_north_mps, motion.drift_east_mps, motion.drift_down_mps
    return Wind(signed(_atan2(-east, -north)), _length(north, east), down)


def ekf_status_report(v: Autopilot) -> Message:
    """Return EKF_STATUS_REPORT: which estimates are valid, and their innovation ratios."""
    estimate = v.estimate
    flags, ratios = EKF_READY & ~estimate.unknown if v.ready else _aligned(v), estimate.ratios
    return EkfStatusReport(flags, ratios.velocity, ratios.horizontal, ratios.height, ratios.compass, 0.0)


def _aligned(v: Autopilot) -> int:
    """Return which estimates are valid before it is ready: one that takes long finds them one after the other."""
    ready_s, flags = v.fleet.ready_s, EKF_STARTING
    if ready_s > SLOW_S:
        share = seconds_between(v.clock.booted, v.now) / ready_s
        for at, found in ALIGNS:
            if share >= at:
                flags |= found
    return flags


def home_position(v: Autopilot) -> Message:
    """Return HOME_POSITION: the ground at the starting position."""
    start = v.config.start
    home = v.origin.from_ned(start.north_m, start.east_m, 0.0)
    return HomePosition(*home, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), time_usec=v.time_ns // 1000)


def mission_current(v: Autopilot) -> Message:
    """Return MISSION_CURRENT."""
    return v.missions.reported()


def extended_sys_state(v: Autopilot) -> Message:
    """Return EXTENDED_SYS_STATE: on the ground, in the air or, for a multirotor, taking off or landing."""
    return ExtendedSysState(m.MAV_VTOL_STATE_UNDEFINED, v.pilot.landed_state)


def autopilot_version(v: Autopilot) -> Message:
    """Return AUTOPILOT_VERSION, which tells ground stations the vehicle's capabilities."""
    return AutopilotVersion(v.capabilities, v.version)


def write_state(v: Autopilot, log: OnboardLog) -> None:
    """Write an armed vehicle's state to its own log, by its own clock."""
    if not v.pilot.condition.armed:
        return
    time_us, motion, estimate = v.time_ns // 1000, v.sensed, v.estimate
    lat, lon, alt = v.origin.from_ned(motion.north_m, motion.east_m, -motion.height_m)
    pitch = _asin(min(max(motion.climb_mps / max(motion.airspeed_mps, 1.0), -1.0), 1.0)) + estimate.pitch_error_rad
    attitude_rad = _bank(motion) + estimate.bank_error_rad, pitch, motion.heading_rad
    log.write_mode(time_us, int(v.pilot.mode))
    log.write_motion(time_us, attitude_rad, (lat, lon, alt, motion.height_m), _read(v, motion.airspeed_mps))
    if v.pilot.mode == v.guided_mode and not v.config.model.hovers:
        speed_mps, height_m = _read(v, motion.airspeed_setpoint_mps), motion.height_setpoint_m
        log.write_setpoint(time_us, speed_mps, motion.heading_setpoint_rad, height_m + v.origin.alt_m)


def _length(north: float, east: float) -> float:
    """Return a vector's length. Compiled, this is faster than `math.hypot`, which is a call into Python."""
    return math.sqrt(north * north + east * east)


def _bank(motion: Motion) -> float:
    return _atan(motion.turn_rate_radps * motion.airspeed_mps / GRAVITY_MPS2)


BUILDERS: Builders[Autopilot] = {
    m.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    m.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    m.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    m.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    m.MAVLINK_MSG_ID_ATTITUDE: attitude,
    m.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    m.MAVLINK_MSG_ID_MISSION_CURRENT: mission_current,
    m.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: nav_controller_output,
    m.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    m.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    m.MAVLINK_MSG_ID_WIND: wind,
    m.MAVLINK_MSG_ID_EKF_STATUS_REPORT: ekf_status_report,
    m.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
    m.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
}
"""All that an ArduPilot can send."""

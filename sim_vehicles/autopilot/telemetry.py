"""The messages with which emulated autopilots report their state, and when each is due; PX4's own: px4_services."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, NEVER, Instant
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
from sim_vehicles.autopilot.board_clock import LOOP_HZ
from sim_vehicles.autopilot.modes_and_failsafe import system_status

if TYPE_CHECKING:
    from sim_vehicles.airframe.motion import Motion
    from sim_vehicles.vehicle import Vehicle

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
SHORTEST_US: Final = 1e6 / LOOP_HZ
LONGEST_US: Final = 60e6
DEFAULT, STOP = 0.0, -1.0
_asin: Final = math.asin
_atan: Final = math.atan
_atan2: Final = math.atan2
"""Names of their own are found without a look into the module."""
GROUPS: dict[int, tuple[int, ...]] = {
    m.MAV_DATA_STREAM_EXTENDED_STATUS: (
        m.MAVLINK_MSG_ID_SYS_STATUS,
        m.MAVLINK_MSG_ID_GPS_RAW_INT,
        m.MAVLINK_MSG_ID_MISSION_CURRENT,
        m.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
    ),
    m.MAV_DATA_STREAM_POSITION: (m.MAVLINK_MSG_ID_LOCAL_POSITION_NED, m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT),
    m.MAV_DATA_STREAM_EXTRA1: (m.MAVLINK_MSG_ID_ATTITUDE,),
    m.MAV_DATA_STREAM_EXTRA2: (m.MAVLINK_MSG_ID_VFR_HUD,),
    m.MAV_DATA_STREAM_EXTRA3: (
        m.MAVLINK_MSG_ID_SYSTEM_TIME,
        m.MAVLINK_MSG_ID_BATTERY_STATUS,
        m.MAVLINK_MSG_ID_WIND,
        m.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
}
"""What REQUEST_DATA_STREAM's groups consist of (ArduPilot documentation, "SRn_ parameters")."""
STREAMED = tuple(message_id for group in GROUPS.values() for message_id in group)
UNASKED_NS: Final = NANOSECONDS
UNASKED: Final = dict.fromkeys((m.MAVLINK_MSG_ID_HEARTBEAT, *STREAMED), UNASKED_NS)
"""Messages that are streamed without a request, and every how many ns."""


def heartbeat(v: Vehicle) -> Message:
    """Return HEARTBEAT: its kind, its mode, whether it is armed."""
    flags = MODE_FLAGS if v.pilot.mode in v.by_hand else MODE_FLAGS | STEERS
    return Heartbeat(
        v.mav_type,
        ARDUPILOT,
        flags | ARMED if v.pilot.condition.armed else flags,
        int(v.pilot.mode),
        m.MAV_STATE_CRITICAL if v.failsafe.active else system_status(v.pilot.condition),
    )


def sys_status(v: Vehicle) -> Message:
    """Return SYS_STATUS; the pre-arm bit is healthy once the vehicle may be armed, as is the fence that it lacks."""
    working = SENSORS if v.estimate.received else SENSORS & ~RECEIVER
    healthy = working | FENCE | (PREARM_CHECK if v.ready else 0)
    known = SENSORS | PREARM_CHECK
    return SysStatus(known, known, healthy, LOAD_PERMILLE, BATTERY_V, BATTERY_A, BATTERY_PERCENT)


def battery_status(_: Vehicle) -> Message:
    """Return BATTERY_STATUS of the battery that SYS_STATUS reports; its cells are unknown."""
    return BatteryStatus(0, 0, 0, NO_TEMPERATURE, CELLS_V, BATTERY_A, NOT_COUNTED, NOT_COUNTED, BATTERY_PERCENT)


def system_time(v: Vehicle) -> Message:
    """Return SYSTEM_TIME: UTC as it knows it, and the time since boot."""
    return SystemTime(v.utc_us, v.time_s)


def gps_raw_int(v: Vehicle) -> Message:
    """Return GPS_RAW_INT: the receiver's own 3-D fix, or none where the vehicle has no receiver."""
    received = v.estimate.received
    if received is None:
        return GpsRawInt(v.time_ns // 1000, NO_FIX, 0.0, 0.0, 0.0, UNKNOWN_DOP, UNKNOWN_DOP, 0.0, 0.0, 0)
    lat, lon, alt = v.fleet.origin.from_ned(received.north_m, received.east_m, -received.height_m)
    north, east = received.velocity_north_mps, received.velocity_east_mps
    course = _atan2(east, north) % math.tau
    return GpsRawInt(v.time_ns // 1000, FIX, lat, lon, alt, HDOP, HDOP, _length(north, east), course, SATELLITES)


def attitude(v: Vehicle) -> Message:
    """Return ATTITUDE; bank and pitch follow from the turn rate and the climb rate, and are off as the estimate is."""
    motion, estimate = v.sensed, v.estimate
    pitch = _asin(min(max(motion.climb_mps / max(motion.airspeed_mps, 1.0), -1.0), 1.0)) + estimate.pitch_error_rad
    bank = _bank(motion) + estimate.bank_error_rad
    return Attitude(v.time_s, bank, pitch, signed(motion.heading_rad), 0.0, 0.0, motion.turn_rate_radps)


def local_position_ned(v: Vehicle) -> Message:
    """Return LOCAL_POSITION_NED, from home."""
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


def global_position_int(v: Vehicle) -> Message:
    """Return GLOBAL_POSITION_INT: place, heights above sea level and home, ground velocity, as sensed."""
    motion = v.sensed
    lat, lon, alt = v.fleet.origin.from_ned(motion.north_m, motion.east_m, -motion.height_m)
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


def nav_controller_output(v: Vehicle) -> Message:
    """Return NAV_CONTROLLER_OUTPUT: where its target is, and what it lacks of that."""
    motion = v.sensed
    bearing, distance, aside = v.pilot.to_go(motion)
    bearing = signed(bearing)
    high = motion.height_setpoint_m - motion.height_m
    fast = _read(v, motion.airspeed_setpoint_mps - motion.airspeed_mps)
    return NavControllerOutput(_bank(motion), 0.0, bearing, bearing, distance, high, fast, aside)


def _read(v: Vehicle, true_mps: float) -> float:
    """Return what its sensor reads at an airspeed."""
    pitot = v.body.pitot
    return true_mps if pitot is None else pitot.reading(true_mps, v.sensed.height_m)


def vfr_hud(v: Vehicle) -> Message:
    """Return VFR_HUD, which alone carries the airspeed."""
    motion = v.sensed
    speed = _length(motion.velocity_north_mps, motion.velocity_east_mps)
    altitude = v.fleet.origin.alt_m + motion.height_m
    heading = motion.heading_rad % math.tau
    throttle = CRUISE_THROTTLE_PERCENT if v.pilot.airborne else 0
    return VfrHud(_read(v, motion.airspeed_mps), speed, heading, throttle, altitude, -motion.velocity_down_mps)


def wind(v: Vehicle) -> Message:
    """Return WIND; its direction is where the wind comes from."""
    motion = v.sensed
    north, east, down = motion.drift_north_mps, motion.drift_east_mps, motion.drift_down_mps
    return Wind(signed(_atan2(-east, -north)), _length(north, east), down)


def ekf_status_report(v: Vehicle) -> Message:
    """Return EKF_STATUS_REPORT: what its estimate is good for, and how well it agrees with the sensors."""
    estimate = v.estimate
    flags, ratios = EKF_READY & ~estimate.unknown if v.ready else EKF_STARTING, estimate.ratios
    return EkfStatusReport(flags, ratios.velocity, ratios.horizontal, ratios.height, ratios.compass, 0.0)


def home_position(v: Vehicle) -> Message:
    """Return HOME_POSITION: the ground where it started."""
    start = v.config.start
    home = v.fleet.origin.from_ned(start.north_m, start.east_m, 0.0)
    return HomePosition(*home, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), time_usec=v.time_ns // 1000)


def mission_current(v: Vehicle) -> Message:
    """Return MISSION_CURRENT, as its missions have it."""
    return v.missions.reported()


def extended_sys_state(v: Vehicle) -> Message:
    """Return EXTENDED_SYS_STATE: whether it is on the ground, in the air or, of a multirotor, in between."""
    return ExtendedSysState(m.MAV_VTOL_STATE_UNDEFINED, v.pilot.landed_state)


def autopilot_version(v: Vehicle) -> Message:
    """Return AUTOPILOT_VERSION, by which ground stations tell what it can do."""
    return AutopilotVersion(v.capabilities, v.version)


def _length(north: float, east: float) -> float:
    """Return a vector's length. Compiled, `math.hypot`, which is exact, would be a call of Python's own."""
    return math.sqrt(north * north + east * east)


def _bank(motion: Motion) -> float:
    return _atan(motion.turn_rate_radps * motion.airspeed_mps / GRAVITY_MPS2)


Builders = Mapping[int, Callable[[Any], Message]]
"""Messages that a kind of vehicle can send, and what makes each."""
BUILDERS: Builders = {
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


class Stream:
    """One message that is sent again and again."""

    def __init__(self, message_id: int, build: Callable[[Any], Message], interval_ns: int) -> None:
        """Take its id, what makes it and its interval."""
        self.message_id = message_id
        self.build = build
        self.interval_ns: i64 = interval_ns


class Streams:
    """One vehicle's message intervals. A message is sent in the first cycle of the main loop at or after its time."""

    def __init__(self, now: Instant, unasked: Mapping[int, int], known: Builders) -> None:
        """Start with the messages that need no request, of those that are `known`."""
        self._unasked, self._known = unasked, known
        self._streams = [Stream(message_id, known[message_id], unasked[message_id]) for message_id in sorted(unasked)]
        """In the order of their ids, in which those of a cycle are sent."""
        self._due = vec[i64]([now] * len(self._streams))
        """When each is due next, side by side: most cycles look at nothing else."""
        self.next_due = now
        """When the next message is due; `NEVER` when none is."""
        self._place: i64 = 0
        """Where to go on looking for those that are due in this cycle."""
        self._plan()

    def set_interval(self, message_id: int, interval_us: float, now: Instant) -> bool:
        """Set an interval, 0 for the default one, -1 for never; return False for one shorter than the main loop's.

        Source: MAVLink, MAV_CMD_SET_MESSAGE_INTERVAL.
        """
        if interval_us == DEFAULT:
            self._set(message_id, self._unasked.get(message_id), now)
        elif interval_us == STOP:
            self._set(message_id, None, now)
        elif interval_us >= SHORTEST_US:
            self._set(message_id, round(min(interval_us, LONGEST_US) * 1e3), now)
        else:
            return False
        return True

    def set_group(self, group: int, rate_hz: int, now: Instant) -> None:
        """Set the rate of a group of messages: 0 stops them."""
        members = STREAMED if group == m.MAV_DATA_STREAM_ALL else GROUPS.get(group, ())
        for message_id in members:
            self._set(message_id, NANOSECONDS // min(rate_hz, LOOP_HZ) if rate_hz else None, now)

    def interval_us(self, message_id: int) -> int:
        """Return an interval, -1 for a message that isn't streamed."""
        for each in self._streams:
            if each.message_id == message_id:
                return each.interval_ns // 1000
        return int(STOP)

    def leave_out(self, now: Instant) -> None:
        """Skip messages that were due before now."""
        self._due = vec[i64]([max(due, now) for due in self._due])
        self._plan()

    def send_next(self, vehicle: Vehicle, now: Instant) -> bool:
        """Have their vehicle send the next message that is due, in order; return whether there is another.

        When there is none, the next ones are planned.
        """
        at: i64 = now
        place = self._due_from(self._place, at)
        if place < len(self._due):
            stream = self._streams[place]
            vehicle.link.broadcast(stream.build(vehicle), now)
            self._due[place] = self._due[place] + stream.interval_ns
            self._place = self._due_from(place + 1, at)
            if self._place < len(self._due):
                return True
        self._place = 0
        self._plan()
        return False

    def _due_from(self, place: i64, at: i64) -> i64:
        """Return the first message from a place on that is due at an instant; their number if there is none."""
        while place < len(self._due) and self._due[place] > at:
            place += 1
        return place

    def _set(self, message_id: int, interval_ns: int | None, now: Instant) -> None:
        known, planned = message_id in self._known, list(zip(self._streams, self._due, strict=True))
        if interval_ns is None or known:
            planned = [each for each in planned if each[0].message_id != message_id]
        if interval_ns is not None and known:
            planned.append((Stream(message_id, self._known[message_id], interval_ns), now))
            planned.sort(key=_number)
        self._streams, self._due = [stream for stream, _ in planned], vec[i64]([due for _, due in planned])
        self._plan()

    def _plan(self) -> None:
        next_due: i64 = NEVER
        for due in self._due:
            next_due = min(next_due, due)
        self.next_due = Instant(next_due)


def _number(planned: tuple[Stream, int]) -> int:
    return planned[0].message_id

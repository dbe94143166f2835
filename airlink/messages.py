"""The MAVLink messages that we speak, typed and in SI units.

A class is the message of the same name; its fields are the XML's, in the XML's order, each with the SI
unit in its name (ms become seconds, degE7 and cdeg radians, mm metres, cm/s metres a second). Trailing
fields that nobody here needs are left out: they are sent as 0. Integers of 64 bits and intervals in
microseconds stay integers, in the unit that their name says. Unknown (the largest value of a 16-bit
field with a unit) is NaN.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from airlink.mission_messages import MissionMessage


class Heartbeat(NamedTuple):
    """HEARTBEAT (0): a system is there, of this type and in this mode."""

    type: int
    autopilot: int
    base_mode: int = 0
    custom_mode: int = 0
    system_status: int = 0
    mavlink_version: int = 3


class SysStatus(NamedTuple):
    """SYS_STATUS (1): sensors present, enabled and healthy (bits of MAV_SYS_STATUS_SENSOR), battery."""

    onboard_control_sensors_present: int
    onboard_control_sensors_enabled: int
    onboard_control_sensors_health: int
    load: int = 0
    voltage_battery_v: float = math.nan
    current_battery_a: float = 0.0
    battery_remaining: int = -1


class SystemTime(NamedTuple):
    """SYSTEM_TIME (2): the system's wall clock and its time since boot."""

    time_unix_usec: int
    time_boot_s: float


class Ping(NamedTuple):
    """PING (4): a request (targets 0) or its answer."""

    time_usec: int
    seq: int
    target_system: int = 0
    target_component: int = 0


class SetMode(NamedTuple):
    """SET_MODE (11): the message that came before MAV_CMD_DO_SET_MODE, still sent by ground stations."""

    target_system: int
    base_mode: int
    custom_mode: int


class ParamRequestRead(NamedTuple):
    """PARAM_REQUEST_READ (20): one parameter, by name or, where index isn't -1, by index."""

    target_system: int
    target_component: int
    param_id: str
    param_index: int = -1


class ParamRequestList(NamedTuple):
    """PARAM_REQUEST_LIST (21): all parameters."""

    target_system: int
    target_component: int


class ParamValue(NamedTuple):
    """PARAM_VALUE (22): a parameter's value, as a float whatever its type."""

    param_id: str
    param_value: float
    param_type: int
    param_count: int
    param_index: int


class ParamSet(NamedTuple):
    """PARAM_SET (23): change a parameter."""

    target_system: int
    target_component: int
    param_id: str
    param_value: float
    param_type: int


class GpsRawInt(NamedTuple):
    """GPS_RAW_INT (24): the receiver's fix."""

    time_usec: int
    fix_type: int
    lat_rad: float
    lon_rad: float
    alt_m: float
    eph: int
    epv: int
    vel_mps: float
    cog_rad: float
    satellites_visible: int


class Attitude(NamedTuple):
    """ATTITUDE (30): roll, pitch, yaw and the body's rates."""

    time_boot_s: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    rollspeed_radps: float
    pitchspeed_radps: float
    yawspeed_radps: float


class LocalPositionNed(NamedTuple):
    """LOCAL_POSITION_NED (32): position and ground velocity from the estimator's origin, NED."""

    time_boot_s: float
    x_m: float
    y_m: float
    z_m: float
    vx_mps: float
    vy_mps: float
    vz_mps: float


class GlobalPositionInt(NamedTuple):
    """GLOBAL_POSITION_INT (33): filtered position, height above sea level and home, NED ground velocity."""

    time_boot_s: float
    lat_rad: float
    lon_rad: float
    alt_m: float
    relative_alt_m: float
    vx_mps: float
    vy_mps: float
    vz_mps: float
    hdg_rad: float


class GpsGlobalOrigin(NamedTuple):
    """GPS_GLOBAL_ORIGIN (49): where the local frame's origin lies."""

    latitude_rad: float
    longitude_rad: float
    altitude_m: float
    time_usec: int = 0


class NavControllerOutput(NamedTuple):
    """NAV_CONTROLLER_OUTPUT (62): what the fixed-wing navigation controllers ask for."""

    nav_roll_rad: float
    nav_pitch_rad: float
    nav_bearing_rad: float
    target_bearing_rad: float
    wp_dist_m: float
    alt_error_m: float
    aspd_error_mps: float
    xtrack_error_m: float


class RequestDataStream(NamedTuple):
    """REQUEST_DATA_STREAM (66): the old way to ask for groups of messages at a rate."""

    target_system: int
    target_component: int
    req_stream_id: int
    req_message_rate: int
    start_stop: int


class VfrHud(NamedTuple):
    """VFR_HUD (74): airspeed, ground speed, compass heading, height above sea level, climb rate."""

    airspeed_mps: float
    groundspeed_mps: float
    heading_rad: float
    throttle: int
    alt_m: float
    climb_mps: float


class CommandInt(NamedTuple):
    """COMMAND_INT (75): a command with a position as scaled integers; units are the command's own."""

    target_system: int
    target_component: int
    frame: int
    command: int
    current: int = 0
    autocontinue: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0


class CommandLong(NamedTuple):
    """COMMAND_LONG (76): a command with seven float parameters; units are the command's own."""

    target_system: int
    target_component: int
    command: int
    confirmation: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    param6: float = 0.0
    param7: float = 0.0


class CommandAck(NamedTuple):
    """COMMAND_ACK (77): what became of a command (MAV_RESULT), to whom."""

    command: int
    result: int
    progress: int = 0
    result_param2: int = 0
    target_system: int = 0
    target_component: int = 0


class SetPositionTargetLocalNed(NamedTuple):
    """SET_POSITION_TARGET_LOCAL_NED (84): a setpoint for multirotors, NED; bits of type_mask are ignored."""

    time_boot_s: float
    target_system: int
    target_component: int
    coordinate_frame: int
    type_mask: int
    x_m: float
    y_m: float
    z_m: float
    vx_mps: float
    vy_mps: float
    vz_mps: float
    afx_mps2: float
    afy_mps2: float
    afz_mps2: float
    yaw_rad: float
    yaw_rate_radps: float


class Timesync(NamedTuple):
    """TIMESYNC (111): tc1 = 0 asks, an answer has the answerer's time in tc1 and echoes ts1."""

    tc1_ns: int
    ts1_ns: int


class FileTransferProtocol(NamedTuple):
    """FILE_TRANSFER_PROTOCOL (110): one packet of MAVLink FTP, as bytes."""

    target_network: int
    target_system: int
    target_component: int
    payload: tuple[int, ...]


class BatteryStatus(NamedTuple):
    """BATTERY_STATUS (147): one battery; voltages of its cells, or of the whole in the first place, NaN for none."""

    id: int
    battery_function: int
    type: int
    temperature: int
    voltages_v: tuple[float, ...]
    current_battery_a: float
    current_consumed: int
    energy_consumed: int
    battery_remaining: int


class AutopilotVersion(NamedTuple):
    """AUTOPILOT_VERSION (148): capabilities (MAV_PROTOCOL_CAPABILITY) and the firmware's version."""

    capabilities: int
    flight_sw_version: int
    middleware_sw_version: int = 0
    os_sw_version: int = 0
    board_version: int = 0


class Wind(NamedTuple):
    """WIND (168): the autopilot's estimate: where the wind comes from, its speed, its speed down."""

    direction_rad: float
    speed_mps: float
    speed_z_mps: float


class EkfStatusReport(NamedTuple):
    """EKF_STATUS_REPORT (193): what the estimator vouches for (bits of EKF_STATUS_FLAGS)."""

    flags: int
    velocity_variance: float
    pos_horiz_variance: float
    pos_vert_variance: float
    compass_variance: float
    terrain_alt_variance: float
    airspeed_variance: float = 0.0


class HomePosition(NamedTuple):
    """HOME_POSITION (242): where home is."""

    latitude_rad: float
    longitude_rad: float
    altitude_m: float
    x_m: float
    y_m: float
    z_m: float
    q: tuple[float, ...]
    approach_x_m: float = 0.0
    approach_y_m: float = 0.0
    approach_z_m: float = 0.0
    time_usec: int = 0


class MessageInterval(NamedTuple):
    """MESSAGE_INTERVAL (244): how often a message comes; 0 unavailable, -1 not sent."""

    message_id: int
    interval_us: int


class ExtendedSysState(NamedTuple):
    """EXTENDED_SYS_STATE (245): on the ground or in the air (MAV_LANDED_STATE)."""

    vtol_state: int
    landed_state: int


class NamedValueFloat(NamedTuple):
    """NAMED_VALUE_FLOAT (251): a value for the other end's log."""

    time_boot_s: float
    name: str
    value: float


class Statustext(NamedTuple):
    """STATUSTEXT (253): words for a person; chunks of one text share a non-zero id."""

    severity: int
    text: str
    id: int = 0
    chunk_seq: int = 0


Message = (
    Heartbeat
    | SysStatus
    | SystemTime
    | Ping
    | SetMode
    | ParamRequestRead
    | ParamRequestList
    | ParamValue
    | ParamSet
    | GpsRawInt
    | Attitude
    | LocalPositionNed
    | GlobalPositionInt
    | MissionMessage
    | GpsGlobalOrigin
    | NavControllerOutput
    | RequestDataStream
    | VfrHud
    | CommandInt
    | CommandLong
    | CommandAck
    | SetPositionTargetLocalNed
    | Timesync
    | FileTransferProtocol
    | BatteryStatus
    | AutopilotVersion
    | Wind
    | EkfStatusReport
    | HomePosition
    | MessageInterval
    | ExtendedSysState
    | NamedValueFloat
    | Statustext
)

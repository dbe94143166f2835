"""Messages in which a vehicle reports its state."""

import math
from typing import NamedTuple


class SysStatus(NamedTuple):
    """SYS_STATUS (1): sensors present, enabled and healthy (bits of MAV_SYS_STATUS_SENSOR), and the battery."""

    onboard_control_sensors_present: int
    onboard_control_sensors_enabled: int
    onboard_control_sensors_health: int
    load: int = 0
    voltage_battery_v: float = math.nan
    current_battery_a: float = 0.0
    battery_remaining: int = -1


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


class NavControllerOutput(NamedTuple):
    """NAV_CONTROLLER_OUTPUT (62): the setpoints and errors of the fixed-wing navigation controllers."""

    nav_roll_rad: float
    nav_pitch_rad: float
    nav_bearing_rad: float
    target_bearing_rad: float
    wp_dist_m: float
    alt_error_m: float
    aspd_error_mps: float
    xtrack_error_m: float


class VfrHud(NamedTuple):
    """VFR_HUD (74): airspeed, ground speed, compass heading, height above sea level, climb rate."""

    airspeed_mps: float
    groundspeed_mps: float
    heading_rad: float
    throttle: int
    alt_m: float
    climb_mps: float


class BatteryStatus(NamedTuple):
    """BATTERY_STATUS (147): one battery; its cells' voltages, or its total in the first element, NaN for the rest."""

    id: int
    battery_function: int
    type: int
    temperature: int
    voltages_v: tuple[float, ...]
    current_battery_a: float
    current_consumed: int
    energy_consumed: int
    battery_remaining: int


class Wind(NamedTuple):
    """WIND (168): the autopilot's wind estimate: the direction it comes from, its speed, its downward speed."""

    direction_rad: float
    speed_mps: float
    speed_z_mps: float


class EkfStatusReport(NamedTuple):
    """EKF_STATUS_REPORT (193): which estimates are good (bits of EKF_STATUS_FLAGS), and their variances."""

    flags: int
    velocity_variance: float
    pos_horiz_variance: float
    pos_vert_variance: float
    compass_variance: float
    terrain_alt_variance: float
    airspeed_variance: float = 0.0


class HomePosition(NamedTuple):
    """HOME_POSITION (242): the home position."""

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


class ExtendedSysState(NamedTuple):
    """EXTENDED_SYS_STATE (245): on the ground or in the air (MAV_LANDED_STATE)."""

    vtol_state: int
    landed_state: int


TelemetryMessage = (
    SysStatus
    | GpsRawInt
    | Attitude
    | LocalPositionNed
    | GlobalPositionInt
    | NavControllerOutput
    | VfrHud
    | BatteryStatus
    | Wind
    | EkfStatusReport
    | HomePosition
    | ExtendedSysState
)

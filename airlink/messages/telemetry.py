"""Messages in which a vehicle reports its state."""

# Written by: python -m tests.airlink.generate_messages
# A class for each message of the service, all after one plan: not edited here.

from __future__ import annotations

import math
from typing import Final

from librt.strings import BytesWriter
from mypy_extensions import i64, mypyc_attr

from airlink.messages.payload import (
    CDEG,
    CENTI,
    DEG,
    DEGE7,
    MILLI,
    PER_CDEG,
    PER_CENTI,
    PER_DEG,
    PER_DEGE7,
    PER_MILLI,
    Kind,
    Message,
    get_f32,
    get_f32s,
    get_i8,
    get_i16,
    get_i32,
    get_knowns,
    get_u8,
    get_u16,
    get_u32,
    get_u64,
    known,
    put_f32,
    put_f32s,
    put_i8,
    put_i16,
    put_i32,
    put_knowns,
    put_near_i16,
    put_near_i32,
    put_near_u16,
    put_near_u32,
    put_u8,
    put_u16,
    put_u32,
    put_u64,
    put_zeros,
)


@mypyc_attr(acyclic=True, free_list_len=1)
class SysStatus(Message):
    """SYS_STATUS (1): sensors present, enabled and healthy (bits of MAV_SYS_STATUS_SENSOR), and the battery."""

    def __init__(
        self,
        onboard_control_sensors_present: int,
        onboard_control_sensors_enabled: int,
        onboard_control_sensors_health: int,
        load: int = 0,
        voltage_battery_v: float = math.nan,
        current_battery_a: float = 0.0,
        battery_remaining: int = -1,
    ) -> None:
        self.onboard_control_sensors_present = onboard_control_sensors_present
        self.onboard_control_sensors_enabled = onboard_control_sensors_enabled
        self.onboard_control_sensors_health = onboard_control_sensors_health
        self.load = load
        self.voltage_battery_v = voltage_battery_v
        self.current_battery_a = current_battery_a
        self.battery_remaining = battery_remaining

    def kind(self) -> Kind:
        return SYS_STATUS

    def write(self, payload: BytesWriter) -> None:
        put_u32(payload, self.onboard_control_sensors_present)
        put_u32(payload, self.onboard_control_sensors_enabled)
        put_u32(payload, self.onboard_control_sensors_health)
        put_u16(payload, self.load)
        put_near_u16(payload, self.voltage_battery_v * PER_MILLI)
        put_near_i16(payload, self.current_battery_a * PER_CENTI)
        put_zeros(payload, 12)
        put_i8(payload, self.battery_remaining)
        put_zeros(payload, 12)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return SysStatus(
            get_u32(frame, begin, end),
            get_u32(frame, begin + 4, end),
            get_u32(frame, begin + 8, end),
            get_u16(frame, begin + 12, end),
            known(get_u16(frame, begin + 14, end)) * MILLI,
            get_i16(frame, begin + 16, end) * CENTI,
            get_i8(frame, begin + 30, end),
        )


SYS_STATUS: Final = Kind(
    "SYS_STATUS",
    1,
    124,
    (31, 43),
    (
        "onboard_control_sensors_present",
        "onboard_control_sensors_enabled",
        "onboard_control_sensors_health",
        "load",
        "voltage_battery_v",
        "current_battery_a",
        "battery_remaining",
    ),
    SysStatus(0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class GpsRawInt(Message):
    """GPS_RAW_INT (24): the receiver's fix."""

    def __init__(
        self,
        time_usec: int,
        fix_type: int,
        lat_rad: float,
        lon_rad: float,
        alt_m: float,
        eph: int,
        epv: int,
        vel_mps: float,
        cog_rad: float,
        satellites_visible: int,
    ) -> None:
        self.time_usec = time_usec
        self.fix_type = fix_type
        self.lat_rad = lat_rad
        self.lon_rad = lon_rad
        self.alt_m = alt_m
        self.eph = eph
        self.epv = epv
        self.vel_mps = vel_mps
        self.cog_rad = cog_rad
        self.satellites_visible = satellites_visible

    def kind(self) -> Kind:
        return GPS_RAW_INT

    def write(self, payload: BytesWriter) -> None:
        put_u64(payload, self.time_usec)
        put_near_i32(payload, self.lat_rad * PER_DEGE7)
        put_near_i32(payload, self.lon_rad * PER_DEGE7)
        put_near_i32(payload, self.alt_m * PER_MILLI)
        put_u16(payload, self.eph)
        put_u16(payload, self.epv)
        put_near_u16(payload, self.vel_mps * PER_CENTI)
        put_near_u16(payload, self.cog_rad * PER_CDEG)
        put_u8(payload, self.fix_type)
        put_u8(payload, self.satellites_visible)
        put_zeros(payload, 22)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return GpsRawInt(
            get_u64(frame, begin, end),
            get_u8(frame, begin + 28, end),
            get_i32(frame, begin + 8, end) * DEGE7,
            get_i32(frame, begin + 12, end) * DEGE7,
            get_i32(frame, begin + 16, end) * MILLI,
            get_u16(frame, begin + 20, end),
            get_u16(frame, begin + 22, end),
            known(get_u16(frame, begin + 24, end)) * CENTI,
            known(get_u16(frame, begin + 26, end)) * CDEG,
            get_u8(frame, begin + 29, end),
        )


GPS_RAW_INT: Final = Kind(
    "GPS_RAW_INT",
    24,
    24,
    (30, 52),
    ("time_usec", "fix_type", "lat_rad", "lon_rad", "alt_m", "eph", "epv", "vel_mps", "cog_rad", "satellites_visible"),
    GpsRawInt(0, 0, 0.0, 0.0, 0.0, 0, 0, 0.0, 0.0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class Attitude(Message):
    """ATTITUDE (30): roll, pitch, yaw and the body's rates."""

    def __init__(
        self,
        time_boot_s: float,
        roll_rad: float,
        pitch_rad: float,
        yaw_rad: float,
        rollspeed_radps: float,
        pitchspeed_radps: float,
        yawspeed_radps: float,
    ) -> None:
        self.time_boot_s = time_boot_s
        self.roll_rad = roll_rad
        self.pitch_rad = pitch_rad
        self.yaw_rad = yaw_rad
        self.rollspeed_radps = rollspeed_radps
        self.pitchspeed_radps = pitchspeed_radps
        self.yawspeed_radps = yawspeed_radps

    def kind(self) -> Kind:
        return ATTITUDE

    def write(self, payload: BytesWriter) -> None:
        put_near_u32(payload, self.time_boot_s * PER_MILLI)
        put_f32(payload, self.roll_rad)
        put_f32(payload, self.pitch_rad)
        put_f32(payload, self.yaw_rad)
        put_f32(payload, self.rollspeed_radps)
        put_f32(payload, self.pitchspeed_radps)
        put_f32(payload, self.yawspeed_radps)

    def boot_s(self) -> float:
        return self.time_boot_s

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return Attitude(
            get_u32(frame, begin, end) * MILLI,
            get_f32(frame, begin + 4, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
            get_f32(frame, begin + 20, end),
            get_f32(frame, begin + 24, end),
        )


ATTITUDE: Final = Kind(
    "ATTITUDE",
    30,
    39,
    (28, 28),
    ("time_boot_s", "roll_rad", "pitch_rad", "yaw_rad", "rollspeed_radps", "pitchspeed_radps", "yawspeed_radps"),
    Attitude(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class LocalPositionNed(Message):
    """LOCAL_POSITION_NED (32): position and ground velocity from the estimator's origin, NED."""

    def __init__(
        self, time_boot_s: float, x_m: float, y_m: float, z_m: float, vx_mps: float, vy_mps: float, vz_mps: float
    ) -> None:
        self.time_boot_s = time_boot_s
        self.x_m = x_m
        self.y_m = y_m
        self.z_m = z_m
        self.vx_mps = vx_mps
        self.vy_mps = vy_mps
        self.vz_mps = vz_mps

    def kind(self) -> Kind:
        return LOCAL_POSITION_NED

    def write(self, payload: BytesWriter) -> None:
        put_near_u32(payload, self.time_boot_s * PER_MILLI)
        put_f32(payload, self.x_m)
        put_f32(payload, self.y_m)
        put_f32(payload, self.z_m)
        put_f32(payload, self.vx_mps)
        put_f32(payload, self.vy_mps)
        put_f32(payload, self.vz_mps)

    def boot_s(self) -> float:
        return self.time_boot_s

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return LocalPositionNed(
            get_u32(frame, begin, end) * MILLI,
            get_f32(frame, begin + 4, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
            get_f32(frame, begin + 20, end),
            get_f32(frame, begin + 24, end),
        )


LOCAL_POSITION_NED: Final = Kind(
    "LOCAL_POSITION_NED",
    32,
    185,
    (28, 28),
    ("time_boot_s", "x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps"),
    LocalPositionNed(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class GlobalPositionInt(Message):
    """GLOBAL_POSITION_INT (33): filtered position, height above sea level and home, NED ground velocity."""

    def __init__(
        self,
        time_boot_s: float,
        lat_rad: float,
        lon_rad: float,
        alt_m: float,
        relative_alt_m: float,
        vx_mps: float,
        vy_mps: float,
        vz_mps: float,
        hdg_rad: float,
    ) -> None:
        self.time_boot_s = time_boot_s
        self.lat_rad = lat_rad
        self.lon_rad = lon_rad
        self.alt_m = alt_m
        self.relative_alt_m = relative_alt_m
        self.vx_mps = vx_mps
        self.vy_mps = vy_mps
        self.vz_mps = vz_mps
        self.hdg_rad = hdg_rad

    def kind(self) -> Kind:
        return GLOBAL_POSITION_INT

    def write(self, payload: BytesWriter) -> None:
        put_near_u32(payload, self.time_boot_s * PER_MILLI)
        put_near_i32(payload, self.lat_rad * PER_DEGE7)
        put_near_i32(payload, self.lon_rad * PER_DEGE7)
        put_near_i32(payload, self.alt_m * PER_MILLI)
        put_near_i32(payload, self.relative_alt_m * PER_MILLI)
        put_near_i16(payload, self.vx_mps * PER_CENTI)
        put_near_i16(payload, self.vy_mps * PER_CENTI)
        put_near_i16(payload, self.vz_mps * PER_CENTI)
        put_near_u16(payload, self.hdg_rad * PER_CDEG)

    def boot_s(self) -> float:
        return self.time_boot_s

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return GlobalPositionInt(
            get_u32(frame, begin, end) * MILLI,
            get_i32(frame, begin + 4, end) * DEGE7,
            get_i32(frame, begin + 8, end) * DEGE7,
            get_i32(frame, begin + 12, end) * MILLI,
            get_i32(frame, begin + 16, end) * MILLI,
            get_i16(frame, begin + 20, end) * CENTI,
            get_i16(frame, begin + 22, end) * CENTI,
            get_i16(frame, begin + 24, end) * CENTI,
            known(get_u16(frame, begin + 26, end)) * CDEG,
        )


GLOBAL_POSITION_INT: Final = Kind(
    "GLOBAL_POSITION_INT",
    33,
    104,
    (28, 28),
    ("time_boot_s", "lat_rad", "lon_rad", "alt_m", "relative_alt_m", "vx_mps", "vy_mps", "vz_mps", "hdg_rad"),
    GlobalPositionInt(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class NavControllerOutput(Message):
    """NAV_CONTROLLER_OUTPUT (62): the setpoints and errors of the fixed-wing navigation controllers."""

    def __init__(
        self,
        nav_roll_rad: float,
        nav_pitch_rad: float,
        nav_bearing_rad: float,
        target_bearing_rad: float,
        wp_dist_m: float,
        alt_error_m: float,
        aspd_error_mps: float,
        xtrack_error_m: float,
    ) -> None:
        self.nav_roll_rad = nav_roll_rad
        self.nav_pitch_rad = nav_pitch_rad
        self.nav_bearing_rad = nav_bearing_rad
        self.target_bearing_rad = target_bearing_rad
        self.wp_dist_m = wp_dist_m
        self.alt_error_m = alt_error_m
        self.aspd_error_mps = aspd_error_mps
        self.xtrack_error_m = xtrack_error_m

    def kind(self) -> Kind:
        return NAV_CONTROLLER_OUTPUT

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.nav_roll_rad * PER_DEG)
        put_f32(payload, self.nav_pitch_rad * PER_DEG)
        put_f32(payload, self.alt_error_m)
        put_f32(payload, self.aspd_error_mps)
        put_f32(payload, self.xtrack_error_m)
        put_near_i16(payload, self.nav_bearing_rad * PER_DEG)
        put_near_i16(payload, self.target_bearing_rad * PER_DEG)
        put_near_u16(payload, self.wp_dist_m)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return NavControllerOutput(
            get_f32(frame, begin, end) * DEG,
            get_f32(frame, begin + 4, end) * DEG,
            get_i16(frame, begin + 20, end) * DEG,
            get_i16(frame, begin + 22, end) * DEG,
            known(get_u16(frame, begin + 24, end)) * 1.0,
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
        )


NAV_CONTROLLER_OUTPUT: Final = Kind(
    "NAV_CONTROLLER_OUTPUT",
    62,
    183,
    (26, 26),
    (
        "nav_roll_rad",
        "nav_pitch_rad",
        "nav_bearing_rad",
        "target_bearing_rad",
        "wp_dist_m",
        "alt_error_m",
        "aspd_error_mps",
        "xtrack_error_m",
    ),
    NavControllerOutput(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class VfrHud(Message):
    """VFR_HUD (74): airspeed, ground speed, compass heading, height above sea level, climb rate."""

    def __init__(
        self,
        airspeed_mps: float,
        groundspeed_mps: float,
        heading_rad: float,
        throttle: int,
        alt_m: float,
        climb_mps: float,
    ) -> None:
        self.airspeed_mps = airspeed_mps
        self.groundspeed_mps = groundspeed_mps
        self.heading_rad = heading_rad
        self.throttle = throttle
        self.alt_m = alt_m
        self.climb_mps = climb_mps

    def kind(self) -> Kind:
        return VFR_HUD

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.airspeed_mps)
        put_f32(payload, self.groundspeed_mps)
        put_f32(payload, self.alt_m)
        put_f32(payload, self.climb_mps)
        put_near_i16(payload, self.heading_rad * PER_DEG)
        put_u16(payload, self.throttle)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return VfrHud(
            get_f32(frame, begin, end),
            get_f32(frame, begin + 4, end),
            get_i16(frame, begin + 16, end) * DEG,
            get_u16(frame, begin + 18, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
        )


VFR_HUD: Final = Kind(
    "VFR_HUD",
    74,
    20,
    (20, 20),
    ("airspeed_mps", "groundspeed_mps", "heading_rad", "throttle", "alt_m", "climb_mps"),
    VfrHud(0.0, 0.0, 0.0, 0, 0.0, 0.0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class BatteryStatus(Message):
    """BATTERY_STATUS (147): one battery; its cells' voltages, or its total in the first element, NaN for the rest."""

    def __init__(
        self,
        id: int,
        battery_function: int,
        type: int,
        temperature: int,
        voltages_v: tuple[float, ...],
        current_battery_a: float,
        current_consumed: int,
        energy_consumed: int,
        battery_remaining: int,
        time_remaining: int = 0,
    ) -> None:
        self.id = id
        self.battery_function = battery_function
        self.type = type
        self.temperature = temperature
        self.voltages_v = voltages_v
        self.current_battery_a = current_battery_a
        self.current_consumed = current_consumed
        self.energy_consumed = energy_consumed
        self.battery_remaining = battery_remaining
        self.time_remaining = time_remaining

    def kind(self) -> Kind:
        return BATTERY_STATUS

    def write(self, payload: BytesWriter) -> None:
        put_i32(payload, self.current_consumed)
        put_i32(payload, self.energy_consumed)
        put_i16(payload, self.temperature)
        put_knowns(payload, self.voltages_v, 10, PER_MILLI)
        put_near_i16(payload, self.current_battery_a * PER_CENTI)
        put_u8(payload, self.id)
        put_u8(payload, self.battery_function)
        put_u8(payload, self.type)
        put_i8(payload, self.battery_remaining)
        put_i32(payload, self.time_remaining)
        put_zeros(payload, 14)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return BatteryStatus(
            get_u8(frame, begin + 32, end),
            get_u8(frame, begin + 33, end),
            get_u8(frame, begin + 34, end),
            get_i16(frame, begin + 8, end),
            get_knowns(frame, begin + 10, end, 10, MILLI),
            get_i16(frame, begin + 30, end) * CENTI,
            get_i32(frame, begin, end),
            get_i32(frame, begin + 4, end),
            get_i8(frame, begin + 35, end),
            get_i32(frame, begin + 36, end),
        )


BATTERY_STATUS: Final = Kind(
    "BATTERY_STATUS",
    147,
    154,
    (36, 54),
    (
        "id",
        "battery_function",
        "type",
        "temperature",
        "voltages_v",
        "current_battery_a",
        "current_consumed",
        "energy_consumed",
        "battery_remaining",
        "time_remaining",
    ),
    BatteryStatus(0, 0, 0, 0, (), 0.0, 0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class Wind(Message):
    """WIND (168): the autopilot's wind estimate: the direction it comes from, its speed, its downward speed."""

    def __init__(self, direction_rad: float, speed_mps: float, speed_z_mps: float) -> None:
        self.direction_rad = direction_rad
        self.speed_mps = speed_mps
        self.speed_z_mps = speed_z_mps

    def kind(self) -> Kind:
        return WIND

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.direction_rad * PER_DEG)
        put_f32(payload, self.speed_mps)
        put_f32(payload, self.speed_z_mps)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return Wind(get_f32(frame, begin, end) * DEG, get_f32(frame, begin + 4, end), get_f32(frame, begin + 8, end))


WIND: Final = Kind("WIND", 168, 1, (12, 12), ("direction_rad", "speed_mps", "speed_z_mps"), Wind(0.0, 0.0, 0.0))


@mypyc_attr(acyclic=True, free_list_len=1)
class EkfStatusReport(Message):
    """EKF_STATUS_REPORT (193): which estimates are good (bits of EKF_STATUS_FLAGS), and their variances."""

    def __init__(
        self,
        flags: int,
        velocity_variance: float,
        pos_horiz_variance: float,
        pos_vert_variance: float,
        compass_variance: float,
        terrain_alt_variance: float,
        airspeed_variance: float = 0.0,
    ) -> None:
        self.flags = flags
        self.velocity_variance = velocity_variance
        self.pos_horiz_variance = pos_horiz_variance
        self.pos_vert_variance = pos_vert_variance
        self.compass_variance = compass_variance
        self.terrain_alt_variance = terrain_alt_variance
        self.airspeed_variance = airspeed_variance

    def kind(self) -> Kind:
        return EKF_STATUS_REPORT

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.velocity_variance)
        put_f32(payload, self.pos_horiz_variance)
        put_f32(payload, self.pos_vert_variance)
        put_f32(payload, self.compass_variance)
        put_f32(payload, self.terrain_alt_variance)
        put_u16(payload, self.flags)
        put_f32(payload, self.airspeed_variance)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return EkfStatusReport(
            get_u16(frame, begin + 20, end),
            get_f32(frame, begin, end),
            get_f32(frame, begin + 4, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
            get_f32(frame, begin + 22, end),
        )


EKF_STATUS_REPORT: Final = Kind(
    "EKF_STATUS_REPORT",
    193,
    71,
    (22, 26),
    (
        "flags",
        "velocity_variance",
        "pos_horiz_variance",
        "pos_vert_variance",
        "compass_variance",
        "terrain_alt_variance",
        "airspeed_variance",
    ),
    EkfStatusReport(0, 0.0, 0.0, 0.0, 0.0, 0.0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class EstimatorStatus(Message):
    """ESTIMATOR_STATUS (230): which estimates are good, and innovations as shares of their gates."""

    def __init__(
        self,
        time_usec: int,
        flags: int,
        vel_ratio: float,
        pos_horiz_ratio: float,
        pos_vert_ratio: float,
        mag_ratio: float,
        hagl_ratio: float,
        tas_ratio: float,
        pos_horiz_accuracy_m: float,
        pos_vert_accuracy_m: float,
    ) -> None:
        self.time_usec = time_usec
        self.flags = flags
        self.vel_ratio = vel_ratio
        self.pos_horiz_ratio = pos_horiz_ratio
        self.pos_vert_ratio = pos_vert_ratio
        self.mag_ratio = mag_ratio
        self.hagl_ratio = hagl_ratio
        self.tas_ratio = tas_ratio
        self.pos_horiz_accuracy_m = pos_horiz_accuracy_m
        self.pos_vert_accuracy_m = pos_vert_accuracy_m

    def kind(self) -> Kind:
        return ESTIMATOR_STATUS

    def write(self, payload: BytesWriter) -> None:
        put_u64(payload, self.time_usec)
        put_f32(payload, self.vel_ratio)
        put_f32(payload, self.pos_horiz_ratio)
        put_f32(payload, self.pos_vert_ratio)
        put_f32(payload, self.mag_ratio)
        put_f32(payload, self.hagl_ratio)
        put_f32(payload, self.tas_ratio)
        put_f32(payload, self.pos_horiz_accuracy_m)
        put_f32(payload, self.pos_vert_accuracy_m)
        put_u16(payload, self.flags)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return EstimatorStatus(
            get_u64(frame, begin, end),
            get_u16(frame, begin + 40, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
            get_f32(frame, begin + 20, end),
            get_f32(frame, begin + 24, end),
            get_f32(frame, begin + 28, end),
            get_f32(frame, begin + 32, end),
            get_f32(frame, begin + 36, end),
        )


ESTIMATOR_STATUS: Final = Kind(
    "ESTIMATOR_STATUS",
    230,
    163,
    (42, 42),
    (
        "time_usec",
        "flags",
        "vel_ratio",
        "pos_horiz_ratio",
        "pos_vert_ratio",
        "mag_ratio",
        "hagl_ratio",
        "tas_ratio",
        "pos_horiz_accuracy_m",
        "pos_vert_accuracy_m",
    ),
    EstimatorStatus(0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class HomePosition(Message):
    """HOME_POSITION (242): the home position."""

    def __init__(
        self,
        latitude_rad: float,
        longitude_rad: float,
        altitude_m: float,
        x_m: float,
        y_m: float,
        z_m: float,
        q: tuple[float, ...],
        approach_x_m: float = 0.0,
        approach_y_m: float = 0.0,
        approach_z_m: float = 0.0,
        time_usec: int = 0,
    ) -> None:
        self.latitude_rad = latitude_rad
        self.longitude_rad = longitude_rad
        self.altitude_m = altitude_m
        self.x_m = x_m
        self.y_m = y_m
        self.z_m = z_m
        self.q = q
        self.approach_x_m = approach_x_m
        self.approach_y_m = approach_y_m
        self.approach_z_m = approach_z_m
        self.time_usec = time_usec

    def kind(self) -> Kind:
        return HOME_POSITION

    def write(self, payload: BytesWriter) -> None:
        put_near_i32(payload, self.latitude_rad * PER_DEGE7)
        put_near_i32(payload, self.longitude_rad * PER_DEGE7)
        put_near_i32(payload, self.altitude_m * PER_MILLI)
        put_f32(payload, self.x_m)
        put_f32(payload, self.y_m)
        put_f32(payload, self.z_m)
        put_f32s(payload, self.q, 4)
        put_f32(payload, self.approach_x_m)
        put_f32(payload, self.approach_y_m)
        put_f32(payload, self.approach_z_m)
        put_u64(payload, self.time_usec)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return HomePosition(
            get_i32(frame, begin, end) * DEGE7,
            get_i32(frame, begin + 4, end) * DEGE7,
            get_i32(frame, begin + 8, end) * MILLI,
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
            get_f32(frame, begin + 20, end),
            get_f32s(frame, begin + 24, end, 4),
            get_f32(frame, begin + 40, end),
            get_f32(frame, begin + 44, end),
            get_f32(frame, begin + 48, end),
            get_u64(frame, begin + 52, end),
        )


HOME_POSITION: Final = Kind(
    "HOME_POSITION",
    242,
    104,
    (52, 60),
    (
        "latitude_rad",
        "longitude_rad",
        "altitude_m",
        "x_m",
        "y_m",
        "z_m",
        "q",
        "approach_x_m",
        "approach_y_m",
        "approach_z_m",
        "time_usec",
    ),
    HomePosition(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, ()),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class ExtendedSysState(Message):
    """EXTENDED_SYS_STATE (245): on the ground or in the air (MAV_LANDED_STATE)."""

    def __init__(self, vtol_state: int, landed_state: int) -> None:
        self.vtol_state = vtol_state
        self.landed_state = landed_state

    def kind(self) -> Kind:
        return EXTENDED_SYS_STATE

    def write(self, payload: BytesWriter) -> None:
        put_u8(payload, self.vtol_state)
        put_u8(payload, self.landed_state)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return ExtendedSysState(get_u8(frame, begin, end), get_u8(frame, begin + 1, end))


EXTENDED_SYS_STATE: Final = Kind(
    "EXTENDED_SYS_STATE", 245, 130, (2, 2), ("vtol_state", "landed_state"), ExtendedSysState(0, 0)
)

KINDS: Final = (
    SYS_STATUS,
    GPS_RAW_INT,
    ATTITUDE,
    LOCAL_POSITION_NED,
    GLOBAL_POSITION_INT,
    NAV_CONTROLLER_OUTPUT,
    VFR_HUD,
    BATTERY_STATUS,
    WIND,
    EKF_STATUS_REPORT,
    ESTIMATOR_STATUS,
    HOME_POSITION,
    EXTENDED_SYS_STATE,
)

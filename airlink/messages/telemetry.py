"""Messages in which a vehicle reports its state."""

# Written by: python -m tests.airlink.generate_messages
# A class for each message of the service, all after one plan: not edited here.

from __future__ import annotations

import math
from typing import Final

from librt.strings import BytesWriter

from airlink.messages.payload import (
    CDEG,
    CENTI,
    DEG,
    DEGE7,
    I16_MAX,
    I16_MIN,
    I32_MAX,
    I32_MIN,
    MILLI,
    PER_CDEG,
    PER_CENTI,
    PER_DEG,
    PER_DEGE7,
    PER_MILLI,
    U16_MAX,
    U32_MAX,
    UNKNOWN_U16,
    Kind,
    Message,
    f32,
    f32s,
    i8,
    i16,
    i32,
    known,
    knowns,
    nearest,
    put_f32,
    put_f32s,
    put_i8,
    put_i16,
    put_i32,
    put_knowns,
    put_u8,
    put_u16,
    put_u32,
    put_u64,
    put_zeros,
    u16,
    u32,
    u64,
)


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
        put_u16(payload, nearest(self.voltage_battery_v * PER_MILLI, 0.0, U16_MAX, UNKNOWN_U16))
        put_i16(payload, nearest(self.current_battery_a * PER_CENTI, I16_MIN, I16_MAX))
        put_zeros(payload, 12)
        put_i8(payload, self.battery_remaining)
        put_zeros(payload, 12)


class _SysStatusKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return SysStatus(
            u32(payload, 0),
            u32(payload, 4),
            u32(payload, 8),
            u16(payload, 12),
            known(u16(payload, 14)) * MILLI,
            i16(payload, 16) * CENTI,
            i8(payload, 30),
        )


SYS_STATUS: Final = _SysStatusKind(
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
    SysStatus,
)


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
        put_i32(payload, nearest(self.lat_rad * PER_DEGE7, I32_MIN, I32_MAX))
        put_i32(payload, nearest(self.lon_rad * PER_DEGE7, I32_MIN, I32_MAX))
        put_i32(payload, nearest(self.alt_m * PER_MILLI, I32_MIN, I32_MAX))
        put_u16(payload, self.eph)
        put_u16(payload, self.epv)
        put_u16(payload, nearest(self.vel_mps * PER_CENTI, 0.0, U16_MAX, UNKNOWN_U16))
        put_u16(payload, nearest(self.cog_rad * PER_CDEG, 0.0, U16_MAX, UNKNOWN_U16))
        put_u8(payload, self.fix_type)
        put_u8(payload, self.satellites_visible)
        put_zeros(payload, 22)


class _GpsRawIntKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return GpsRawInt(
            u64(payload, 0),
            payload[28],
            i32(payload, 8) * DEGE7,
            i32(payload, 12) * DEGE7,
            i32(payload, 16) * MILLI,
            u16(payload, 20),
            u16(payload, 22),
            known(u16(payload, 24)) * CENTI,
            known(u16(payload, 26)) * CDEG,
            payload[29],
        )


GPS_RAW_INT: Final = _GpsRawIntKind(
    "GPS_RAW_INT",
    24,
    24,
    (30, 52),
    ("time_usec", "fix_type", "lat_rad", "lon_rad", "alt_m", "eph", "epv", "vel_mps", "cog_rad", "satellites_visible"),
    GpsRawInt,
)


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
        put_u32(payload, nearest(self.time_boot_s * PER_MILLI, 0.0, U32_MAX))
        put_f32(payload, self.roll_rad)
        put_f32(payload, self.pitch_rad)
        put_f32(payload, self.yaw_rad)
        put_f32(payload, self.rollspeed_radps)
        put_f32(payload, self.pitchspeed_radps)
        put_f32(payload, self.yawspeed_radps)

    def boot_s(self) -> float:
        return self.time_boot_s


class _AttitudeKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return Attitude(
            u32(payload, 0) * MILLI,
            f32(payload, 4),
            f32(payload, 8),
            f32(payload, 12),
            f32(payload, 16),
            f32(payload, 20),
            f32(payload, 24),
        )


ATTITUDE: Final = _AttitudeKind(
    "ATTITUDE",
    30,
    39,
    (28, 28),
    ("time_boot_s", "roll_rad", "pitch_rad", "yaw_rad", "rollspeed_radps", "pitchspeed_radps", "yawspeed_radps"),
    Attitude,
)


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
        put_u32(payload, nearest(self.time_boot_s * PER_MILLI, 0.0, U32_MAX))
        put_f32(payload, self.x_m)
        put_f32(payload, self.y_m)
        put_f32(payload, self.z_m)
        put_f32(payload, self.vx_mps)
        put_f32(payload, self.vy_mps)
        put_f32(payload, self.vz_mps)

    def boot_s(self) -> float:
        return self.time_boot_s


class _LocalPositionNedKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return LocalPositionNed(
            u32(payload, 0) * MILLI,
            f32(payload, 4),
            f32(payload, 8),
            f32(payload, 12),
            f32(payload, 16),
            f32(payload, 20),
            f32(payload, 24),
        )


LOCAL_POSITION_NED: Final = _LocalPositionNedKind(
    "LOCAL_POSITION_NED",
    32,
    185,
    (28, 28),
    ("time_boot_s", "x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps"),
    LocalPositionNed,
)


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
        put_u32(payload, nearest(self.time_boot_s * PER_MILLI, 0.0, U32_MAX))
        put_i32(payload, nearest(self.lat_rad * PER_DEGE7, I32_MIN, I32_MAX))
        put_i32(payload, nearest(self.lon_rad * PER_DEGE7, I32_MIN, I32_MAX))
        put_i32(payload, nearest(self.alt_m * PER_MILLI, I32_MIN, I32_MAX))
        put_i32(payload, nearest(self.relative_alt_m * PER_MILLI, I32_MIN, I32_MAX))
        put_i16(payload, nearest(self.vx_mps * PER_CENTI, I16_MIN, I16_MAX))
        put_i16(payload, nearest(self.vy_mps * PER_CENTI, I16_MIN, I16_MAX))
        put_i16(payload, nearest(self.vz_mps * PER_CENTI, I16_MIN, I16_MAX))
        put_u16(payload, nearest(self.hdg_rad * PER_CDEG, 0.0, U16_MAX, UNKNOWN_U16))

    def boot_s(self) -> float:
        return self.time_boot_s


class _GlobalPositionIntKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return GlobalPositionInt(
            u32(payload, 0) * MILLI,
            i32(payload, 4) * DEGE7,
            i32(payload, 8) * DEGE7,
            i32(payload, 12) * MILLI,
            i32(payload, 16) * MILLI,
            i16(payload, 20) * CENTI,
            i16(payload, 22) * CENTI,
            i16(payload, 24) * CENTI,
            known(u16(payload, 26)) * CDEG,
        )


GLOBAL_POSITION_INT: Final = _GlobalPositionIntKind(
    "GLOBAL_POSITION_INT",
    33,
    104,
    (28, 28),
    ("time_boot_s", "lat_rad", "lon_rad", "alt_m", "relative_alt_m", "vx_mps", "vy_mps", "vz_mps", "hdg_rad"),
    GlobalPositionInt,
)


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
        put_i16(payload, nearest(self.nav_bearing_rad * PER_DEG, I16_MIN, I16_MAX))
        put_i16(payload, nearest(self.target_bearing_rad * PER_DEG, I16_MIN, I16_MAX))
        put_u16(payload, nearest(self.wp_dist_m, 0.0, U16_MAX, UNKNOWN_U16))


class _NavControllerOutputKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return NavControllerOutput(
            f32(payload, 0) * DEG,
            f32(payload, 4) * DEG,
            i16(payload, 20) * DEG,
            i16(payload, 22) * DEG,
            known(u16(payload, 24)) * 1.0,
            f32(payload, 8),
            f32(payload, 12),
            f32(payload, 16),
        )


NAV_CONTROLLER_OUTPUT: Final = _NavControllerOutputKind(
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
    NavControllerOutput,
)


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
        put_i16(payload, nearest(self.heading_rad * PER_DEG, I16_MIN, I16_MAX))
        put_u16(payload, self.throttle)


class _VfrHudKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return VfrHud(
            f32(payload, 0),
            f32(payload, 4),
            i16(payload, 16) * DEG,
            u16(payload, 18),
            f32(payload, 8),
            f32(payload, 12),
        )


VFR_HUD: Final = _VfrHudKind(
    "VFR_HUD",
    74,
    20,
    (20, 20),
    ("airspeed_mps", "groundspeed_mps", "heading_rad", "throttle", "alt_m", "climb_mps"),
    VfrHud,
)


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

    def kind(self) -> Kind:
        return BATTERY_STATUS

    def write(self, payload: BytesWriter) -> None:
        put_i32(payload, self.current_consumed)
        put_i32(payload, self.energy_consumed)
        put_i16(payload, self.temperature)
        put_knowns(payload, self.voltages_v, 10, PER_MILLI)
        put_i16(payload, nearest(self.current_battery_a * PER_CENTI, I16_MIN, I16_MAX))
        put_u8(payload, self.id)
        put_u8(payload, self.battery_function)
        put_u8(payload, self.type)
        put_i8(payload, self.battery_remaining)
        put_zeros(payload, 18)


class _BatteryStatusKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return BatteryStatus(
            payload[32],
            payload[33],
            payload[34],
            i16(payload, 8),
            knowns(payload, 10, 10, MILLI),
            i16(payload, 30) * CENTI,
            i32(payload, 0),
            i32(payload, 4),
            i8(payload, 35),
        )


BATTERY_STATUS: Final = _BatteryStatusKind(
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
    ),
    BatteryStatus,
)


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


class _WindKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return Wind(f32(payload, 0) * DEG, f32(payload, 4), f32(payload, 8))


WIND: Final = _WindKind("WIND", 168, 1, (12, 12), ("direction_rad", "speed_mps", "speed_z_mps"), Wind)


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


class _EkfStatusReportKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return EkfStatusReport(
            u16(payload, 20),
            f32(payload, 0),
            f32(payload, 4),
            f32(payload, 8),
            f32(payload, 12),
            f32(payload, 16),
            f32(payload, 22),
        )


EKF_STATUS_REPORT: Final = _EkfStatusReportKind(
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
    EkfStatusReport,
)


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
        put_i32(payload, nearest(self.latitude_rad * PER_DEGE7, I32_MIN, I32_MAX))
        put_i32(payload, nearest(self.longitude_rad * PER_DEGE7, I32_MIN, I32_MAX))
        put_i32(payload, nearest(self.altitude_m * PER_MILLI, I32_MIN, I32_MAX))
        put_f32(payload, self.x_m)
        put_f32(payload, self.y_m)
        put_f32(payload, self.z_m)
        put_f32s(payload, self.q, 4)
        put_f32(payload, self.approach_x_m)
        put_f32(payload, self.approach_y_m)
        put_f32(payload, self.approach_z_m)
        put_u64(payload, self.time_usec)


class _HomePositionKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return HomePosition(
            i32(payload, 0) * DEGE7,
            i32(payload, 4) * DEGE7,
            i32(payload, 8) * MILLI,
            f32(payload, 12),
            f32(payload, 16),
            f32(payload, 20),
            f32s(payload, 24, 4),
            f32(payload, 40),
            f32(payload, 44),
            f32(payload, 48),
            u64(payload, 52),
        )


HOME_POSITION: Final = _HomePositionKind(
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
    HomePosition,
)


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


class _ExtendedSysStateKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return ExtendedSysState(payload[0], payload[1])


EXTENDED_SYS_STATE: Final = _ExtendedSysStateKind(
    "EXTENDED_SYS_STATE", 245, 130, (2, 2), ("vtol_state", "landed_state"), ExtendedSysState
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
    HOME_POSITION,
    EXTENDED_SYS_STATE,
)

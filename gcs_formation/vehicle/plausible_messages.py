"""Which positions and attitudes an aircraft can have sent, and what is usable of others."""

from __future__ import annotations

import math
from typing import Final

from airlink.messages import Message
from airlink.messages.telemetry import (
    Attitude,
    GlobalPositionInt,
    HomePosition,
)
from flight_model.earth import GeodeticOrigin
from formation_scenario.fields import MAX_DISTANCE_M

SPEED_LIMIT_MPS: Final = 400.0
ANGLE_LIMIT_RAD: Final = 2 * math.pi
HALF_TURN_RAD: Final = math.pi
QUARTER_RAD: Final = math.pi / 2
INFINITE: Final = math.inf
TURN_RAD: Final = 2 * math.pi
"""Headings are smaller; 655.35 degrees stand for an unknown one."""
TURN_LIMIT_RPS: Final = 50.0
ALTITUDE_LIMIT_M: Final = 100e3
"""Limits of plausible values for an aircraft."""
HOME_LIMIT_M: Final[float] = MAX_DISTANCE_M
"""Largest distance of a home from the origin: that of a waypoint, for vehicles fly from there to the path and back."""


def is_position(message: GlobalPositionInt) -> bool:
    """Return whether values are in their ranges, and latitude and longitude aren't both 0."""
    return (
        is_place(message.lat_rad, message.lon_rad, message.alt_m)
        and -ALTITUDE_LIMIT_M <= message.relative_alt_m <= ALTITUDE_LIMIT_M
        and abs(message.time_boot_s) < INFINITE
        and abs(message.vx_mps) < INFINITE
        and abs(message.vy_mps) < INFINITE
        and abs(message.vz_mps) < INFINITE
    )


def is_place(lat_rad: float, lon_rad: float, alt_m: float) -> bool:
    """Return whether a place is in the ranges of an aircraft's, and its latitude and longitude aren't both 0."""
    return (
        (lat_rad != 0.0 or lon_rad != 0.0)
        and -QUARTER_RAD < lat_rad < QUARTER_RAD
        and -HALF_TURN_RAD <= lon_rad <= HALF_TURN_RAD
        and -ALTITUDE_LIMIT_M <= alt_m <= ALTITUDE_LIMIT_M
    )


def plausible_home(message: HomePosition, origin: GeodeticOrigin) -> tuple[float, float, float] | None:
    """Return a home north and east of the origin and its height above it, m; None if no aircraft can have it."""
    if not is_place(message.latitude_rad, message.longitude_rad, message.altitude_m):
        return None
    north_m, east_m, down_m = origin.to_ned(message.latitude_rad, message.longitude_rad, message.altitude_m)
    return (north_m, east_m, -down_m) if math.hypot(north_m, east_m) <= HOME_LIMIT_M else None


def is_attitude(message: Attitude) -> bool:
    """Return whether angles, rates and the stamp are in their ranges."""
    return (
        -ANGLE_LIMIT_RAD <= message.roll_rad <= ANGLE_LIMIT_RAD
        and -ANGLE_LIMIT_RAD <= message.pitch_rad <= ANGLE_LIMIT_RAD
        and -ANGLE_LIMIT_RAD <= message.yaw_rad <= ANGLE_LIMIT_RAD
        and -TURN_LIMIT_RPS <= message.rollspeed_radps <= TURN_LIMIT_RPS
        and -TURN_LIMIT_RPS <= message.pitchspeed_radps <= TURN_LIMIT_RPS
        and -TURN_LIMIT_RPS <= message.yawspeed_radps <= TURN_LIMIT_RPS
        and abs(message.time_boot_s) < INFINITE
    )


def usable_of(message: Attitude, heading_rad: float) -> Attitude | None:
    """Return an attitude with what the control law needs of it, or with a heading in place of its yaw; None without."""
    yaw_rad, yaw_rps = message.yaw_rad, message.yawspeed_radps
    yaw_rad = yaw_rad if -ANGLE_LIMIT_RAD <= yaw_rad <= ANGLE_LIMIT_RAD else heading_rad
    yaw_rps = yaw_rps if -TURN_LIMIT_RPS <= yaw_rps <= TURN_LIMIT_RPS else 0.0
    usable = abs(message.time_boot_s) < INFINITE and -ANGLE_LIMIT_RAD <= yaw_rad <= ANGLE_LIMIT_RAD
    return Attitude(message.time_boot_s, 0.0, 0.0, yaw_rad, 0.0, 0.0, yaw_rps) if usable else None


def first_not_finite(message: Message) -> str:
    """Return which field of a message isn't finite, and its value; empty if all are."""
    values = message.values().items()
    name, value = next(((name, value) for name, value in values if not math.isfinite(value)), ("", 0.0))
    described = "NaN" if math.isnan(value) else "infinite"
    return f"{message.kind().name}'s {name.rpartition('_')[0]} is {described}" if name else ""


def first_impossible(message: Attitude) -> str:
    """Return which field of an attitude is beyond what any aircraft has, and its value."""
    for name, value in message.values().items():
        limit = TURN_LIMIT_RPS if "speed" in name else ANGLE_LIMIT_RAD
        if name != "time_boot_s" and abs(value) > limit:
            unit = "rad/s" if "speed" in name else "rad"
            return f"ATTITUDE's {name.rpartition('_')[0]} is {value:g} {unit}"
    return ""


def why_no_position(message: GlobalPositionInt) -> str:
    """Return in words which field of a position can't be used."""
    if message.lat_rad == message.lon_rad == 0.0:
        return "GLOBAL_POSITION_INT's lat and lon are 0: it has no fix, or nothing fills them"
    found = first_not_finite(message)
    if found:
        return found
    fields = {"lat": message.lat_rad, "lon": message.lon_rad, "alt": message.alt_m}
    ranges = {"lat": QUARTER_RAD, "lon": HALF_TURN_RAD, "alt": ALTITUDE_LIMIT_M}
    name = next((each for each, value in fields.items() if abs(value) > ranges[each]), "relative_alt")
    value = fields.get(name, message.relative_alt_m)
    described = f"{value:.0f} m" if name.endswith("alt") else f"{math.degrees(value):.0f} degrees"
    return f"GLOBAL_POSITION_INT's {name} is {described}"

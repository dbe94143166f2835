"""The names of all modes of the autopilot families, by their numbers in HEARTBEAT's custom_mode.

Sources: ArduPilot, `ArduPlane/mode.h`, `ArduCopter/mode.h` (4.7); PX4, `px4_custom_mode.h` (1.18).
"""

from __future__ import annotations

from typing import Final

from airlink import mavlink as m

PLANE: Final[dict[int, str]] = {
    0: "MANUAL",
    1: "CIRCLE",
    2: "STABILIZE",
    3: "TRAINING",
    4: "ACRO",
    5: "FBWA",
    6: "FBWB",
    7: "CRUISE",
    8: "AUTOTUNE",
    10: "AUTO",
    11: "RTL",
    12: "LOITER",
    13: "TAKEOFF",
    14: "AVOID_ADSB",
    15: "GUIDED",
    16: "INITIALISING",
    17: "QSTABILIZE",
    18: "QHOVER",
    19: "QLOITER",
    20: "QLAND",
    21: "QRTL",
    22: "QAUTOTUNE",
    23: "QACRO",
    24: "THERMAL",
    25: "LOITER_ALT_QLAND",
    26: "AUTOLAND",
}
"""ArduPlane's modes; those with a Q are a quadplane's."""
COPTER: Final[dict[int, str]] = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    5: "LOITER",
    6: "RTL",
    7: "CIRCLE",
    9: "LAND",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    17: "BRAKE",
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    21: "SMART_RTL",
    22: "FLOWHOLD",
    23: "FOLLOW",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    27: "AUTO_RTL",
    28: "TURTLE",
}
"""ArduCopter's modes."""


def px4_mode(main: int, sub: int = 0) -> int:
    """Return the custom_mode of PX4's main mode and sub mode."""
    return main << 16 | sub << 24


POSITION, AUTO = 3, 4
"""Main modes that have sub modes."""
PX4: Final[dict[int, str]] = {
    px4_mode(1): "MANUAL",
    px4_mode(2): "ALTITUDE",
    px4_mode(POSITION): "POSITION",
    px4_mode(POSITION, 1): "ORBIT",
    px4_mode(POSITION, 2): "POSITION_SLOW",
    px4_mode(AUTO): "AUTO",
    px4_mode(AUTO, 1): "READY",
    px4_mode(AUTO, 2): "TAKEOFF",
    px4_mode(AUTO, 3): "HOLD",
    px4_mode(AUTO, 4): "MISSION",
    px4_mode(AUTO, 5): "RTL",
    px4_mode(AUTO, 6): "LAND",
    px4_mode(AUTO, 7): "RTGS",
    px4_mode(AUTO, 8): "FOLLOW_TARGET",
    px4_mode(AUTO, 9): "PRECLAND",
    px4_mode(AUTO, 10): "VTOL_TAKEOFF",
    **{px4_mode(AUTO, 10 + number): f"EXTERNAL{number}" for number in range(1, 9)},
    px4_mode(AUTO, 19): "GUIDED_COURSE",
    px4_mode(5): "ACRO",
    px4_mode(6): "OFFBOARD",
    px4_mode(7): "STABILIZED",
    px4_mode(8): "RATTITUDE",
    px4_mode(9): "SIMPLE",
    px4_mode(10): "TERMINATION",
    px4_mode(11): "ALTITUDE_CRUISE",
}
"""PX4's modes."""

PLANE_TYPES = frozenset(
    {m.MAV_TYPE_GENERIC, m.MAV_TYPE_FIXED_WING, *range(m.MAV_TYPE_VTOL_DUOROTOR, m.MAV_TYPE_GIMBAL)}
)
"""MAV_TYPE of ArduPlane's aircraft, and GENERIC: their modes are PLANE's."""

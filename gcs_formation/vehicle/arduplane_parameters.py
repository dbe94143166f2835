"""ArduPlane's parameters on which a flight in formation depends.

Source: ArduPilot documentation, "Complete Parameter List" and "Plane Failsafe Function"; names since 4.6.
"""

from __future__ import annotations

import math

from gcs_formation.vehicle.checks import Check, Demands

STATION_SYSTEM = 255
GRAVITY_MPS2 = 9.80665
LEAST_TAKE_OFF_M = 50
HEARTBEATS_S = 3.0
"""A failsafe that waits less takes a few lost heartbeats for the end of the link."""
CRUISE_OFF_MPS = 1.0
FAILSAFE_BY_HEARTBEAT = (1, 2)
LEADS_AWAY = (1, 4, 5)
"""FS_LONG_ACTN: RTL, AUTO, AUTOLAND; 0 flies on, 2 glides, 3 releases a parachute."""


def arduplane_checks(asked: Demands) -> tuple[Check, ...]:
    """Return what to read from an ArduPlane of which a scenario asks this much."""
    roll_deg = math.degrees(math.atan(asked.speed_mps * asked.turn_rate_max_rps / GRAVITY_MPS2))
    slowest, fastest, speed = asked.speed_min_mps, asked.speed_max_mps, asked.speed_mps
    return (
        Check(
            ("MAV_GCS_SYSID", "SYSID_MYGCS"),
            f"{STATION_SYSTEM}, this ground station; heartbeats of others don't hold off the failsafe",
            lambda value: value == STATION_SYSTEM,
            lambda _: True,
        ),
        Check(
            ("FS_GCS_ENABL",),
            "1 or 2; without it a plane whose setpoints stop flies straight on for ever",
            lambda value: value in FAILSAFE_BY_HEARTBEAT,
        ),
        Check(
            ("FS_LONG_ACTN",),
            "1 (RTL), 4 (AUTO) or 5 (AUTOLAND) when our heartbeats stop",
            lambda value: value in LEADS_AWAY,
        ),
        Check(
            ("FS_LONG_TIMEOUT",),
            f"{HEARTBEATS_S:g} s or more; our heartbeats come once a second, and some are lost",
            lambda value: value >= HEARTBEATS_S,
        ),
        Check(
            ("TKOFF_ALT",),
            f"{LEAST_TAKE_OFF_M} m or more; lower, the climb ends before the formation takes over",
            lambda value: value >= LEAST_TAKE_OFF_M,
            lambda _: True,
        ),
        Check(
            ("AIRSPEED_MIN",),
            f"up to {slowest:g} m/s, its model's speed_min_mps; slower setpoints are refused",
            lambda value: value <= slowest,
            lambda value: value > speed,
        ),
        Check(
            ("AIRSPEED_MAX",),
            f"{fastest:g} m/s or more, its model's speed_max_mps; faster setpoints are refused",
            lambda value: value >= fastest,
            lambda value: value < speed,
        ),
        Check(
            ("AIRSPEED_CRUISE",),
            f"{speed:g} m/s, path.speed_mps, to which throttle and pitch are trimmed",
            lambda value: abs(value - speed) <= CRUISE_OFF_MPS,
        ),
        Check(
            ("ROLL_LIMIT_DEG",),
            f"{roll_deg:.0f} degrees or more, for its model's turn_rate_max_rps at {speed:g} m/s",
            lambda value: value >= round(roll_deg),
        ),
    )

"""ArduPlane's parameters on which a flight in formation depends.

Source: ArduPilot documentation, "Complete Parameter List" and "Plane Failsafe Function"; names since 4.6.
"""

from __future__ import annotations

from gcs_formation.vehicle.checks import Check, Demands, envelope_checks

STATION_SYSTEM = 255
LEAST_TAKE_OFF_M = 50
HEARTBEATS_S = 3.0
"""A failsafe that waits less takes a few lost heartbeats for the end of the link."""
FAILSAFE_BY_HEARTBEAT = (1, 2)
LEADS_AWAY = (1, 4, 5)
"""FS_LONG_ACTN: RTL, AUTO, AUTOLAND; 0 flies on, 2 glides, 3 releases a parachute."""


def arduplane_checks(asked: Demands) -> tuple[Check, ...]:
    """Return what to read from an ArduPlane of which a scenario asks this much."""
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
        *envelope_checks(
            asked, "AIRSPEED_MIN", "AIRSPEED_MAX", "AIRSPEED_CRUISE", "ROLL_LIMIT_DEG", ("refused", "refused")
        ),
    )

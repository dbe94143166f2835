"""What ArduPlane and ArduCopter have in common.

Sources: ArduPilot documentation, "GCS Failsafe" and "Complete Parameter List" (names since 4.6).
"""

from __future__ import annotations

from abc import ABC
from typing import Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.messages import EKF_READY
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.checks import Check
from gcs_formation.vehicle.startup_step import StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry

HEARTBEATS_S: Final = 3.0
"""Least timeout of a GCS failsafe: a shorter one would trigger on a few lost heartbeats."""
ACTIVE: Final = m.MAV_STATE_ACTIVE
STANDBY: Final = m.MAV_STATE_STANDBY
TIMEOUT_S: Final = 5.0
"""Default of FS_LONG_TIMEOUT and FS_GCS_TIMEOUT."""
CM: Final = 0.01


def our_heartbeats(system: int) -> Check:
    """Return the check that the failsafe waits for heartbeats of our system id."""
    return Check(
        ("MAV_GCS_SYSID", "SYSID_MYGCS"),
        f"{system}, this ground station; heartbeats of others don't hold off the failsafe",
        lambda value: value == system,
        lambda _: True,
        asks=float(system),
    )


def heartbeat_timeout(name: str) -> Check:
    """Return the check of a GCS failsafe's timeout parameter."""
    return Check(
        (name,),
        f"{HEARTBEATS_S:g} s or more; our heartbeats come once a second, and some are lost",
        lambda value: value >= HEARTBEATS_S,
    )


@mypyc_attr(allow_interpreted_subclasses=True)
class ArduPilot(Autopilot, ABC):
    """What ArduPilot's vehicles have in common."""

    slow_messages = (m.MAVLINK_MSG_ID_EKF_STATUS_REPORT, *Autopilot.slow_messages)
    start_up_messages = slow_messages
    tells_time_with_home = True

    def says_airborne(self, telemetry: Telemetry) -> bool:
        """Return whether its heartbeats show ACTIVE."""
        return telemetry.flight_status == ACTIVE

    def says_grounded(self, telemetry: Telemetry) -> bool:
        """Return whether its heartbeats show STANDBY, which is also shown after a restart in flight."""
        return telemetry.flight_status == STANDBY

    def _guided_step(self) -> StartUpStep:
        guided = self.guided_mode
        return StartUpStep(
            "set mode GUIDED", lambda seen: seen.custom_mode == guided, lambda _: (self.set_mode(guided),)
        )

    def _lacks_estimates(self, seen: Telemetry) -> str:
        flags = m.flags_of("EKF_STATUS_FLAGS", EKF_READY & ~seen.ekf_flags)
        estimates = f"EKF_STATUS_REPORT: no {', '.join(flags)}" if seen.ekf_flags else "no EKF_STATUS_REPORT"
        return estimates if flags else super()._lacks_estimates(seen)

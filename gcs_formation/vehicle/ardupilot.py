"""What ArduPilot's families have in common: whose heartbeats count, which messages are needed, when one is ready.

Source: ArduPilot documentation, "Get and set message intervals" and "Complete Parameter List" (names since 4.6).
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping
from typing import Final

from airlink import mavlink as m
from gcs_formation.vehicle.autopilot import Autopilot, Step
from gcs_formation.vehicle.checks import Check
from gcs_formation.vehicle.telemetry import Telemetry

STATION_SYSTEM: Final = 255
HEARTBEATS_S: Final = 3.0
"""A failsafe that waits less takes a few lost heartbeats for the end of the link."""
EKF_READY: Final = 831
"""Attitude, velocities and positions, relative and absolute: all that flying in GUIDED needs."""
SLOW_RATE_HZ: Final = 2.0
UTC_RATE_HZ: Final = 1.0
AIRBORNE_M: Final = 10.0

OUR_HEARTBEATS = Check(
    ("MAV_GCS_SYSID", "SYSID_MYGCS"),
    f"{STATION_SYSTEM}, this ground station; heartbeats of others don't hold off the failsafe",
    lambda value: value == STATION_SYSTEM,
    lambda _: True,
)


def patience(name: str) -> Check:
    """Return the check of the parameter that says how long a failsafe waits for heartbeats."""
    return Check(
        (name,),
        f"{HEARTBEATS_S:g} s or more; our heartbeats come once a second, and some are lost",
        lambda value: value >= HEARTBEATS_S,
    )


class ArduPilot(Autopilot, ABC):
    """An autopilot of ArduPilot's."""

    def rates_hz(self, telemetry_rate_hz: float, *, utc: bool = False) -> Mapping[int, float]:
        """Return the rates of the messages that carry motion, readiness, mode and, if wanted, UTC."""
        fast = (m.MAVLINK_MSG_ID_ATTITUDE, m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, m.MAVLINK_MSG_ID_VFR_HUD)
        slow = (m.MAVLINK_MSG_ID_EKF_STATUS_REPORT, m.MAVLINK_MSG_ID_SYS_STATUS)
        rates_hz = dict.fromkeys(fast, telemetry_rate_hz) | dict.fromkeys(slow, SLOW_RATE_HZ) | self.unasked_hz
        return rates_hz | {m.MAVLINK_MSG_ID_SYSTEM_TIME: UTC_RATE_HZ} if utc else rates_hz

    def is_airborne(self, telemetry: Telemetry) -> bool:
        """Return whether it is in flight by its heartbeat, or armed and above the ground."""
        heartbeat = telemetry.heartbeat
        if heartbeat is None or telemetry.motion is None:
            return False
        return telemetry.armed and (
            heartbeat.system_status == m.MAV_STATE_ACTIVE or telemetry.motion.above_home_m > AIRBORNE_M
        )

    def _asked_and_ready(self, rates_hz: Mapping[int, float]) -> tuple[Step, ...]:
        """Return the first two steps: streams, ready."""
        return (
            Step("asked for telemetry", lambda seen: seen.complete, lambda _: self.requests(rates_hz), 20.0, True),
            Step("waited for it to be ready to arm", self._is_ready, timeout_s=90.0),
        )

    def _is_ready(self, seen: Telemetry) -> bool:
        healthy = bool(seen.sensors_healthy & m.MAV_SYS_STATUS_PREARM_CHECK)
        on_ground = seen.heartbeat is not None and seen.ekf_flags & EKF_READY == EKF_READY and healthy
        return on_ground or self.is_airborne(seen)

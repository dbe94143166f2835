"""What PX4's vehicles have in common: modes of two parts, when one is ready, take-off, how parameters are told.

Sources: PX4 user guide, "Flight Modes", "Parameter Reference" and "Safety Configuration (Failsafes)"; its acceptance
and refusals as its simulator (SIH) showed them.
"""

from __future__ import annotations

import math
import struct
from abc import ABC
from collections.abc import Mapping
from typing import ClassVar

from airlink import mavlink as m
from airlink.messages.command import CommandLong
from airlink.messages.parameter import ParamValue
from gcs_formation.vehicle.autopilot import Autopilot, Command
from gcs_formation.vehicle.checks import Check
from gcs_formation.vehicle.telemetry import Telemetry

LEADS_AWAY = (1, 2, 3)
"""NAV_DLL_ACT: hold, return, land; 0 does nothing, 5 and 6 stop the motor."""
MAIN_AUTO = 4
SLOW_RATE_HZ = 2.0
UTC_RATE_HZ = 1.0
CHANGES_HZ = 50.0
"""CURRENT_MODE is sent at this rate while there are changes: a mode must be seen before a setpoint undoes it."""
AIRBORNE_M = 10.0
UNCHANGED = math.nan


def mode_number(main: int, sub: int = 0) -> int:
    """Return custom_mode of a main and a sub mode."""
    return main << 16 | sub << 24


TAKEOFF, LOITER, RTL = mode_number(MAIN_AUTO, 2), mode_number(MAIN_AUTO, 3), mode_number(MAIN_AUTO, 5)
OFFBOARD = mode_number(6)


def px4_value(told: ParamValue) -> float:
    """Return a parameter's value: PX4 sends the bytes of an integer in the place of a float's."""
    if told.param_type != m.MAV_PARAM_TYPE_INT32:
        return told.param_value
    return float(struct.unpack("<i", struct.pack("<f", told.param_value))[0])


def heartbeats_lost(otherwise: str) -> Check:
    """Return the check of what happens when our heartbeats stop; `otherwise`: what does with nothing set."""
    return Check(
        ("NAV_DLL_ACT",),
        f"1 (hold), 2 (return) or 3 (land) when our heartbeats stop; with 0 it {otherwise}",
        lambda value: value in LEADS_AWAY,
    )


class Px4(Autopilot, ABC):
    """An autopilot of PX4's."""

    loop_s = 0.0
    """It answers TIMESYNC and commands as they come."""
    loiter_mode = LOITER
    home_mode = RTL
    take_off_to_m: ClassVar[float]
    """Height above home that it is told to take off to."""
    mode_names: ClassVar = {
        mode_number(1): "MANUAL",
        mode_number(2): "ALTITUDE",
        mode_number(3): "POSITION",
        mode_number(5): "ACRO",
        OFFBOARD: "OFFBOARD",
        mode_number(7): "STABILIZED",
        TAKEOFF: "TAKEOFF",
        LOITER: "HOLD",
        mode_number(MAIN_AUTO, 4): "MISSION",
        RTL: "RTL",
        mode_number(MAIN_AUTO, 6): "LAND",
    }

    def rates_hz(self, telemetry_rate_hz: float, *, utc: bool = False) -> Mapping[int, float]:
        """Return the rates of the messages that carry motion, readiness and, if wanted, UTC."""
        fast = (m.MAVLINK_MSG_ID_ATTITUDE, m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, m.MAVLINK_MSG_ID_VFR_HUD)
        slow = (m.MAVLINK_MSG_ID_SYS_STATUS, m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
        rates_hz = dict.fromkeys(fast, telemetry_rate_hz) | dict.fromkeys(slow, SLOW_RATE_HZ) | self.unasked_hz
        return rates_hz | {m.MAVLINK_MSG_ID_SYSTEM_TIME: UTC_RATE_HZ} if utc else rates_hz

    def parameter(self, told: ParamValue) -> float:
        """Return a parameter's value, of an integer too."""
        return px4_value(told)

    def is_airborne(self, telemetry: Telemetry) -> bool:
        """Return whether it is armed and says that it is in the air, or is well above home."""
        aloft = telemetry.motion is not None and telemetry.motion.above_home_m > AIRBORNE_M
        return telemetry.armed and (aloft or telemetry.landed_state == m.MAV_LANDED_STATE_IN_AIR)

    def mode_asked(self, command: Command) -> int | None:
        """Return the main and sub mode that a command asks for, as one number."""
        if command.command != m.MAV_CMD_DO_SET_MODE:
            return None
        return mode_number(int(command.param2), int(command.param3))

    def set_mode(self, mode: int) -> Command:
        """Return MAV_CMD_DO_SET_MODE: the main mode and the sub mode in fields of their own."""
        return CommandLong(
            self.system,
            m.MAV_COMP_ID_AUTOPILOT1,
            m.MAV_CMD_DO_SET_MODE,
            param1=m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            param2=mode >> 16 & 0xFF,
            param3=mode >> 24,
        )

    def _questions(self, rates_hz: Mapping[int, float]) -> tuple[Command, ...]:
        """Return the requests, with that for each change of mode: a heartbeat comes once a second."""
        changes = self.set_message_interval(m.MAVLINK_MSG_ID_CURRENT_MODE, CHANGES_HZ)
        return (*self.requests(rates_hz), changes)

    def _to_take_off(self, seen: Telemetry) -> tuple[Command, ...]:
        """Return NAV_TAKEOFF from where it stands; its altitude is above sea level."""
        ground_m = self._home_above_sea_m(seen)
        return (
            CommandLong(
                self.system,
                m.MAV_COMP_ID_AUTOPILOT1,
                m.MAV_CMD_NAV_TAKEOFF,
                param4=UNCHANGED,
                param5=UNCHANGED,
                param6=UNCHANGED,
                param7=ground_m + self.take_off_to_m,
            ),
        )

    def _home_above_sea_m(self, seen: Telemetry) -> float:
        motion = seen.motion
        return math.nan if motion is None else motion.height_m - motion.above_home_m + self.origin.alt_m

    def _is_ready(self, seen: Telemetry) -> bool:
        standby = seen.heartbeat is not None and seen.heartbeat.system_status == m.MAV_STATE_STANDBY
        healthy = bool(seen.sensors_healthy & m.MAV_SYS_STATUS_PREARM_CHECK)
        return (standby and healthy) or self.is_airborne(seen)

    def _is_taking_off(self, seen: Telemetry) -> bool:
        return self.is_airborne(seen) or seen.custom_mode == TAKEOFF

    def _has_climbed(self, seen: Telemetry) -> bool:
        return self.is_airborne(seen) and seen.custom_mode != TAKEOFF

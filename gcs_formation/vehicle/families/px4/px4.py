# Compiled by mypyc: it runs every tick.

"""What PX4 fixed wings and multirotors have in common.

Sources: PX4 user guide, "Flight Modes" ("Hold" and "Takeoff" of fixed wings, "Offboard", "Return"), "Parameter
Reference" and "Safety Configuration (Failsafes)"; what it accepts and refuses was observed in its simulator (SIH).
"""

from __future__ import annotations

import math
import struct
from abc import ABC
from collections.abc import Mapping
from typing import ClassVar

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.messages.command import ParamSet, ParamValue
from airlink.messages.system import Heartbeat
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.checks import Check
from gcs_formation.vehicle.mode_names import AUTO, PX4, px4_mode
from gcs_formation.vehicle.own_failsafe import OwnFailsafe, Parameters
from gcs_formation.vehicle.own_fence import OwnFence, px4_fence
from gcs_formation.vehicle.startup_step import Command, StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry

LEADS_AWAY = (1, 2, 3)
"""NAV_DLL_ACT: hold, return, land; 0 does nothing, 5 and 6 stop the motor."""
CHANGES_HZ = 50.0
"""Rate of CURRENT_MODE, sent on changes: a pilot's mode must be seen before the next setpoint overrides it."""
OFF_THE_GROUND = (m.MAV_LANDED_STATE_IN_AIR, m.MAV_LANDED_STATE_TAKEOFF, m.MAV_LANDED_STATE_LANDING)
"""Below 10 m PX4 reports for seconds that it takes off or lands."""
UNCHANGED = math.nan
LINK_LOSS_S, STREAM_LOSS_S = 10.0, 1.0
"""Defaults of COM_DL_LOSS_T and COM_OF_LOSS_T."""
TAKEOFF, LOITER, RTL = px4_mode(AUTO, 2), px4_mode(AUTO, 3), px4_mode(AUTO, 5)
OFFBOARD = px4_mode(6)
LAND = px4_mode(AUTO, 6)
LEADS_TO = {1: frozenset({LOITER}), 2: frozenset({LOITER, RTL}), 3: frozenset({LOITER, LAND})}
"""NAV_DLL_ACT: the modes to which it leads, by a hold."""
UNARMABLE = frozenset(PX4) - {TAKEOFF, LOITER}
"""Modes in which a PX4 may not be armable: those of a pilot need a transmitter, OFFBOARD setpoints, others a mission;
return and landing end a flight."""


def heartbeats_lost(otherwise: str) -> Check:
    """Return the check of the action on lost heartbeats; `otherwise`: what the vehicle does if none is set."""
    return Check(
        ("NAV_DLL_ACT",),
        f"1 (hold), 2 (return) or 3 (land) when our heartbeats stop; with 0 it {otherwise}",
        lambda value: value in LEADS_AWAY,
    )


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4(Autopilot, ABC):
    """What PX4's vehicles have in common."""

    loop_s = 0.0
    """It answers TIMESYNC and commands on arrival."""
    take_off_mode = TAKEOFF
    taken_off_mode = LOITER
    loiter_mode = LOITER
    home_mode = RTL
    slow_messages = (*Autopilot.slow_messages, m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    mounting_parameter = "SENS_BOARD_ROT"
    failsafe_words = ("failsafe", "lost")
    """As in "Offboard control signal lost" and "GCS connection lost"."""
    types: ClassVar[frozenset[int]]
    """MAV_TYPEs of the vehicles flown by these commands."""
    take_off_to_m: ClassVar[float]
    """Commanded take-off height above home, m."""
    mode_names: ClassVar = PX4
    failsafe_parameters: ClassVar[tuple[str, ...]] = ("NAV_DLL_ACT", "COM_DL_LOSS_T")
    unarmable_modes = UNARMABLE

    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is from a PX4 of one of these `types`."""
        return heartbeat.autopilot == m.MAV_AUTOPILOT_PX4 and heartbeat.type in self.types

    def own_failsafe(self, values: Parameters) -> OwnFailsafe | None:
        """Return its failsafe for lost heartbeats, None if it is off."""
        modes = LEADS_TO.get(int(values.get("NAV_DLL_ACT", 0)))
        return None if modes is None else OwnFailsafe(values.get("COM_DL_LOSS_T", LINK_LOSS_S), modes)

    def own_fence(self, values: Parameters) -> OwnFence | None:
        """Return its geofence around home, None if it is off."""
        return px4_fence(values)

    def parameter(self, reported: ParamValue) -> float:
        """Return a parameter's value: PX4 sends an integer's bytes in the float field."""
        if reported.param_type != m.MAV_PARAM_TYPE_INT32:
            return reported.param_value
        return float(struct.unpack("<i", struct.pack("<f", reported.param_value))[0])

    def set_parameter(self, name: str, value: float, kind: int) -> ParamSet:
        """Return PARAM_SET, with an integer's bytes in the float field."""
        sent = struct.unpack("<f", struct.pack("<i", round(value)))[0] if kind == m.MAV_PARAM_TYPE_INT32 else value
        return super().set_parameter(name, sent, kind)

    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[StartUpStep, ...]:
        """Return the steps: streams, ready, take-off, which ends in HOLD, guided mode; those done are skipped."""
        guided, named = self.guided_mode, self.mode_names[self.guided_mode]
        return (
            *self._asked_and_ready(rates_hz),
            *self._waits(),
            StartUpStep("commanded it to take off", self._is_taking_off, self._to_take_off, takes_off=True),
            self._armable_step(),
            self._armed_step(),
            StartUpStep("waited for it to climb", self._has_climbed, timeout_s=120.0),
            StartUpStep(f"set mode {named}", self.takes_setpoints, lambda _: (self.set_mode(guided),)),
        )

    def _waits(self) -> tuple[StartUpStep, ...]:
        """Return the family's further waits before take-off."""
        return ()

    def says_airborne(self, telemetry: Telemetry) -> bool:
        """Return whether it reports IN_AIR, TAKEOFF or LANDING."""
        return telemetry.landed_state in OFF_THE_GROUND

    def says_grounded(self, telemetry: Telemetry) -> bool:
        """Return whether it reports ON_GROUND."""
        return telemetry.landed_state == m.MAV_LANDED_STATE_ON_GROUND

    def mode_asked(self, command: Command) -> int | None:
        """Return the main and sub mode that a command sets, as one number."""
        if command.command != m.MAV_CMD_DO_SET_MODE:
            return None
        return px4_mode(int(command.param2), int(command.param3))

    def set_mode(self, mode: int) -> Command:
        """Return MAV_CMD_DO_SET_MODE, with main mode and sub mode in separate fields."""
        own = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        return self._command(m.MAV_CMD_DO_SET_MODE, own, mode >> 16 & 0xFF, mode >> 24)

    def requests(self, rates_hz: Mapping[int, float]) -> tuple[Command, ...]:
        """Return also one for CURRENT_MODE: heartbeats, once a second, show modes too late."""
        changes = self.set_message_interval(m.MAVLINK_MSG_ID_CURRENT_MODE, CHANGES_HZ)
        return (*super().requests(rates_hz), changes)

    def _to_take_off(self, seen: Telemetry) -> tuple[Command, ...]:
        """Return NAV_TAKEOFF at its position; the altitude is above sea level."""
        position = (UNCHANGED, UNCHANGED, UNCHANGED, self._home_above_sea_m(seen) + self.take_off_to_m)
        return (self._command(m.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, *position),)

    def _home_above_sea_m(self, seen: Telemetry) -> float:
        motion = seen.motion
        return math.nan if motion is None else motion.height_m - motion.above_home_m + self.origin.alt_m

    def _lacks_to_arm(self, seen: Telemetry) -> str:
        status = m.MAV_STATE_STANDBY if seen.heartbeat is None else seen.heartbeat.system_status
        state = "" if status == m.MAV_STATE_STANDBY else f"its heartbeats say {m.name_of('MAV_STATE', status)}"
        return "; ".join(filter(None, (state, super()._lacks_to_arm(seen))))

    def _has_climbed(self, seen: Telemetry) -> bool:
        return self.is_airborne(seen) and seen.custom_mode != TAKEOFF

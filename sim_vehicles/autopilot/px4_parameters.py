"""An emulated PX4's parameters, and the failsafes that they set.

Source: PX4 user guide, "Parameter Reference" and "Safety Configuration (Failsafes)";
what PX4's simulator (SIH, version 1.17, development) answers, refuses and begins with.
"""

from __future__ import annotations

import math
import struct
from typing import Final

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after
from airlink.messages import Message
from airlink.messages.command import ParamError, ParamRequestRead, ParamSet, ParamValue
from sim_vehicles.autopilot.missions import Sender
from sim_vehicles.autopilot.modes_and_failsafe import STALE, FailsafeKeys, FlightMode, GroundStationFailsafe, Px4Mode
from sim_vehicles.autopilot.parameters import FIXED, LOITER_RADIUS_M, ParameterKind, ParameterServer, floating
from sim_vehicles.config import VehicleConfig

LOST_LINK: Final = {2: Px4Mode.RTL, 3: Px4Mode.LAND}
"""NAV_DLL_ACT, after a while in HOLD; 1 is HOLD, 0 does nothing."""
LOST_STREAM: Final = {0: Px4Mode.RTL, 3: Px4Mode.RTL, 4: Px4Mode.LAND, 5: Px4Mode.HOLD}
"""COM_OBL_RC_ACT; 0 is POSITION with a transmitter, and there is none."""
LINK_LOSS: Final = FailsafeKeys("NAV_DLL_ACT", "COM_DL_LOSS_T", "NAV_DLL_ACT", LOST_LINK)
CM: Final = 100.0
ALSO_NAMED: Final = {
    "AIRSPEED_CRUISE": ("FW_AIRSPD_TRIM", 1.0),
    "AIRSPEED_MAX": ("FW_AIRSPD_MAX", 1.0),
    "AIRSPEED_MIN": ("FW_AIRSPD_MIN", 1.0),
    "GUID_TIMEOUT": ("COM_OF_LOSS_T", 1.0),
    "LAND_SPEED": ("MPC_LAND_SPEED", CM),
    "RTL_ALT": ("RTL_RETURN_ALT", CM),
    "RTL_ALTITUDE": ("RTL_RETURN_ALT", 1.0),
    "RTL_LOIT_TIME": ("RTL_LAND_DELAY", 1000.0),
    "TKOFF_ALT": ("MIS_TAKEOFF_ALT", 1.0),
    "WPNAV_SPEED": ("MPC_XY_VEL_MAX", CM),
    "WPNAV_SPEED_DN": ("MPC_Z_VEL_MAX_DN", CM),
    "WPNAV_SPEED_UP": ("MPC_Z_VEL_MAX_UP", CM),
    "WP_LOITER_RAD": ("NAV_LOITER_RAD", 1.0),
}
"""What ArduPilot's pilots, who fly its modes, call a parameter, and what a unit of it is there."""
BY_NAME: Final = -1
"""Index of a parameter that is asked for by its name."""


def _whole(least: float, most: float, initial: float) -> ParameterKind:
    return ParameterKind(m.MAV_PARAM_TYPE_INT32, least, most, initial)


def parameters(config: VehicleConfig, cruise_mps: float) -> dict[str, ParameterKind]:
    """Return the parameters of a vehicle by their names: PX4's defaults, wide enough for its model."""
    model = config.model
    common = {
        "COM_DISARM_LAND": floating(-1, 20, 2.0),
        "COM_DISARM_PRFLT": floating(-1, 30, 10.0),
        "COM_DL_LOSS_T": _whole(5, 300, 10),
        "COM_FAIL_ACT_T": floating(0, 25, 5.0),
        "COM_OBL_RC_ACT": _whole(0, 7, 0),
        "COM_OF_LOSS_T": floating(0, 60, 1.0),
        "MAV_SYS_ID": _whole(1, 250, config.identity.system),
        "MIS_TAKEOFF_ALT": floating(0, 1000, 2.5 if model.hovers else 30.0),
        "NAV_DLL_ACT": _whole(0, 6, 0),
        "RTL_RETURN_ALT": floating(0, 1000, 30.0 if model.hovers else 100.0),
    }
    if model.hovers:
        return common | {
            "MPC_LAND_SPEED": floating(0.6, 4, 0.7),
            "MPC_TKO_SPEED": floating(1, 5, 1.5),
            "MPC_XY_CRUISE": floating(3, 20, 5.0),
            "MPC_XY_VEL_MAX": floating(0, 20, max(12.0, model.speed_max_mps)),
            "MPC_Z_VEL_MAX_DN": floating(0.5, 4, 1.5),
            "MPC_Z_VEL_MAX_UP": floating(0.5, 8, 3.0),
            "RTL_LAND_DELAY": floating(0, 100, 0.0),
        }
    return common | {
        "FW_AIRSPD_MAX": floating(0.5, 40, math.ceil(model.speed_max_mps)),
        "FW_AIRSPD_MIN": floating(0.5, 40, math.floor(model.speed_min_mps)),
        "FW_AIRSPD_TRIM": floating(0.5, 40, cruise_mps),
        "FW_R_LIM": floating(35, 65, 50.0),
        "NAV_LOITER_RAD": floating(-1000, 1000, max(80.0, LOITER_RADIUS_M)),
    }


class Px4Parameters(ParameterServer):
    """Parameters told as PX4 does: an integer's four bytes in the place of a float's."""

    def __getitem__(self, name: str) -> float:
        """Return a value, also by the name that ArduPilot's pilots have for it."""
        own, unit = ALSO_NAMED.get(name, (name, 1.0))
        return unit * self._values[own]

    def answers(self, message: Message, sender: Sender) -> list[Message]:
        """Return the answers to a message; what isn't known is told by PARAM_ERROR."""
        found = super().answers(message, sender)
        if found or not isinstance(message, (ParamRequestRead, ParamSet)):
            return found
        index = message.param_index if isinstance(message, ParamRequestRead) else BY_NAME
        unknown = m.MAV_PARAM_ERROR_DOES_NOT_EXIST
        return [ParamError(sender.system, sender.component, message.param_id, index, unknown)]

    def set(self, request: ParamSet) -> ParamValue | None:
        """Change a value that is sent as PX4 takes it, and return the new one."""
        name, value = request.param_id, request.param_value
        kind = self._kinds.get(name)
        if kind is None:
            return None
        if kind.type == m.MAV_PARAM_TYPE_INT32:
            value = float(struct.unpack("<i", struct.pack("<f", value))[0])
        if math.isfinite(value) and name not in FIXED and name != "MAV_SYS_ID":
            self._change(name, min(max(value, kind.least), kind.most))
        return self._reported(name, self._names.index(name))

    def _reported(self, name: str, index: int) -> ParamValue:  # noqa: ARG002 - always its own
        kind, value = self._kinds[name].type, self._values[name]
        if kind == m.MAV_PARAM_TYPE_INT32:
            value = float(struct.unpack("<f", struct.pack("<i", round(value)))[0])
        return ParamValue(name, value, kind, len(self._names), self._names.index(name))


class LinkLoss(GroundStationFailsafe):
    """Acts when the heartbeats of ground stations stop: HOLD, a while later what NAV_DLL_ACT says, if that is more."""

    def __init__(self, parameters: ParameterServer) -> None:
        """Wait for a first heartbeat."""
        super().__init__(parameters, LINK_LOSS)
        self._holds = False

    def heartbeat(self, system: int, now: Instant) -> None:  # noqa: ARG002 - any ground station's counts
        """Take a ground station's heartbeat."""
        self._heard, self.active, self._holds, self._known = now, False, False, STALE

    def _found(self) -> Instant:
        action = int(self._parameters["NAV_DLL_ACT"])
        if self._heard is None or not action or (self.active and not (self._holds and action in LOST_LINK)):
            return NEVER
        wait_s = self._parameters["COM_DL_LOSS_T"] + (self._parameters["COM_FAIL_ACT_T"] if self._holds else 0.0)
        return after(self._heard, wait_s)

    def due_mode(self, now: Instant) -> FlightMode | None:
        """Return the mode to change to if it acts now."""
        if now < self.deadline():
            return None
        self._known = STALE
        if self._holds:
            self._holds = False
            return LOST_LINK[int(self._parameters["NAV_DLL_ACT"])]
        self.active = self._holds = True
        return Px4Mode.HOLD

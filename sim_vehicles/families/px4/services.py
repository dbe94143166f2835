# Compiled by mypyc: it runs every tick.

"""What distinguishes an emulated PX4 from an ArduPlane: messages, parameters and failsafes.

Sources: MAVLink common message set, "HEARTBEAT", "CURRENT_MODE" and "MAV_CMD"; PX4 user guide, "Flight Modes",
"Parameter Reference" and "Safety Configuration (Failsafes)"; answers, refusals and initial state of PX4's simulator
(SIH, version 1.17, development).
"""

from __future__ import annotations

import math
import struct
from typing import Final

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, NEVER, Instant, after
from airlink.frame import Frame
from airlink.messages import Message
from airlink.messages.command import (
    CommandAck,
    CommandInt,
    CommandLong,
    MessageInterval,
    ParamError,
    ParamRequestRead,
    ParamSet,
    ParamValue,
    SetMode,
    SetPositionTargetGlobalInt,
    SetPositionTargetLocalNed,
)
from airlink.messages.mission import MissionItem, MissionItemInt
from airlink.messages.system import CurrentMode, Heartbeat, Ping
from sim_vehicles.autopilot import commands, telemetry
from sim_vehicles.autopilot.autopilot import CRITICAL, Autopilot, GivenCommand, Setpoint
from sim_vehicles.autopilot.commands import ACCEPTED, DENIED, FAILED, POSITION_IGNORED, VELOCITY_IGNORED
from sim_vehicles.autopilot.copter_pilot import CM_PER_M
from sim_vehicles.autopilot.message_handler import MessageHandler
from sim_vehicles.autopilot.missions import Sender
from sim_vehicles.autopilot.modes_and_failsafe import (
    PX4_BY_STICKS,
    STALE,
    FailsafeKeys,
    FlightMode,
    GroundStationFailsafe,
    Px4Mode,
)
from sim_vehicles.autopilot.parameters import (
    FIXED,
    LOITER_RADIUS_M,
    ParameterKind,
    ParameterServer,
    as_in_file,
    floating,
)
from sim_vehicles.autopilot.streams import SHORTEST_US, Builders
from sim_vehicles.config import VehicleConfig

SPEED, SOON, SLOW = NANOSECONDS // 50, NANOSECONDS // 4, NANOSECONDS
STREAMS: Final = {
    m.MAVLINK_MSG_ID_HEARTBEAT: SLOW,
    m.MAVLINK_MSG_ID_SYS_STATUS: SLOW,
    m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: SLOW,
    m.MAVLINK_MSG_ID_GPS_RAW_INT: SLOW,
    m.MAVLINK_MSG_ID_HOME_POSITION: 2 * SLOW,
    m.MAVLINK_MSG_ID_VFR_HUD: SOON,
    m.MAVLINK_MSG_ID_ATTITUDE: SPEED,
    m.MAVLINK_MSG_ID_LOCAL_POSITION_NED: SPEED,
    m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: SPEED,
}
"""Messages streamed to a ground station without a request, and their intervals, ns."""
FOLLOWS: Final = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | m.MAV_MODE_FLAG_STABILIZE_ENABLED
NAVIGATES: Final = FOLLOWS | m.MAV_MODE_FLAG_GUIDED_ENABLED | m.MAV_MODE_FLAG_AUTO_ENABLED
"""HEARTBEAT's flags in OFFBOARD and in autonomous modes, by which pymavlink and others recognise these."""
FLAGS: Final[dict[int, int]] = {
    **dict.fromkeys(PX4_BY_STICKS, telemetry.MODE_FLAGS),
    Px4Mode.ACRO: m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | m.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED,
    Px4Mode.OFFBOARD: FOLLOWS,
    Px4Mode.ORBIT: FOLLOWS,
}


def heartbeat(v: Autopilot) -> Message:
    """Return HEARTBEAT: ACTIVE while armed, CRITICAL in a failsafe."""
    armed = v.pilot.condition.armed
    flags = FLAGS.get(v.mode, NAVIGATES) | (m.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    up = m.MAV_STATE_STANDBY if v.armable else m.MAV_STATE_UNINIT
    state = m.MAV_STATE_CRITICAL if armed and v.in_failsafe else m.MAV_STATE_ACTIVE if armed else up
    return Heartbeat(v.mav_type, m.MAV_AUTOPILOT_PX4, flags, int(v.mode), state)


def current_mode(v: Autopilot) -> Message:
    """Return CURRENT_MODE, with the mode that was requested last."""
    return CurrentMode(0, int(v.mode), int(v.intended))


def gps_raw_int(v: Autopilot) -> Message:
    """Return GPS_RAW_INT, without a time stamp."""
    return telemetry.gps_raw_int(v).but(time_usec=0)


def vfr_hud(v: Autopilot) -> Message:
    """Return VFR_HUD; a multirotor measures no airspeed."""
    reported = telemetry.vfr_hud(v)
    return reported.but(airspeed_mps=math.nan) if v.config.model.hovers else reported


BUILDERS: Final[Builders[Autopilot]] = {
    each: telemetry.BUILDERS[each]
    for each in (
        m.MAVLINK_MSG_ID_SYS_STATUS,
        m.MAVLINK_MSG_ID_SYSTEM_TIME,
        m.MAVLINK_MSG_ID_ATTITUDE,
        m.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        m.MAVLINK_MSG_ID_MISSION_CURRENT,
        m.MAVLINK_MSG_ID_BATTERY_STATUS,
        m.MAVLINK_MSG_ID_HOME_POSITION,
        m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        m.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    )
} | {
    m.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    m.MAVLINK_MSG_ID_CURRENT_MODE: current_mode,
    m.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    m.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
}
MIN_CHANGES_US: Final = 500_000
"""Least interval of CURRENT_MODE on request; it is also sent on each change."""
REJECTED: Final = m.MAV_RESULT_TEMPORARILY_REJECTED
PX4_COMPONENTS: Final = (m.MAV_COMP_ID_ALL, m.MAV_COMP_ID_AUTOPILOT1)
WRONG_FRAME: Final = 9
"""MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME, which not every dialect names yet."""
ALL_IGNORED: Final = (
    POSITION_IGNORED
    | VELOCITY_IGNORED
    | m.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | m.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | m.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)
PX4_LOCAL_FRAMES: Final = (m.MAV_FRAME_LOCAL_NED, m.MAV_FRAME_BODY_NED)
PX4_GLOBAL_FRAMES: Final = (
    m.MAV_FRAME_GLOBAL_INT,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)


def set_interval(vehicle: Autopilot, given: GivenCommand) -> int:
    """Set a message's interval; HEARTBEAT's is fixed, and FAILED is also the answer for unknown messages.

    Intervals below the main loop's period are accepted, but a message is sent at most once per loop.
    """
    message_id, interval_us = given.params[0], given.params[1]
    if message_id == m.MAVLINK_MSG_ID_HEARTBEAT or message_id not in BUILDERS or not math.isfinite(interval_us):
        return FAILED
    if message_id == m.MAVLINK_MSG_ID_CURRENT_MODE and interval_us > 0.0:
        interval_us = max(interval_us, MIN_CHANGES_US)
    elif interval_us > 0.0:
        interval_us = max(interval_us, SHORTEST_US)
    return ACCEPTED if vehicle.streams.set_interval(int(message_id), interval_us, vehicle.now) else DENIED


def get_interval(vehicle: Autopilot, given: GivenCommand) -> int:
    """Report a message's interval; unknown messages are reported as not streamed."""
    if not 0.0 <= given.params[0] <= commands.HIGHEST_MESSAGE_ID:
        return DENIED
    message_id = int(given.params[0])
    vehicle.answer(MessageInterval(message_id, vehicle.streams.interval_us(message_id)))
    return ACCEPTED


def request_message(vehicle: Autopilot, given: GivenCommand) -> int:
    """Send a message once; unknown messages are DENIED."""
    return commands.request_message(vehicle, given) if given.params[0] in BUILDERS else DENIED


class Px4MessageHandler(MessageHandler):
    """Handles the messages with which PX4 differs: commands, SET_MODE, PING and mission items."""

    def _results_of(self, message: CommandInt | CommandLong) -> tuple[int, ...]:
        """Carry out a command; a change of mode is acknowledged twice, the first time before it is decided on.

        No vehicle answers for other components, nor an order that neither arms nor disarms.
        """
        if message.target_component not in PX4_COMPONENTS:
            return ()
        if isinstance(message, CommandInt) and message.frame != m.MAV_FRAME_GLOBAL_INT:
            return (WRONG_FRAME,)
        if message.command == m.MAV_CMD_COMPONENT_ARM_DISARM and message.param1 not in (0.0, 1.0):
            self._vehicle.say(CRITICAL, f"Unsupported ARM_DISARM param: {message.param1:.3f}")
            return ()
        results = super()._results_of(message)
        return (ACCEPTED, *results) if message.command == m.MAV_CMD_DO_SET_MODE else results

    def _take_mode(self, message: SetMode, frame: Frame) -> bool:
        """Change to a mode by SET_MODE, which is acknowledged like the command, but once."""
        allowed = super()._take_mode(message, frame)
        result = ACCEPTED if allowed else REJECTED
        self._vehicle.answer(CommandAck(m.MAV_CMD_DO_SET_MODE, result, 0, 0, frame.system, frame.component))
        return allowed

    def _take_ping(self, message: Ping, frame: Frame) -> None:
        """Answer a PING that is for everyone."""
        if not message.target_system:
            self._vehicle.answer(message.but(target_system=frame.system, target_component=frame.component))

    def _fly_to(self, item: MissionItem | MissionItemInt) -> int:  # noqa: ARG002 - none is followed
        """Refuse: PX4 knows no item that is flown at once."""
        return m.MAV_MISSION_ERROR


def refusal_of(setpoint: Setpoint) -> str | None:
    """Return the text on refusing a setpoint, None for an accepted one."""
    name, frame = setpoint.kind().name, setpoint.coordinate_frame
    if isinstance(setpoint, SetPositionTargetLocalNed) and frame not in PX4_LOCAL_FRAMES:
        return f"{name} coordinate frame {frame} unsupported"
    if isinstance(setpoint, SetPositionTargetGlobalInt) and frame not in PX4_GLOBAL_FRAMES:
        return f"{name} invalid coordinate frame {frame}"
    from_nose = frame == m.MAV_FRAME_BODY_NED and not setpoint.type_mask & POSITION_IGNORED
    return f"{name} invalid" if from_nose or setpoint.type_mask & ALL_IGNORED == ALL_IGNORED else None


LOST_LINK: Final = {2: Px4Mode.RTL, 3: Px4Mode.LAND}
"""NAV_DLL_ACT's action after some time in HOLD; 1 is HOLD, 0 does nothing."""
LOST_STREAM: Final = {0: Px4Mode.RTL, 3: Px4Mode.RTL, 4: Px4Mode.LAND, 5: Px4Mode.HOLD}
"""COM_OBL_RC_ACT; 0 would be POSITION with a transmitter, but there is none."""
LINK_LOSS: Final = FailsafeKeys("NAV_DLL_ACT", "COM_DL_LOSS_T", "NAV_DLL_ACT", LOST_LINK)
ALSO_NAMED: Final = {
    "AIRSPEED_CRUISE": ("FW_AIRSPD_TRIM", 1.0),
    "AIRSPEED_MAX": ("FW_AIRSPD_MAX", 1.0),
    "AIRSPEED_MIN": ("FW_AIRSPD_MIN", 1.0),
    "GUID_TIMEOUT": ("COM_OF_LOSS_T", 1.0),
    "LAND_SPEED": ("MPC_LAND_SPEED", CM_PER_M),
    "RTL_ALT": ("RTL_RETURN_ALT", CM_PER_M),
    "RTL_ALTITUDE": ("RTL_RETURN_ALT", 1.0),
    "RTL_LOIT_TIME": ("RTL_LAND_DELAY", 1000.0),
    "TKOFF_ALT": ("MIS_TAKEOFF_ALT", 1.0),
    "WPNAV_SPEED": ("MPC_XY_VEL_MAX", CM_PER_M),
    "WPNAV_SPEED_DN": ("MPC_Z_VEL_MAX_DN", CM_PER_M),
    "WPNAV_SPEED_UP": ("MPC_Z_VEL_MAX_UP", CM_PER_M),
    "WP_LOITER_RAD": ("NAV_LOITER_RAD", 1.0),
}
"""ArduPilot's names, used by the emulated pilots, of PX4's parameters, and ArduPilot's units in one of PX4's."""
BY_NAME: Final = -1
"""Index in a request by name."""


def _whole(minimum: float, maximum: float, initial: float) -> ParameterKind:
    return ParameterKind(m.MAV_PARAM_TYPE_INT32, minimum, maximum, initial)


def parameters(config: VehicleConfig, cruise_mps: float) -> dict[str, ParameterKind]:
    """Return a vehicle's parameters by name: a file's, else PX4's defaults, with limits wide enough for its model."""
    return as_in_file(_defaults(config, cruise_mps), config.parameters, ("MAV_SYS_ID",))


def _defaults(config: VehicleConfig, cruise_mps: float) -> dict[str, ParameterKind]:
    model = config.model
    common = {
        "COM_DISARM_LAND": floating(-1, 20, 2.0),
        "COM_DISARM_PRFLT": floating(-1, 30, 10.0),
        "COM_DL_LOSS_T": _whole(5, 300, 10),
        "COM_FAIL_ACT_T": floating(0, 25, 5.0),
        "COM_OBL_RC_ACT": _whole(0, 7, 0),
        "COM_OF_LOSS_T": floating(0, 60, 1.0),
        "GF_ACTION": _whole(0, 5, 2),
        "GF_MAX_HOR_DIST": floating(0, 10000, 0.0),
        "GF_MAX_VER_DIST": floating(0, 10000, 0.0),
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
        "FW_T_CLMB_R_SP": floating(0.5, 15, max(3.0, model.climb_max_mps)),
        "FW_T_SINK_R_SP": floating(0.5, 15, max(2.0, model.climb_max_mps)),
        "NAV_LOITER_RAD": floating(-1000, 1000, max(80.0, LOITER_RADIUS_M)),
    }


class Px4Parameters(ParameterServer):
    """Parameters in PX4's encoding: an integer's four bytes in the float field."""

    def __getitem__(self, name: str) -> float:
        """Return a value, also by ArduPilot's name and in ArduPilot's unit."""
        own, unit = ALSO_NAMED.get(name, (name, 1.0))
        return unit * self._values[own]

    def answers(self, message: Message, sender: Sender) -> list[Message]:
        """Return the answers to a message; a parameter that doesn't exist is answered by PARAM_ERROR."""
        found = super().answers(message, sender)
        if found or not isinstance(message, (ParamRequestRead, ParamSet)):
            return found
        index = message.param_index if isinstance(message, ParamRequestRead) else BY_NAME
        unknown = m.MAV_PARAM_ERROR_DOES_NOT_EXIST
        return [ParamError(sender.system, sender.component, message.param_id, index, unknown)]

    def set(self, request: ParamSet) -> ParamValue | None:
        """Change a value in PX4's encoding, and return the new one."""
        name, value = request.param_id, request.param_value
        kind = self._kinds.get(name)
        if kind is None:
            return None
        if kind.type == m.MAV_PARAM_TYPE_INT32:
            value = float(struct.unpack("<i", struct.pack("<f", value))[0])
        if math.isfinite(value) and name not in FIXED and name != "MAV_SYS_ID":
            self._change(name, min(max(value, kind.minimum), kind.maximum))
        return self._reported(name, self._names.index(name))

    def _reported(self, name: str, index: int) -> ParamValue:  # noqa: ARG002 - always its own
        kind, value = self._kinds[name].type, self._values[name]
        if kind == m.MAV_PARAM_TYPE_INT32:
            value = float(struct.unpack("<f", struct.pack("<i", round(value)))[0])
        return ParamValue(name, value, kind, len(self._names), self._names.index(name))


class LinkLoss(GroundStationFailsafe):
    """Acts when heartbeats of ground stations stop: HOLD, and some time later NAV_DLL_ACT if that asks for more."""

    def __init__(self, parameters: ParameterServer) -> None:
        """Start waiting for a first heartbeat."""
        super().__init__(parameters, LINK_LOSS)
        self._holds = False

    def heartbeat(self, system: int, now: Instant) -> None:  # noqa: ARG002 - any ground station's counts
        """Take a ground station's heartbeat."""
        self._heartbeat_at, self.active, self._holds, self._known = now, False, False, STALE

    def _found(self) -> Instant:
        action = int(self._parameters["NAV_DLL_ACT"])
        if self._heartbeat_at is None or not action or (self.active and not (self._holds and action in LOST_LINK)):
            return NEVER
        wait_s = self._parameters["COM_DL_LOSS_T"] + (self._parameters["COM_FAIL_ACT_T"] if self._holds else 0.0)
        return after(self._heartbeat_at, wait_s)

    def lost(self, now: Instant) -> bool:
        """Return whether it is to act and no ground station is received, as before the first heartbeat."""
        if not self._parameters["NAV_DLL_ACT"]:
            return False
        return self._heartbeat_at is None or now >= after(self._heartbeat_at, self._parameters["COM_DL_LOSS_T"])

    def trigger(self) -> FlightMode | None:
        """Act, once `deadline` has come; return the mode to change to."""
        self._known = STALE
        if self._holds:
            self._holds = False
            return LOST_LINK[int(self._parameters["NAV_DLL_ACT"])]
        self.active = self._holds = True
        return Px4Mode.HOLD

"""Messages that command a vehicle, set which messages it streams, and read its parameters or files (MAVLink FTP).

Source: MAVLink guide, "Command Protocol" and "Requesting Data From Vehicles".

Source: MAVLink guide, "Parameter Protocol" and "File Transfer Protocol (FTP)".
"""

from __future__ import annotations

from typing import NamedTuple


class CommandInt(NamedTuple):
    """COMMAND_INT (75): a command whose position is in scaled integers; the command defines the units."""

    target_system: int
    target_component: int
    frame: int
    command: int
    current: int = 0
    autocontinue: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0


class CommandLong(NamedTuple):
    """COMMAND_LONG (76): a command with seven float parameters; the command defines their units."""

    target_system: int
    target_component: int
    command: int
    confirmation: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    param6: float = 0.0
    param7: float = 0.0


class CommandAck(NamedTuple):
    """COMMAND_ACK (77): the result of a command (MAV_RESULT), and the system that it answers."""

    command: int
    result: int
    progress: int = 0
    result_param2: int = 0
    target_system: int = 0
    target_component: int = 0


class SetMode(NamedTuple):
    """SET_MODE (11): the predecessor of MAV_CMD_DO_SET_MODE, which ground stations still send."""

    target_system: int
    base_mode: int
    custom_mode: int


class RequestDataStream(NamedTuple):
    """REQUEST_DATA_STREAM (66): the older request for groups of messages at a rate."""

    target_system: int
    target_component: int
    req_stream_id: int
    req_message_rate: int
    start_stop: int


class MessageInterval(NamedTuple):
    """MESSAGE_INTERVAL (244): the interval at which a message is sent; 0: unavailable, -1: not sent."""

    message_id: int
    interval_us: int


class SetPositionTargetLocalNed(NamedTuple):
    """SET_POSITION_TARGET_LOCAL_NED (84): a setpoint of velocity and yaw; `type_mask` says which fields don't count."""

    time_boot_s: float
    target_system: int
    target_component: int
    coordinate_frame: int
    type_mask: int
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    vx_mps: float = 0.0
    vy_mps: float = 0.0
    vz_mps: float = 0.0
    afx_mps2: float = 0.0
    afy_mps2: float = 0.0
    afz_mps2: float = 0.0
    yaw_rad: float = 0.0
    yaw_rate_radps: float = 0.0


CommandMessage = (
    CommandInt | CommandLong | CommandAck | SetMode | RequestDataStream | MessageInterval | SetPositionTargetLocalNed
)


class ParamRequestRead(NamedTuple):
    """PARAM_REQUEST_READ (20): one parameter, by name or, where index isn't -1, by index."""

    target_system: int
    target_component: int
    param_id: str
    param_index: int = -1


class ParamRequestList(NamedTuple):
    """PARAM_REQUEST_LIST (21): all parameters."""

    target_system: int
    target_component: int


class ParamValue(NamedTuple):
    """PARAM_VALUE (22): a parameter's value, as a float whatever its type."""

    param_id: str
    param_value: float
    param_type: int
    param_count: int
    param_index: int


class ParamSet(NamedTuple):
    """PARAM_SET (23): change a parameter."""

    target_system: int
    target_component: int
    param_id: str
    param_value: float
    param_type: int


class FileTransferProtocol(NamedTuple):
    """FILE_TRANSFER_PROTOCOL (110): one packet of MAVLink FTP, as bytes."""

    target_network: int
    target_system: int
    target_component: int
    payload: tuple[int, ...]


ParameterMessage = ParamRequestRead | ParamRequestList | ParamValue | ParamSet | FileTransferProtocol

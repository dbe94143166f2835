"""Messages that command a vehicle, set which messages it streams, and read its parameters or files.

Source: MAVLink guide, "Command Protocol", "Requesting Data From Vehicles", "Parameter Protocol" and "File Transfer
Protocol (FTP)".
"""

# Written by: python -m tests.airlink.generate_messages
# A class for each message of the service, all after one plan: not edited here.

from __future__ import annotations

from typing import Final

from librt.strings import BytesWriter
from mypy_extensions import i64, mypyc_attr

from airlink.messages.payload import (
    DEGE7,
    MILLI,
    PER_DEGE7,
    PER_MILLI,
    Kind,
    Message,
    get_f32,
    get_i16,
    get_i32,
    get_octets,
    get_text,
    get_u8,
    get_u16,
    get_u32,
    put_f32,
    put_i16,
    put_i32,
    put_near_i32,
    put_near_u32,
    put_octets,
    put_text,
    put_u8,
    put_u16,
    put_u32,
)


@mypyc_attr(acyclic=True, free_list_len=1)
class CommandInt(Message):
    """COMMAND_INT (75): a command whose position is in scaled integers; the command defines the units."""

    def __init__(
        self,
        target_system: int,
        target_component: int,
        frame: int,
        command: int,
        current: int = 0,
        autocontinue: int = 0,
        param1: float = 0.0,
        param2: float = 0.0,
        param3: float = 0.0,
        param4: float = 0.0,
        x: int = 0,
        y: int = 0,
        z: float = 0.0,
    ) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.frame = frame
        self.command = command
        self.current = current
        self.autocontinue = autocontinue
        self.param1 = param1
        self.param2 = param2
        self.param3 = param3
        self.param4 = param4
        self.x = x
        self.y = y
        self.z = z

    def kind(self) -> Kind:
        return COMMAND_INT

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.param1)
        put_f32(payload, self.param2)
        put_f32(payload, self.param3)
        put_f32(payload, self.param4)
        put_i32(payload, self.x)
        put_i32(payload, self.y)
        put_f32(payload, self.z)
        put_u16(payload, self.command)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.frame)
        put_u8(payload, self.current)
        put_u8(payload, self.autocontinue)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return CommandInt(
            get_u8(frame, begin + 30, end),
            get_u8(frame, begin + 31, end),
            get_u8(frame, begin + 32, end),
            get_u16(frame, begin + 28, end),
            get_u8(frame, begin + 33, end),
            get_u8(frame, begin + 34, end),
            get_f32(frame, begin, end),
            get_f32(frame, begin + 4, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_i32(frame, begin + 16, end),
            get_i32(frame, begin + 20, end),
            get_f32(frame, begin + 24, end),
        )


COMMAND_INT: Final = Kind(
    "COMMAND_INT",
    75,
    158,
    (35, 35),
    (
        "target_system",
        "target_component",
        "frame",
        "command",
        "current",
        "autocontinue",
        "param1",
        "param2",
        "param3",
        "param4",
        "x",
        "y",
        "z",
    ),
    CommandInt(0, 0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class CommandLong(Message):
    """COMMAND_LONG (76): a command with seven float parameters; the command defines their units."""

    def __init__(
        self,
        target_system: int,
        target_component: int,
        command: int,
        confirmation: int = 0,
        param1: float = 0.0,
        param2: float = 0.0,
        param3: float = 0.0,
        param4: float = 0.0,
        param5: float = 0.0,
        param6: float = 0.0,
        param7: float = 0.0,
    ) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.command = command
        self.confirmation = confirmation
        self.param1 = param1
        self.param2 = param2
        self.param3 = param3
        self.param4 = param4
        self.param5 = param5
        self.param6 = param6
        self.param7 = param7

    def kind(self) -> Kind:
        return COMMAND_LONG

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.param1)
        put_f32(payload, self.param2)
        put_f32(payload, self.param3)
        put_f32(payload, self.param4)
        put_f32(payload, self.param5)
        put_f32(payload, self.param6)
        put_f32(payload, self.param7)
        put_u16(payload, self.command)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.confirmation)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return CommandLong(
            get_u8(frame, begin + 30, end),
            get_u8(frame, begin + 31, end),
            get_u16(frame, begin + 28, end),
            get_u8(frame, begin + 32, end),
            get_f32(frame, begin, end),
            get_f32(frame, begin + 4, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
            get_f32(frame, begin + 20, end),
            get_f32(frame, begin + 24, end),
        )


COMMAND_LONG: Final = Kind(
    "COMMAND_LONG",
    76,
    152,
    (33, 33),
    (
        "target_system",
        "target_component",
        "command",
        "confirmation",
        "param1",
        "param2",
        "param3",
        "param4",
        "param5",
        "param6",
        "param7",
    ),
    CommandLong(0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class CommandAck(Message):
    """COMMAND_ACK (77): the result of a command (MAV_RESULT), and the system that it answers."""

    def __init__(
        self,
        command: int,
        result: int,
        progress: int = 0,
        result_param2: int = 0,
        target_system: int = 0,
        target_component: int = 0,
    ) -> None:
        self.command = command
        self.result = result
        self.progress = progress
        self.result_param2 = result_param2
        self.target_system = target_system
        self.target_component = target_component

    def kind(self) -> Kind:
        return COMMAND_ACK

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.command)
        put_u8(payload, self.result)
        put_u8(payload, self.progress)
        put_i32(payload, self.result_param2)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return CommandAck(
            get_u16(frame, begin, end),
            get_u8(frame, begin + 2, end),
            get_u8(frame, begin + 3, end),
            get_i32(frame, begin + 4, end),
            get_u8(frame, begin + 8, end),
            get_u8(frame, begin + 9, end),
        )


COMMAND_ACK: Final = Kind(
    "COMMAND_ACK",
    77,
    143,
    (3, 10),
    ("command", "result", "progress", "result_param2", "target_system", "target_component"),
    CommandAck(0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class SetMode(Message):
    """SET_MODE (11): the predecessor of MAV_CMD_DO_SET_MODE, which ground stations still send."""

    def __init__(self, target_system: int, base_mode: int, custom_mode: int) -> None:
        self.target_system = target_system
        self.base_mode = base_mode
        self.custom_mode = custom_mode

    def kind(self) -> Kind:
        return SET_MODE

    def write(self, payload: BytesWriter) -> None:
        put_u32(payload, self.custom_mode)
        put_u8(payload, self.target_system)
        put_u8(payload, self.base_mode)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return SetMode(get_u8(frame, begin + 4, end), get_u8(frame, begin + 5, end), get_u32(frame, begin, end))


SET_MODE: Final = Kind("SET_MODE", 11, 89, (6, 6), ("target_system", "base_mode", "custom_mode"), SetMode(0, 0, 0))


@mypyc_attr(acyclic=True, free_list_len=1)
class RequestDataStream(Message):
    """REQUEST_DATA_STREAM (66): the older request for groups of messages at a rate."""

    def __init__(
        self, target_system: int, target_component: int, req_stream_id: int, req_message_rate: int, start_stop: int
    ) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.req_stream_id = req_stream_id
        self.req_message_rate = req_message_rate
        self.start_stop = start_stop

    def kind(self) -> Kind:
        return REQUEST_DATA_STREAM

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.req_message_rate)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.req_stream_id)
        put_u8(payload, self.start_stop)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return RequestDataStream(
            get_u8(frame, begin + 2, end),
            get_u8(frame, begin + 3, end),
            get_u8(frame, begin + 4, end),
            get_u16(frame, begin, end),
            get_u8(frame, begin + 5, end),
        )


REQUEST_DATA_STREAM: Final = Kind(
    "REQUEST_DATA_STREAM",
    66,
    148,
    (6, 6),
    ("target_system", "target_component", "req_stream_id", "req_message_rate", "start_stop"),
    RequestDataStream(0, 0, 0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MessageInterval(Message):
    """MESSAGE_INTERVAL (244): the interval at which a message is sent; 0: unavailable, -1: not sent."""

    def __init__(self, message_id: int, interval_us: int) -> None:
        self.message_id = message_id
        self.interval_us = interval_us

    def kind(self) -> Kind:
        return MESSAGE_INTERVAL

    def write(self, payload: BytesWriter) -> None:
        put_i32(payload, self.interval_us)
        put_u16(payload, self.message_id)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MessageInterval(get_u16(frame, begin + 4, end), get_i32(frame, begin, end))


MESSAGE_INTERVAL: Final = Kind(
    "MESSAGE_INTERVAL", 244, 95, (6, 6), ("message_id", "interval_us"), MessageInterval(0, 0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class SetPositionTargetLocalNed(Message):
    """SET_POSITION_TARGET_LOCAL_NED (84): a setpoint of velocity and yaw; `type_mask` says which fields don't count."""

    def __init__(
        self,
        time_boot_s: float,
        target_system: int,
        target_component: int,
        coordinate_frame: int,
        type_mask: int,
        x_m: float = 0.0,
        y_m: float = 0.0,
        z_m: float = 0.0,
        vx_mps: float = 0.0,
        vy_mps: float = 0.0,
        vz_mps: float = 0.0,
        afx_mps2: float = 0.0,
        afy_mps2: float = 0.0,
        afz_mps2: float = 0.0,
        yaw_rad: float = 0.0,
        yaw_rate_radps: float = 0.0,
    ) -> None:
        self.time_boot_s = time_boot_s
        self.target_system = target_system
        self.target_component = target_component
        self.coordinate_frame = coordinate_frame
        self.type_mask = type_mask
        self.x_m = x_m
        self.y_m = y_m
        self.z_m = z_m
        self.vx_mps = vx_mps
        self.vy_mps = vy_mps
        self.vz_mps = vz_mps
        self.afx_mps2 = afx_mps2
        self.afy_mps2 = afy_mps2
        self.afz_mps2 = afz_mps2
        self.yaw_rad = yaw_rad
        self.yaw_rate_radps = yaw_rate_radps

    def kind(self) -> Kind:
        return SET_POSITION_TARGET_LOCAL_NED

    def write(self, payload: BytesWriter) -> None:
        put_near_u32(payload, self.time_boot_s * PER_MILLI)
        put_f32(payload, self.x_m)
        put_f32(payload, self.y_m)
        put_f32(payload, self.z_m)
        put_f32(payload, self.vx_mps)
        put_f32(payload, self.vy_mps)
        put_f32(payload, self.vz_mps)
        put_f32(payload, self.afx_mps2)
        put_f32(payload, self.afy_mps2)
        put_f32(payload, self.afz_mps2)
        put_f32(payload, self.yaw_rad)
        put_f32(payload, self.yaw_rate_radps)
        put_u16(payload, self.type_mask)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.coordinate_frame)

    def boot_s(self) -> float:
        return self.time_boot_s

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return SetPositionTargetLocalNed(
            get_u32(frame, begin, end) * MILLI,
            get_u8(frame, begin + 50, end),
            get_u8(frame, begin + 51, end),
            get_u8(frame, begin + 52, end),
            get_u16(frame, begin + 48, end),
            get_f32(frame, begin + 4, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
            get_f32(frame, begin + 20, end),
            get_f32(frame, begin + 24, end),
            get_f32(frame, begin + 28, end),
            get_f32(frame, begin + 32, end),
            get_f32(frame, begin + 36, end),
            get_f32(frame, begin + 40, end),
            get_f32(frame, begin + 44, end),
        )


SET_POSITION_TARGET_LOCAL_NED: Final = Kind(
    "SET_POSITION_TARGET_LOCAL_NED",
    84,
    143,
    (53, 53),
    (
        "time_boot_s",
        "target_system",
        "target_component",
        "coordinate_frame",
        "type_mask",
        "x_m",
        "y_m",
        "z_m",
        "vx_mps",
        "vy_mps",
        "vz_mps",
        "afx_mps2",
        "afy_mps2",
        "afz_mps2",
        "yaw_rad",
        "yaw_rate_radps",
    ),
    SetPositionTargetLocalNed(0.0, 0, 0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class SetPositionTargetGlobalInt(Message):
    """SET_POSITION_TARGET_GLOBAL_INT (86): a setpoint by latitude and longitude; `type_mask` leaves fields out."""

    def __init__(
        self,
        time_boot_s: float,
        target_system: int,
        target_component: int,
        coordinate_frame: int,
        type_mask: int,
        lat_int_rad: float,
        lon_int_rad: float,
        alt_m: float,
        vx_mps: float,
        vy_mps: float,
        vz_mps: float,
        afx_mps2: float,
        afy_mps2: float,
        afz_mps2: float,
        yaw_rad: float,
        yaw_rate_radps: float,
    ) -> None:
        self.time_boot_s = time_boot_s
        self.target_system = target_system
        self.target_component = target_component
        self.coordinate_frame = coordinate_frame
        self.type_mask = type_mask
        self.lat_int_rad = lat_int_rad
        self.lon_int_rad = lon_int_rad
        self.alt_m = alt_m
        self.vx_mps = vx_mps
        self.vy_mps = vy_mps
        self.vz_mps = vz_mps
        self.afx_mps2 = afx_mps2
        self.afy_mps2 = afy_mps2
        self.afz_mps2 = afz_mps2
        self.yaw_rad = yaw_rad
        self.yaw_rate_radps = yaw_rate_radps

    def kind(self) -> Kind:
        return SET_POSITION_TARGET_GLOBAL_INT

    def write(self, payload: BytesWriter) -> None:
        put_near_u32(payload, self.time_boot_s * PER_MILLI)
        put_near_i32(payload, self.lat_int_rad * PER_DEGE7)
        put_near_i32(payload, self.lon_int_rad * PER_DEGE7)
        put_f32(payload, self.alt_m)
        put_f32(payload, self.vx_mps)
        put_f32(payload, self.vy_mps)
        put_f32(payload, self.vz_mps)
        put_f32(payload, self.afx_mps2)
        put_f32(payload, self.afy_mps2)
        put_f32(payload, self.afz_mps2)
        put_f32(payload, self.yaw_rad)
        put_f32(payload, self.yaw_rate_radps)
        put_u16(payload, self.type_mask)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.coordinate_frame)

    def boot_s(self) -> float:
        return self.time_boot_s

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return SetPositionTargetGlobalInt(
            get_u32(frame, begin, end) * MILLI,
            get_u8(frame, begin + 50, end),
            get_u8(frame, begin + 51, end),
            get_u8(frame, begin + 52, end),
            get_u16(frame, begin + 48, end),
            get_i32(frame, begin + 4, end) * DEGE7,
            get_i32(frame, begin + 8, end) * DEGE7,
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
            get_f32(frame, begin + 20, end),
            get_f32(frame, begin + 24, end),
            get_f32(frame, begin + 28, end),
            get_f32(frame, begin + 32, end),
            get_f32(frame, begin + 36, end),
            get_f32(frame, begin + 40, end),
            get_f32(frame, begin + 44, end),
        )


SET_POSITION_TARGET_GLOBAL_INT: Final = Kind(
    "SET_POSITION_TARGET_GLOBAL_INT",
    86,
    5,
    (53, 53),
    (
        "time_boot_s",
        "target_system",
        "target_component",
        "coordinate_frame",
        "type_mask",
        "lat_int_rad",
        "lon_int_rad",
        "alt_m",
        "vx_mps",
        "vy_mps",
        "vz_mps",
        "afx_mps2",
        "afy_mps2",
        "afz_mps2",
        "yaw_rad",
        "yaw_rate_radps",
    ),
    SetPositionTargetGlobalInt(0.0, 0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class ParamRequestRead(Message):
    """PARAM_REQUEST_READ (20): one parameter, by name or, where index isn't -1, by index."""

    def __init__(self, target_system: int, target_component: int, param_id: str, param_index: int = -1) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.param_id = param_id
        self.param_index = param_index

    def kind(self) -> Kind:
        return PARAM_REQUEST_READ

    def write(self, payload: BytesWriter) -> None:
        put_i16(payload, self.param_index)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_text(payload, self.param_id, 16)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return ParamRequestRead(
            get_u8(frame, begin + 2, end),
            get_u8(frame, begin + 3, end),
            get_text(frame, begin + 4, end, 16),
            get_i16(frame, begin, end),
        )


PARAM_REQUEST_READ: Final = Kind(
    "PARAM_REQUEST_READ",
    20,
    214,
    (20, 20),
    ("target_system", "target_component", "param_id", "param_index"),
    ParamRequestRead(0, 0, ""),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class ParamRequestList(Message):
    """PARAM_REQUEST_LIST (21): all parameters."""

    def __init__(self, target_system: int, target_component: int) -> None:
        self.target_system = target_system
        self.target_component = target_component

    def kind(self) -> Kind:
        return PARAM_REQUEST_LIST

    def write(self, payload: BytesWriter) -> None:
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return ParamRequestList(get_u8(frame, begin, end), get_u8(frame, begin + 1, end))


PARAM_REQUEST_LIST: Final = Kind(
    "PARAM_REQUEST_LIST", 21, 159, (2, 2), ("target_system", "target_component"), ParamRequestList(0, 0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class ParamValue(Message):
    """PARAM_VALUE (22): a parameter's value, as a float whatever its type."""

    def __init__(self, param_id: str, param_value: float, param_type: int, param_count: int, param_index: int) -> None:
        self.param_id = param_id
        self.param_value = param_value
        self.param_type = param_type
        self.param_count = param_count
        self.param_index = param_index

    def kind(self) -> Kind:
        return PARAM_VALUE

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.param_value)
        put_u16(payload, self.param_count)
        put_u16(payload, self.param_index)
        put_text(payload, self.param_id, 16)
        put_u8(payload, self.param_type)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return ParamValue(
            get_text(frame, begin + 8, end, 16),
            get_f32(frame, begin, end),
            get_u8(frame, begin + 24, end),
            get_u16(frame, begin + 4, end),
            get_u16(frame, begin + 6, end),
        )


PARAM_VALUE: Final = Kind(
    "PARAM_VALUE",
    22,
    220,
    (25, 25),
    ("param_id", "param_value", "param_type", "param_count", "param_index"),
    ParamValue("", 0.0, 0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class ParamSet(Message):
    """PARAM_SET (23): change a parameter."""

    def __init__(
        self, target_system: int, target_component: int, param_id: str, param_value: float, param_type: int
    ) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.param_id = param_id
        self.param_value = param_value
        self.param_type = param_type

    def kind(self) -> Kind:
        return PARAM_SET

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.param_value)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_text(payload, self.param_id, 16)
        put_u8(payload, self.param_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return ParamSet(
            get_u8(frame, begin + 4, end),
            get_u8(frame, begin + 5, end),
            get_text(frame, begin + 6, end, 16),
            get_f32(frame, begin, end),
            get_u8(frame, begin + 22, end),
        )


PARAM_SET: Final = Kind(
    "PARAM_SET",
    23,
    168,
    (23, 23),
    ("target_system", "target_component", "param_id", "param_value", "param_type"),
    ParamSet(0, 0, "", 0.0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class ParamError(Message):
    """PARAM_ERROR (345): why there is no such answer to a request, by MAV_PARAM_ERROR."""

    def __init__(self, target_system: int, target_component: int, param_id: str, param_index: int, error: int) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.param_id = param_id
        self.param_index = param_index
        self.error = error

    def kind(self) -> Kind:
        return PARAM_ERROR

    def write(self, payload: BytesWriter) -> None:
        put_i16(payload, self.param_index)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_text(payload, self.param_id, 16)
        put_u8(payload, self.error)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return ParamError(
            get_u8(frame, begin + 2, end),
            get_u8(frame, begin + 3, end),
            get_text(frame, begin + 4, end, 16),
            get_i16(frame, begin, end),
            get_u8(frame, begin + 20, end),
        )


PARAM_ERROR: Final = Kind(
    "PARAM_ERROR",
    345,
    209,
    (21, 21),
    ("target_system", "target_component", "param_id", "param_index", "error"),
    ParamError(0, 0, "", 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class FileTransferProtocol(Message):
    """FILE_TRANSFER_PROTOCOL (110): one packet of MAVLink FTP, as bytes."""

    def __init__(
        self, target_network: int, target_system: int, target_component: int, payload: tuple[int, ...]
    ) -> None:
        self.target_network = target_network
        self.target_system = target_system
        self.target_component = target_component
        self.payload = payload

    def kind(self) -> Kind:
        return FILE_TRANSFER_PROTOCOL

    def write(self, payload: BytesWriter) -> None:
        put_u8(payload, self.target_network)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_octets(payload, self.payload, 251)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return FileTransferProtocol(
            get_u8(frame, begin, end),
            get_u8(frame, begin + 1, end),
            get_u8(frame, begin + 2, end),
            get_octets(frame, begin + 3, end, 251),
        )


FILE_TRANSFER_PROTOCOL: Final = Kind(
    "FILE_TRANSFER_PROTOCOL",
    110,
    84,
    (254, 254),
    ("target_network", "target_system", "target_component", "payload"),
    FileTransferProtocol(0, 0, 0, ()),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class LogRequestList(Message):
    """LOG_REQUEST_LIST (117): asks for the list of stored logs."""

    def __init__(self, target_system: int, target_component: int, start: int, end: int) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.start = start
        self.end = end

    def kind(self) -> Kind:
        return LOG_REQUEST_LIST

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.start)
        put_u16(payload, self.end)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return LogRequestList(
            get_u8(frame, begin + 4, end),
            get_u8(frame, begin + 5, end),
            get_u16(frame, begin, end),
            get_u16(frame, begin + 2, end),
        )


LOG_REQUEST_LIST: Final = Kind(
    "LOG_REQUEST_LIST",
    117,
    128,
    (6, 6),
    ("target_system", "target_component", "start", "end"),
    LogRequestList(0, 0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class LogEntry(Message):
    """LOG_ENTRY (118): one stored log, of `num_logs`; there is none where that is 0."""

    def __init__(self, id: int, num_logs: int, last_log_num: int, time_utc: int, size: int) -> None:
        self.id = id
        self.num_logs = num_logs
        self.last_log_num = last_log_num
        self.time_utc = time_utc
        self.size = size

    def kind(self) -> Kind:
        return LOG_ENTRY

    def write(self, payload: BytesWriter) -> None:
        put_u32(payload, self.time_utc)
        put_u32(payload, self.size)
        put_u16(payload, self.id)
        put_u16(payload, self.num_logs)
        put_u16(payload, self.last_log_num)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return LogEntry(
            get_u16(frame, begin + 8, end),
            get_u16(frame, begin + 10, end),
            get_u16(frame, begin + 12, end),
            get_u32(frame, begin, end),
            get_u32(frame, begin + 4, end),
        )


LOG_ENTRY: Final = Kind(
    "LOG_ENTRY", 118, 56, (14, 14), ("id", "num_logs", "last_log_num", "time_utc", "size"), LogEntry(0, 0, 0, 0, 0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class LogRequestData(Message):
    """LOG_REQUEST_DATA (119): asks for `count` bytes of a stored log, from `ofs` on."""

    def __init__(self, target_system: int, target_component: int, id: int, ofs: int, count: int) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.id = id
        self.ofs = ofs
        self.count = count

    def kind(self) -> Kind:
        return LOG_REQUEST_DATA

    def write(self, payload: BytesWriter) -> None:
        put_u32(payload, self.ofs)
        put_u32(payload, self.count)
        put_u16(payload, self.id)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return LogRequestData(
            get_u8(frame, begin + 10, end),
            get_u8(frame, begin + 11, end),
            get_u16(frame, begin + 8, end),
            get_u32(frame, begin, end),
            get_u32(frame, begin + 4, end),
        )


LOG_REQUEST_DATA: Final = Kind(
    "LOG_REQUEST_DATA",
    119,
    116,
    (12, 12),
    ("target_system", "target_component", "id", "ofs", "count"),
    LogRequestData(0, 0, 0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class LogData(Message):
    """LOG_DATA (120): a part of a stored log; fewer than 90 bytes end what was asked for."""

    def __init__(self, id: int, ofs: int, count: int, data: tuple[int, ...]) -> None:
        self.id = id
        self.ofs = ofs
        self.count = count
        self.data = data

    def kind(self) -> Kind:
        return LOG_DATA

    def write(self, payload: BytesWriter) -> None:
        put_u32(payload, self.ofs)
        put_u16(payload, self.id)
        put_u8(payload, self.count)
        put_octets(payload, self.data, 90)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return LogData(
            get_u16(frame, begin + 4, end),
            get_u32(frame, begin, end),
            get_u8(frame, begin + 6, end),
            get_octets(frame, begin + 7, end, 90),
        )


LOG_DATA: Final = Kind("LOG_DATA", 120, 134, (97, 97), ("id", "ofs", "count", "data"), LogData(0, 0, 0, ()))


@mypyc_attr(acyclic=True, free_list_len=1)
class LogRequestEnd(Message):
    """LOG_REQUEST_END (122): ends the transfer of logs, and lets the vehicle log again."""

    def __init__(self, target_system: int, target_component: int) -> None:
        self.target_system = target_system
        self.target_component = target_component

    def kind(self) -> Kind:
        return LOG_REQUEST_END

    def write(self, payload: BytesWriter) -> None:
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return LogRequestEnd(get_u8(frame, begin, end), get_u8(frame, begin + 1, end))


LOG_REQUEST_END: Final = Kind(
    "LOG_REQUEST_END", 122, 203, (2, 2), ("target_system", "target_component"), LogRequestEnd(0, 0)
)

KINDS: Final = (
    COMMAND_INT,
    COMMAND_LONG,
    COMMAND_ACK,
    SET_MODE,
    REQUEST_DATA_STREAM,
    MESSAGE_INTERVAL,
    SET_POSITION_TARGET_LOCAL_NED,
    SET_POSITION_TARGET_GLOBAL_INT,
    PARAM_REQUEST_READ,
    PARAM_REQUEST_LIST,
    PARAM_VALUE,
    PARAM_SET,
    PARAM_ERROR,
    FILE_TRANSFER_PROTOCOL,
    LOG_REQUEST_LIST,
    LOG_ENTRY,
    LOG_REQUEST_DATA,
    LOG_DATA,
    LOG_REQUEST_END,
)

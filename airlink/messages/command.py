"""Messages that command a vehicle, set which messages it streams, and read its parameters or files.

Source: MAVLink guide, "Command Protocol", "Requesting Data From Vehicles", "Parameter Protocol" and "File Transfer
Protocol (FTP)".
"""

# Written by: python -m tests.airlink.generate_messages
# A class for each message of the service, all after one plan: not edited here.

from __future__ import annotations

from typing import Final

from librt.strings import BytesWriter

from airlink.messages.payload import (
    DEGE7,
    I32_MAX,
    I32_MIN,
    MILLI,
    PER_DEGE7,
    PER_MILLI,
    U32_MAX,
    Kind,
    Message,
    f32,
    i16,
    i32,
    nearest,
    octets,
    put_f32,
    put_i16,
    put_i32,
    put_octets,
    put_text,
    put_u8,
    put_u16,
    put_u32,
    text,
    u16,
    u32,
)


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


class _CommandIntKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return CommandInt(
            payload[30],
            payload[31],
            payload[32],
            u16(payload, 28),
            payload[33],
            payload[34],
            f32(payload, 0),
            f32(payload, 4),
            f32(payload, 8),
            f32(payload, 12),
            i32(payload, 16),
            i32(payload, 20),
            f32(payload, 24),
        )


COMMAND_INT: Final = _CommandIntKind(
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
    CommandInt,
)


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


class _CommandLongKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return CommandLong(
            payload[30],
            payload[31],
            u16(payload, 28),
            payload[32],
            f32(payload, 0),
            f32(payload, 4),
            f32(payload, 8),
            f32(payload, 12),
            f32(payload, 16),
            f32(payload, 20),
            f32(payload, 24),
        )


COMMAND_LONG: Final = _CommandLongKind(
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
    CommandLong,
)


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


class _CommandAckKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return CommandAck(u16(payload, 0), payload[2], payload[3], i32(payload, 4), payload[8], payload[9])


COMMAND_ACK: Final = _CommandAckKind(
    "COMMAND_ACK",
    77,
    143,
    (3, 10),
    ("command", "result", "progress", "result_param2", "target_system", "target_component"),
    CommandAck,
)


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


class _SetModeKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return SetMode(payload[4], payload[5], u32(payload, 0))


SET_MODE: Final = _SetModeKind("SET_MODE", 11, 89, (6, 6), ("target_system", "base_mode", "custom_mode"), SetMode)


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


class _RequestDataStreamKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return RequestDataStream(payload[2], payload[3], payload[4], u16(payload, 0), payload[5])


REQUEST_DATA_STREAM: Final = _RequestDataStreamKind(
    "REQUEST_DATA_STREAM",
    66,
    148,
    (6, 6),
    ("target_system", "target_component", "req_stream_id", "req_message_rate", "start_stop"),
    RequestDataStream,
)


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


class _MessageIntervalKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MessageInterval(u16(payload, 4), i32(payload, 0))


MESSAGE_INTERVAL: Final = _MessageIntervalKind(
    "MESSAGE_INTERVAL", 244, 95, (6, 6), ("message_id", "interval_us"), MessageInterval
)


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
        put_u32(payload, nearest(self.time_boot_s * PER_MILLI, 0.0, U32_MAX))
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


class _SetPositionTargetLocalNedKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return SetPositionTargetLocalNed(
            u32(payload, 0) * MILLI,
            payload[50],
            payload[51],
            payload[52],
            u16(payload, 48),
            f32(payload, 4),
            f32(payload, 8),
            f32(payload, 12),
            f32(payload, 16),
            f32(payload, 20),
            f32(payload, 24),
            f32(payload, 28),
            f32(payload, 32),
            f32(payload, 36),
            f32(payload, 40),
            f32(payload, 44),
        )


SET_POSITION_TARGET_LOCAL_NED: Final = _SetPositionTargetLocalNedKind(
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
    SetPositionTargetLocalNed,
)


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
        put_u32(payload, nearest(self.time_boot_s * PER_MILLI, 0.0, U32_MAX))
        put_i32(payload, nearest(self.lat_int_rad * PER_DEGE7, I32_MIN, I32_MAX))
        put_i32(payload, nearest(self.lon_int_rad * PER_DEGE7, I32_MIN, I32_MAX))
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


class _SetPositionTargetGlobalIntKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return SetPositionTargetGlobalInt(
            u32(payload, 0) * MILLI,
            payload[50],
            payload[51],
            payload[52],
            u16(payload, 48),
            i32(payload, 4) * DEGE7,
            i32(payload, 8) * DEGE7,
            f32(payload, 12),
            f32(payload, 16),
            f32(payload, 20),
            f32(payload, 24),
            f32(payload, 28),
            f32(payload, 32),
            f32(payload, 36),
            f32(payload, 40),
            f32(payload, 44),
        )


SET_POSITION_TARGET_GLOBAL_INT: Final = _SetPositionTargetGlobalIntKind(
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
    SetPositionTargetGlobalInt,
)


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


class _ParamRequestReadKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return ParamRequestRead(payload[2], payload[3], text(payload, 4, 16), i16(payload, 0))


PARAM_REQUEST_READ: Final = _ParamRequestReadKind(
    "PARAM_REQUEST_READ",
    20,
    214,
    (20, 20),
    ("target_system", "target_component", "param_id", "param_index"),
    ParamRequestRead,
)


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


class _ParamRequestListKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return ParamRequestList(payload[0], payload[1])


PARAM_REQUEST_LIST: Final = _ParamRequestListKind(
    "PARAM_REQUEST_LIST", 21, 159, (2, 2), ("target_system", "target_component"), ParamRequestList
)


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


class _ParamValueKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return ParamValue(text(payload, 8, 16), f32(payload, 0), payload[24], u16(payload, 4), u16(payload, 6))


PARAM_VALUE: Final = _ParamValueKind(
    "PARAM_VALUE",
    22,
    220,
    (25, 25),
    ("param_id", "param_value", "param_type", "param_count", "param_index"),
    ParamValue,
)


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


class _ParamSetKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return ParamSet(payload[4], payload[5], text(payload, 6, 16), f32(payload, 0), payload[22])


PARAM_SET: Final = _ParamSetKind(
    "PARAM_SET",
    23,
    168,
    (23, 23),
    ("target_system", "target_component", "param_id", "param_value", "param_type"),
    ParamSet,
)


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


class _FileTransferProtocolKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return FileTransferProtocol(payload[0], payload[1], payload[2], octets(payload, 3, 251))


FILE_TRANSFER_PROTOCOL: Final = _FileTransferProtocolKind(
    "FILE_TRANSFER_PROTOCOL",
    110,
    84,
    (254, 254),
    ("target_network", "target_system", "target_component", "payload"),
    FileTransferProtocol,
)


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


class _LogRequestListKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return LogRequestList(payload[4], payload[5], u16(payload, 0), u16(payload, 2))


LOG_REQUEST_LIST: Final = _LogRequestListKind(
    "LOG_REQUEST_LIST", 117, 128, (6, 6), ("target_system", "target_component", "start", "end"), LogRequestList
)


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


class _LogEntryKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return LogEntry(u16(payload, 8), u16(payload, 10), u16(payload, 12), u32(payload, 0), u32(payload, 4))


LOG_ENTRY: Final = _LogEntryKind(
    "LOG_ENTRY", 118, 56, (14, 14), ("id", "num_logs", "last_log_num", "time_utc", "size"), LogEntry
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
    FILE_TRANSFER_PROTOCOL,
    LOG_REQUEST_LIST,
    LOG_ENTRY,
)

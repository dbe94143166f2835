"""Messages by which systems show that they are there, compare their clocks and exchange text."""

# Written by: python -m tests.airlink.generate_messages
# A class for each message of the service, all after one plan: not edited here.

from __future__ import annotations

from typing import Final

from librt.strings import BytesWriter
from mypy_extensions import i64, mypyc_attr

from airlink.messages.payload import (
    MILLI,
    PER_MILLI,
    Kind,
    Message,
    get_f32,
    get_i64,
    get_octets,
    get_text,
    get_u8,
    get_u16,
    get_u32,
    get_u64,
    put_f32,
    put_i64,
    put_near_u32,
    put_octets,
    put_text,
    put_u8,
    put_u16,
    put_u32,
    put_u64,
    put_zeros,
)


@mypyc_attr(acyclic=True, free_list_len=1)
class Heartbeat(Message):
    """HEARTBEAT (0): the presence of a system, with its type and mode."""

    def __init__(
        self,
        type: int,
        autopilot: int,
        base_mode: int = 0,
        custom_mode: int = 0,
        system_status: int = 0,
        mavlink_version: int = 3,
    ) -> None:
        self.type = type
        self.autopilot = autopilot
        self.base_mode = base_mode
        self.custom_mode = custom_mode
        self.system_status = system_status
        self.mavlink_version = mavlink_version

    def kind(self) -> Kind:
        return HEARTBEAT

    def write(self, payload: BytesWriter) -> None:
        put_u32(payload, self.custom_mode)
        put_u8(payload, self.type)
        put_u8(payload, self.autopilot)
        put_u8(payload, self.base_mode)
        put_u8(payload, self.system_status)
        put_u8(payload, self.mavlink_version)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return Heartbeat(
            get_u8(frame, begin + 4, end),
            get_u8(frame, begin + 5, end),
            get_u8(frame, begin + 6, end),
            get_u32(frame, begin, end),
            get_u8(frame, begin + 7, end),
            get_u8(frame, begin + 8, end),
        )


HEARTBEAT: Final = Kind(
    "HEARTBEAT",
    0,
    50,
    (9, 9),
    ("type", "autopilot", "base_mode", "custom_mode", "system_status", "mavlink_version"),
    Heartbeat(0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class SystemTime(Message):
    """SYSTEM_TIME (2): the system's wall clock and its time since boot."""

    def __init__(self, time_unix_usec: int, time_boot_s: float) -> None:
        self.time_unix_usec = time_unix_usec
        self.time_boot_s = time_boot_s

    def kind(self) -> Kind:
        return SYSTEM_TIME

    def write(self, payload: BytesWriter) -> None:
        put_u64(payload, self.time_unix_usec)
        put_near_u32(payload, self.time_boot_s * PER_MILLI)

    def boot_s(self) -> float:
        return self.time_boot_s

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return SystemTime(get_u64(frame, begin, end), get_u32(frame, begin + 8, end) * MILLI)


SYSTEM_TIME: Final = Kind("SYSTEM_TIME", 2, 137, (12, 12), ("time_unix_usec", "time_boot_s"), SystemTime(0, 0.0))


@mypyc_attr(acyclic=True, free_list_len=1)
class Timesync(Message):
    """TIMESYNC (111): a request has tc1 = 0; the answer echoes ts1 and has the answering system's time in tc1."""

    def __init__(self, tc1_ns: int, ts1_ns: int, target_system: int = 0, target_component: int = 0) -> None:
        self.tc1_ns = tc1_ns
        self.ts1_ns = ts1_ns
        self.target_system = target_system
        self.target_component = target_component

    def kind(self) -> Kind:
        return TIMESYNC

    def write(self, payload: BytesWriter) -> None:
        put_i64(payload, self.tc1_ns)
        put_i64(payload, self.ts1_ns)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return Timesync(
            get_i64(frame, begin, end),
            get_i64(frame, begin + 8, end),
            get_u8(frame, begin + 16, end),
            get_u8(frame, begin + 17, end),
        )


TIMESYNC: Final = Kind(
    "TIMESYNC", 111, 34, (16, 18), ("tc1_ns", "ts1_ns", "target_system", "target_component"), Timesync(0, 0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class Ping(Message):
    """PING (4): a request has target 0; the answer echoes it to its sender."""

    def __init__(self, time_usec: int, seq: int, target_system: int, target_component: int) -> None:
        self.time_usec = time_usec
        self.seq = seq
        self.target_system = target_system
        self.target_component = target_component

    def kind(self) -> Kind:
        return PING

    def write(self, payload: BytesWriter) -> None:
        put_u64(payload, self.time_usec)
        put_u32(payload, self.seq)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return Ping(
            get_u64(frame, begin, end),
            get_u32(frame, begin + 8, end),
            get_u8(frame, begin + 12, end),
            get_u8(frame, begin + 13, end),
        )


PING: Final = Kind(
    "PING", 4, 237, (14, 14), ("time_usec", "seq", "target_system", "target_component"), Ping(0, 0, 0, 0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class AutopilotVersion(Message):
    """AUTOPILOT_VERSION (148): capabilities (bits of MAV_PROTOCOL_CAPABILITY) and firmware version."""

    def __init__(
        self,
        capabilities: int,
        flight_sw_version: int,
        middleware_sw_version: int = 0,
        os_sw_version: int = 0,
        board_version: int = 0,
    ) -> None:
        self.capabilities = capabilities
        self.flight_sw_version = flight_sw_version
        self.middleware_sw_version = middleware_sw_version
        self.os_sw_version = os_sw_version
        self.board_version = board_version

    def kind(self) -> Kind:
        return AUTOPILOT_VERSION

    def write(self, payload: BytesWriter) -> None:
        put_u64(payload, self.capabilities)
        put_zeros(payload, 8)
        put_u32(payload, self.flight_sw_version)
        put_u32(payload, self.middleware_sw_version)
        put_u32(payload, self.os_sw_version)
        put_u32(payload, self.board_version)
        put_zeros(payload, 46)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return AutopilotVersion(
            get_u64(frame, begin, end),
            get_u32(frame, begin + 16, end),
            get_u32(frame, begin + 20, end),
            get_u32(frame, begin + 24, end),
            get_u32(frame, begin + 28, end),
        )


AUTOPILOT_VERSION: Final = Kind(
    "AUTOPILOT_VERSION",
    148,
    178,
    (60, 78),
    ("capabilities", "flight_sw_version", "middleware_sw_version", "os_sw_version", "board_version"),
    AutopilotVersion(0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class NamedValueFloat(Message):
    """NAMED_VALUE_FLOAT (251): a named value, which autopilots write to their logs."""

    def __init__(self, time_boot_s: float, name: str, value: float) -> None:
        self.time_boot_s = time_boot_s
        self.name = name
        self.value = value

    def kind(self) -> Kind:
        return NAMED_VALUE_FLOAT

    def write(self, payload: BytesWriter) -> None:
        put_near_u32(payload, self.time_boot_s * PER_MILLI)
        put_f32(payload, self.value)
        put_text(payload, self.name, 10)

    def boot_s(self) -> float:
        return self.time_boot_s

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return NamedValueFloat(
            get_u32(frame, begin, end) * MILLI, get_text(frame, begin + 8, end, 10), get_f32(frame, begin + 4, end)
        )


NAMED_VALUE_FLOAT: Final = Kind(
    "NAMED_VALUE_FLOAT", 251, 170, (18, 18), ("time_boot_s", "name", "value"), NamedValueFloat(0.0, "", 0.0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class SetupSigning(Message):
    """SETUP_SIGNING (256): a key for signed frames; all zeros: nothing is signed any more."""

    def __init__(
        self, target_system: int, target_component: int, secret_key: tuple[int, ...], initial_timestamp: int
    ) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.secret_key = secret_key
        self.initial_timestamp = initial_timestamp

    def kind(self) -> Kind:
        return SETUP_SIGNING

    def write(self, payload: BytesWriter) -> None:
        put_u64(payload, self.initial_timestamp)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_octets(payload, self.secret_key, 32)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return SetupSigning(
            get_u8(frame, begin + 8, end),
            get_u8(frame, begin + 9, end),
            get_octets(frame, begin + 10, end, 32),
            get_u64(frame, begin, end),
        )


SETUP_SIGNING: Final = Kind(
    "SETUP_SIGNING",
    256,
    71,
    (42, 42),
    ("target_system", "target_component", "secret_key", "initial_timestamp"),
    SetupSigning(0, 0, (), 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class RadioStatus(Message):
    """RADIO_STATUS (109): a radio's signal and noise, here and at the other end, free buffer (`txbuf`, %), errors."""

    def __init__(
        self, rssi: int, remrssi: int, txbuf: int, noise: int, remnoise: int, rxerrors: int, fixed: int
    ) -> None:
        self.rssi = rssi
        self.remrssi = remrssi
        self.txbuf = txbuf
        self.noise = noise
        self.remnoise = remnoise
        self.rxerrors = rxerrors
        self.fixed = fixed

    def kind(self) -> Kind:
        return RADIO_STATUS

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.rxerrors)
        put_u16(payload, self.fixed)
        put_u8(payload, self.rssi)
        put_u8(payload, self.remrssi)
        put_u8(payload, self.txbuf)
        put_u8(payload, self.noise)
        put_u8(payload, self.remnoise)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return RadioStatus(
            get_u8(frame, begin + 4, end),
            get_u8(frame, begin + 5, end),
            get_u8(frame, begin + 6, end),
            get_u8(frame, begin + 7, end),
            get_u8(frame, begin + 8, end),
            get_u16(frame, begin, end),
            get_u16(frame, begin + 2, end),
        )


RADIO_STATUS: Final = Kind(
    "RADIO_STATUS",
    109,
    185,
    (9, 9),
    ("rssi", "remrssi", "txbuf", "noise", "remnoise", "rxerrors", "fixed"),
    RadioStatus(0, 0, 0, 0, 0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class Statustext(Message):
    """STATUSTEXT (253): a text for the operator; the chunks of a longer one share a non-zero id."""

    def __init__(self, severity: int, text: str, id: int = 0, chunk_seq: int = 0) -> None:
        self.severity = severity
        self.text = text
        self.id = id
        self.chunk_seq = chunk_seq

    def kind(self) -> Kind:
        return STATUSTEXT

    def write(self, payload: BytesWriter) -> None:
        put_u8(payload, self.severity)
        put_text(payload, self.text, 50)
        put_u16(payload, self.id)
        put_u8(payload, self.chunk_seq)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return Statustext(
            get_u8(frame, begin, end),
            get_text(frame, begin + 1, end, 50),
            get_u16(frame, begin + 51, end),
            get_u8(frame, begin + 53, end),
        )


STATUSTEXT: Final = Kind("STATUSTEXT", 253, 83, (51, 54), ("severity", "text", "id", "chunk_seq"), Statustext(0, ""))


@mypyc_attr(acyclic=True, free_list_len=1)
class CurrentMode(Message):
    """CURRENT_MODE (436): the mode, sent when it changes, and the one that was asked for."""

    def __init__(self, standard_mode: int, custom_mode: int, intended_custom_mode: int = 0) -> None:
        self.standard_mode = standard_mode
        self.custom_mode = custom_mode
        self.intended_custom_mode = intended_custom_mode

    def kind(self) -> Kind:
        return CURRENT_MODE

    def write(self, payload: BytesWriter) -> None:
        put_u32(payload, self.custom_mode)
        put_u32(payload, self.intended_custom_mode)
        put_u8(payload, self.standard_mode)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return CurrentMode(get_u8(frame, begin + 8, end), get_u32(frame, begin, end), get_u32(frame, begin + 4, end))


CURRENT_MODE: Final = Kind(
    "CURRENT_MODE", 436, 193, (9, 9), ("standard_mode", "custom_mode", "intended_custom_mode"), CurrentMode(0, 0)
)

KINDS: Final = (
    HEARTBEAT,
    SYSTEM_TIME,
    TIMESYNC,
    PING,
    AUTOPILOT_VERSION,
    NAMED_VALUE_FLOAT,
    SETUP_SIGNING,
    RADIO_STATUS,
    STATUSTEXT,
    CURRENT_MODE,
)

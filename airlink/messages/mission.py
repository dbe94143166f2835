"""Messages of the mission protocol.

The dialect declares no unit for an item's x, y and z, since they depend on the item's command and frame: they stay as
they are on the wire. An item's `current` is 1 for the one that is flown now, 2 for a position to fly to at once, which
isn't of the mission, and 3 for a height alone. Source: MAVLink guide, "Mission Protocol".
"""

# Written by: python -m tests.airlink.generate_messages
# A class for each message of the service, all after one plan: not edited here.

from __future__ import annotations

from typing import Final

from librt.strings import BytesWriter
from mypy_extensions import i64, mypyc_attr

from airlink.messages.payload import (
    Kind,
    Message,
    get_f32,
    get_i16,
    get_i32,
    get_u8,
    get_u16,
    put_f32,
    put_i16,
    put_i32,
    put_u8,
    put_u16,
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionWritePartialList(Message):
    """MISSION_WRITE_PARTIAL_LIST (38): the items from start_index to end_index will be replaced."""

    def __init__(
        self, target_system: int, target_component: int, start_index: int, end_index: int, mission_type: int = 0
    ) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.start_index = start_index
        self.end_index = end_index
        self.mission_type = mission_type

    def kind(self) -> Kind:
        return MISSION_WRITE_PARTIAL_LIST

    def write(self, payload: BytesWriter) -> None:
        put_i16(payload, self.start_index)
        put_i16(payload, self.end_index)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.mission_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionWritePartialList(
            get_u8(frame, begin + 4, end),
            get_u8(frame, begin + 5, end),
            get_i16(frame, begin, end),
            get_i16(frame, begin + 2, end),
            get_u8(frame, begin + 6, end),
        )


MISSION_WRITE_PARTIAL_LIST: Final = Kind(
    "MISSION_WRITE_PARTIAL_LIST",
    38,
    9,
    (6, 7),
    ("target_system", "target_component", "start_index", "end_index", "mission_type"),
    MissionWritePartialList(0, 0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionItem(Message):
    """MISSION_ITEM (39): an item whose position, if it has one, is in degrees."""

    def __init__(
        self,
        target_system: int,
        target_component: int,
        seq: int,
        frame: int,
        command: int,
        current: int,
        autocontinue: int,
        param1: float,
        param2: float,
        param3: float,
        param4: float,
        x: float,
        y: float,
        z: float,
        mission_type: int = 0,
    ) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.seq = seq
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
        self.mission_type = mission_type

    def kind(self) -> Kind:
        return MISSION_ITEM

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.param1)
        put_f32(payload, self.param2)
        put_f32(payload, self.param3)
        put_f32(payload, self.param4)
        put_f32(payload, self.x)
        put_f32(payload, self.y)
        put_f32(payload, self.z)
        put_u16(payload, self.seq)
        put_u16(payload, self.command)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.frame)
        put_u8(payload, self.current)
        put_u8(payload, self.autocontinue)
        put_u8(payload, self.mission_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionItem(
            get_u8(frame, begin + 32, end),
            get_u8(frame, begin + 33, end),
            get_u16(frame, begin + 28, end),
            get_u8(frame, begin + 34, end),
            get_u16(frame, begin + 30, end),
            get_u8(frame, begin + 35, end),
            get_u8(frame, begin + 36, end),
            get_f32(frame, begin, end),
            get_f32(frame, begin + 4, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_f32(frame, begin + 16, end),
            get_f32(frame, begin + 20, end),
            get_f32(frame, begin + 24, end),
            get_u8(frame, begin + 37, end),
        )


MISSION_ITEM: Final = Kind(
    "MISSION_ITEM",
    39,
    254,
    (37, 38),
    (
        "target_system",
        "target_component",
        "seq",
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
        "mission_type",
    ),
    MissionItem(0, 0, 0, 0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionRequest(Message):
    """MISSION_REQUEST (40): asks for an item, as MISSION_ITEM or MISSION_ITEM_INT."""

    def __init__(self, target_system: int, target_component: int, seq: int, mission_type: int = 0) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.seq = seq
        self.mission_type = mission_type

    def kind(self) -> Kind:
        return MISSION_REQUEST

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.seq)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.mission_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionRequest(
            get_u8(frame, begin + 2, end),
            get_u8(frame, begin + 3, end),
            get_u16(frame, begin, end),
            get_u8(frame, begin + 4, end),
        )


MISSION_REQUEST: Final = Kind(
    "MISSION_REQUEST",
    40,
    230,
    (4, 5),
    ("target_system", "target_component", "seq", "mission_type"),
    MissionRequest(0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionSetCurrent(Message):
    """MISSION_SET_CURRENT (41): continue the mission at this item."""

    def __init__(self, target_system: int, target_component: int, seq: int) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.seq = seq

    def kind(self) -> Kind:
        return MISSION_SET_CURRENT

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.seq)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionSetCurrent(
            get_u8(frame, begin + 2, end), get_u8(frame, begin + 3, end), get_u16(frame, begin, end)
        )


MISSION_SET_CURRENT: Final = Kind(
    "MISSION_SET_CURRENT", 41, 28, (4, 4), ("target_system", "target_component", "seq"), MissionSetCurrent(0, 0, 0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionCurrent(Message):
    """MISSION_CURRENT (42): the active item's number, how many there are, their state, whether the mode flies them."""

    def __init__(self, seq: int, total: int = 0, mission_state: int = 0, mission_mode: int = 0) -> None:
        self.seq = seq
        self.total = total
        self.mission_state = mission_state
        self.mission_mode = mission_mode

    def kind(self) -> Kind:
        return MISSION_CURRENT

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.seq)
        put_u16(payload, self.total)
        put_u8(payload, self.mission_state)
        put_u8(payload, self.mission_mode)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionCurrent(
            get_u16(frame, begin, end),
            get_u16(frame, begin + 2, end),
            get_u8(frame, begin + 4, end),
            get_u8(frame, begin + 5, end),
        )


MISSION_CURRENT: Final = Kind(
    "MISSION_CURRENT", 42, 28, (2, 6), ("seq", "total", "mission_state", "mission_mode"), MissionCurrent(0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionRequestList(Message):
    """MISSION_REQUEST_LIST (43): asks for the number of items of a type (MAV_MISSION_TYPE)."""

    def __init__(self, target_system: int, target_component: int, mission_type: int = 0) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.mission_type = mission_type

    def kind(self) -> Kind:
        return MISSION_REQUEST_LIST

    def write(self, payload: BytesWriter) -> None:
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.mission_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionRequestList(
            get_u8(frame, begin, end), get_u8(frame, begin + 1, end), get_u8(frame, begin + 2, end)
        )


MISSION_REQUEST_LIST: Final = Kind(
    "MISSION_REQUEST_LIST",
    43,
    132,
    (2, 3),
    ("target_system", "target_component", "mission_type"),
    MissionRequestList(0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionCount(Message):
    """MISSION_COUNT (44): how many items there are, or will be sent."""

    def __init__(self, target_system: int, target_component: int, count: int, mission_type: int = 0) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.count = count
        self.mission_type = mission_type

    def kind(self) -> Kind:
        return MISSION_COUNT

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.count)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.mission_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionCount(
            get_u8(frame, begin + 2, end),
            get_u8(frame, begin + 3, end),
            get_u16(frame, begin, end),
            get_u8(frame, begin + 4, end),
        )


MISSION_COUNT: Final = Kind(
    "MISSION_COUNT",
    44,
    221,
    (4, 5),
    ("target_system", "target_component", "count", "mission_type"),
    MissionCount(0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionClearAll(Message):
    """MISSION_CLEAR_ALL (45): delete all items."""

    def __init__(self, target_system: int, target_component: int, mission_type: int = 0) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.mission_type = mission_type

    def kind(self) -> Kind:
        return MISSION_CLEAR_ALL

    def write(self, payload: BytesWriter) -> None:
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.mission_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionClearAll(get_u8(frame, begin, end), get_u8(frame, begin + 1, end), get_u8(frame, begin + 2, end))


MISSION_CLEAR_ALL: Final = Kind(
    "MISSION_CLEAR_ALL", 45, 232, (2, 3), ("target_system", "target_component", "mission_type"), MissionClearAll(0, 0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionItemReached(Message):
    """MISSION_ITEM_REACHED (46): an item has been flown."""

    def __init__(self, seq: int) -> None:
        self.seq = seq

    def kind(self) -> Kind:
        return MISSION_ITEM_REACHED

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.seq)

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionItemReached(get_u16(frame, begin, end))


MISSION_ITEM_REACHED: Final = Kind("MISSION_ITEM_REACHED", 46, 11, (2, 2), ("seq",), MissionItemReached(0))


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionAck(Message):
    """MISSION_ACK (47): the result of a mission request (MAV_MISSION_RESULT)."""

    def __init__(self, target_system: int, target_component: int, type: int, mission_type: int = 0) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.type = type
        self.mission_type = mission_type

    def kind(self) -> Kind:
        return MISSION_ACK

    def write(self, payload: BytesWriter) -> None:
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.type)
        put_u8(payload, self.mission_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionAck(
            get_u8(frame, begin, end),
            get_u8(frame, begin + 1, end),
            get_u8(frame, begin + 2, end),
            get_u8(frame, begin + 3, end),
        )


MISSION_ACK: Final = Kind(
    "MISSION_ACK", 47, 153, (3, 4), ("target_system", "target_component", "type", "mission_type"), MissionAck(0, 0, 0)
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionRequestInt(Message):
    """MISSION_REQUEST_INT (51): asks for an item, as MISSION_ITEM_INT."""

    def __init__(self, target_system: int, target_component: int, seq: int, mission_type: int = 0) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.seq = seq
        self.mission_type = mission_type

    def kind(self) -> Kind:
        return MISSION_REQUEST_INT

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.seq)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.mission_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionRequestInt(
            get_u8(frame, begin + 2, end),
            get_u8(frame, begin + 3, end),
            get_u16(frame, begin, end),
            get_u8(frame, begin + 4, end),
        )


MISSION_REQUEST_INT: Final = Kind(
    "MISSION_REQUEST_INT",
    51,
    196,
    (4, 5),
    ("target_system", "target_component", "seq", "mission_type"),
    MissionRequestInt(0, 0, 0),
)


@mypyc_attr(acyclic=True, free_list_len=1)
class MissionItemInt(Message):
    """MISSION_ITEM_INT (73): an item whose position, if it has one, is in 1e-7 degrees."""

    def __init__(
        self,
        target_system: int,
        target_component: int,
        seq: int,
        frame: int,
        command: int,
        current: int,
        autocontinue: int,
        param1: float,
        param2: float,
        param3: float,
        param4: float,
        x: int,
        y: int,
        z: float,
        mission_type: int = 0,
    ) -> None:
        self.target_system = target_system
        self.target_component = target_component
        self.seq = seq
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
        self.mission_type = mission_type

    def kind(self) -> Kind:
        return MISSION_ITEM_INT

    def write(self, payload: BytesWriter) -> None:
        put_f32(payload, self.param1)
        put_f32(payload, self.param2)
        put_f32(payload, self.param3)
        put_f32(payload, self.param4)
        put_i32(payload, self.x)
        put_i32(payload, self.y)
        put_f32(payload, self.z)
        put_u16(payload, self.seq)
        put_u16(payload, self.command)
        put_u8(payload, self.target_system)
        put_u8(payload, self.target_component)
        put_u8(payload, self.frame)
        put_u8(payload, self.current)
        put_u8(payload, self.autocontinue)
        put_u8(payload, self.mission_type)

    def addressee(self) -> int:
        return self.target_system

    def read(self, frame: bytes, begin: i64, end: i64) -> Message:
        return MissionItemInt(
            get_u8(frame, begin + 32, end),
            get_u8(frame, begin + 33, end),
            get_u16(frame, begin + 28, end),
            get_u8(frame, begin + 34, end),
            get_u16(frame, begin + 30, end),
            get_u8(frame, begin + 35, end),
            get_u8(frame, begin + 36, end),
            get_f32(frame, begin, end),
            get_f32(frame, begin + 4, end),
            get_f32(frame, begin + 8, end),
            get_f32(frame, begin + 12, end),
            get_i32(frame, begin + 16, end),
            get_i32(frame, begin + 20, end),
            get_f32(frame, begin + 24, end),
            get_u8(frame, begin + 37, end),
        )


MISSION_ITEM_INT: Final = Kind(
    "MISSION_ITEM_INT",
    73,
    38,
    (37, 38),
    (
        "target_system",
        "target_component",
        "seq",
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
        "mission_type",
    ),
    MissionItemInt(0, 0, 0, 0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0),
)

KINDS: Final = (
    MISSION_WRITE_PARTIAL_LIST,
    MISSION_ITEM,
    MISSION_REQUEST,
    MISSION_SET_CURRENT,
    MISSION_CURRENT,
    MISSION_REQUEST_LIST,
    MISSION_COUNT,
    MISSION_CLEAR_ALL,
    MISSION_ITEM_REACHED,
    MISSION_ACK,
    MISSION_REQUEST_INT,
    MISSION_ITEM_INT,
)

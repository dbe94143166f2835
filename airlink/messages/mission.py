"""Messages of the mission protocol.

The dialect declares no unit for an item's x, y and z, since they depend on the item's command and frame: they stay as
they are on the wire. An item's `current` is 1 for the one that is flown now, 2 for a place to fly to at once, which
isn't of the mission, and 3 for a height alone. Source: MAVLink guide, "Mission Protocol".
"""

# Written by: python -m tests.airlink.generate_messages
# A class for each message of the service, all after one plan: not edited here.

from __future__ import annotations

from typing import Final

from librt.strings import BytesWriter

from airlink.messages.payload import (
    Kind,
    Message,
    f32,
    i16,
    i32,
    put_f32,
    put_i16,
    put_i32,
    put_u8,
    put_u16,
    put_zeros,
    u16,
)


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


class _MissionWritePartialListKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionWritePartialList(payload[4], payload[5], i16(payload, 0), i16(payload, 2), payload[6])


MISSION_WRITE_PARTIAL_LIST: Final = _MissionWritePartialListKind(
    "MISSION_WRITE_PARTIAL_LIST",
    38,
    9,
    (6, 7),
    ("target_system", "target_component", "start_index", "end_index", "mission_type"),
    MissionWritePartialList,
)


class MissionItem(Message):
    """MISSION_ITEM (39): an item whose place, if it has one, is in degrees."""

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


class _MissionItemKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionItem(
            payload[32],
            payload[33],
            u16(payload, 28),
            payload[34],
            u16(payload, 30),
            payload[35],
            payload[36],
            f32(payload, 0),
            f32(payload, 4),
            f32(payload, 8),
            f32(payload, 12),
            f32(payload, 16),
            f32(payload, 20),
            f32(payload, 24),
            payload[37],
        )


MISSION_ITEM: Final = _MissionItemKind(
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
    MissionItem,
)


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


class _MissionRequestKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionRequest(payload[2], payload[3], u16(payload, 0), payload[4])


MISSION_REQUEST: Final = _MissionRequestKind(
    "MISSION_REQUEST", 40, 230, (4, 5), ("target_system", "target_component", "seq", "mission_type"), MissionRequest
)


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


class _MissionSetCurrentKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionSetCurrent(payload[2], payload[3], u16(payload, 0))


MISSION_SET_CURRENT: Final = _MissionSetCurrentKind(
    "MISSION_SET_CURRENT", 41, 28, (4, 4), ("target_system", "target_component", "seq"), MissionSetCurrent
)


class MissionCurrent(Message):
    """MISSION_CURRENT (42): sequence number of the active item, number of items, and MISSION_STATE."""

    def __init__(self, seq: int, total: int = 0, mission_state: int = 0) -> None:
        self.seq = seq
        self.total = total
        self.mission_state = mission_state

    def kind(self) -> Kind:
        return MISSION_CURRENT

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.seq)
        put_u16(payload, self.total)
        put_u8(payload, self.mission_state)
        put_zeros(payload, 1)


class _MissionCurrentKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionCurrent(u16(payload, 0), u16(payload, 2), payload[4])


MISSION_CURRENT: Final = _MissionCurrentKind(
    "MISSION_CURRENT", 42, 28, (2, 6), ("seq", "total", "mission_state"), MissionCurrent
)


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


class _MissionRequestListKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionRequestList(payload[0], payload[1], payload[2])


MISSION_REQUEST_LIST: Final = _MissionRequestListKind(
    "MISSION_REQUEST_LIST", 43, 132, (2, 3), ("target_system", "target_component", "mission_type"), MissionRequestList
)


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


class _MissionCountKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionCount(payload[2], payload[3], u16(payload, 0), payload[4])


MISSION_COUNT: Final = _MissionCountKind(
    "MISSION_COUNT", 44, 221, (4, 5), ("target_system", "target_component", "count", "mission_type"), MissionCount
)


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


class _MissionClearAllKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionClearAll(payload[0], payload[1], payload[2])


MISSION_CLEAR_ALL: Final = _MissionClearAllKind(
    "MISSION_CLEAR_ALL", 45, 232, (2, 3), ("target_system", "target_component", "mission_type"), MissionClearAll
)


class MissionItemReached(Message):
    """MISSION_ITEM_REACHED (46): an item has been flown."""

    def __init__(self, seq: int) -> None:
        self.seq = seq

    def kind(self) -> Kind:
        return MISSION_ITEM_REACHED

    def write(self, payload: BytesWriter) -> None:
        put_u16(payload, self.seq)


class _MissionItemReachedKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionItemReached(u16(payload, 0))


MISSION_ITEM_REACHED: Final = _MissionItemReachedKind(
    "MISSION_ITEM_REACHED", 46, 11, (2, 2), ("seq",), MissionItemReached
)


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


class _MissionAckKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionAck(payload[0], payload[1], payload[2], payload[3])


MISSION_ACK: Final = _MissionAckKind(
    "MISSION_ACK", 47, 153, (3, 4), ("target_system", "target_component", "type", "mission_type"), MissionAck
)


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


class _MissionRequestIntKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionRequestInt(payload[2], payload[3], u16(payload, 0), payload[4])


MISSION_REQUEST_INT: Final = _MissionRequestIntKind(
    "MISSION_REQUEST_INT",
    51,
    196,
    (4, 5),
    ("target_system", "target_component", "seq", "mission_type"),
    MissionRequestInt,
)


class MissionItemInt(Message):
    """MISSION_ITEM_INT (73): an item whose place, if it has one, is in 1e-7 degrees."""

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


class _MissionItemIntKind(Kind):
    def unpack(self, payload: bytes) -> Message:
        return MissionItemInt(
            payload[32],
            payload[33],
            u16(payload, 28),
            payload[34],
            u16(payload, 30),
            payload[35],
            payload[36],
            f32(payload, 0),
            f32(payload, 4),
            f32(payload, 8),
            f32(payload, 12),
            i32(payload, 16),
            i32(payload, 20),
            f32(payload, 24),
            payload[37],
        )


MISSION_ITEM_INT: Final = _MissionItemIntKind(
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
    MissionItemInt,
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

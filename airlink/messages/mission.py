"""Messages of the mission protocol.

The dialect declares no unit for an item's x, y and z, since they depend on the item's command and frame: they stay as
they are on the wire. Source: MAVLink guide, "Mission Protocol".
"""

from typing import Generic, NamedTuple, TypeVar

Coordinate = TypeVar("Coordinate", int, float)


class MissionWritePartialList(NamedTuple):
    """MISSION_WRITE_PARTIAL_LIST (38): the items from start_index to end_index will be replaced."""

    target_system: int
    target_component: int
    start_index: int
    end_index: int
    mission_type: int = 0


class MissionRequest(NamedTuple):
    """MISSION_REQUEST (40): asks for an item, as MISSION_ITEM or MISSION_ITEM_INT."""

    target_system: int
    target_component: int
    seq: int
    mission_type: int = 0


class MissionSetCurrent(NamedTuple):
    """MISSION_SET_CURRENT (41): continue the mission at this item."""

    target_system: int
    target_component: int
    seq: int


class MissionCurrent(NamedTuple):
    """MISSION_CURRENT (42): sequence number of the active item, number of items, and MISSION_STATE."""

    seq: int
    total: int = 0
    mission_state: int = 0


class MissionRequestList(NamedTuple):
    """MISSION_REQUEST_LIST (43): asks for the number of items of a type (MAV_MISSION_TYPE)."""

    target_system: int
    target_component: int
    mission_type: int = 0


class MissionCount(NamedTuple):
    """MISSION_COUNT (44): how many items there are, or will be sent."""

    target_system: int
    target_component: int
    count: int  # pyright: ignore[reportIncompatibleMethodOverride]
    mission_type: int = 0


class MissionClearAll(NamedTuple):
    """MISSION_CLEAR_ALL (45): delete all items."""

    target_system: int
    target_component: int
    mission_type: int = 0


class MissionItemReached(NamedTuple):
    """MISSION_ITEM_REACHED (46): an item has been flown."""

    seq: int


class MissionAck(NamedTuple):
    """MISSION_ACK (47): the result of a mission request (MAV_MISSION_RESULT)."""

    target_system: int
    target_component: int
    type: int
    mission_type: int = 0


class MissionRequestInt(NamedTuple):
    """MISSION_REQUEST_INT (51): asks for an item, as MISSION_ITEM_INT."""

    target_system: int
    target_component: int
    seq: int
    mission_type: int = 0


class _Item(NamedTuple, Generic[Coordinate]):
    """What both forms of a mission item carry, in the same order."""

    target_system: int
    target_component: int
    seq: int
    frame: int
    command: int
    current: int
    """1: the item that is flown now; 2: not of the mission, a place to fly to at once; 3: likewise, a height alone."""
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: Coordinate
    y: Coordinate
    z: float
    mission_type: int = 0


class MissionItem(_Item[float]):
    """MISSION_ITEM (39): an item whose place, if it has one, is in degrees."""

    __slots__ = ()


class MissionItemInt(_Item[int]):
    """MISSION_ITEM_INT (73): an item whose place, if it has one, is in 1e-7 degrees."""

    __slots__ = ()


MissionMessage = (
    MissionWritePartialList
    | MissionItem
    | MissionRequest
    | MissionSetCurrent
    | MissionCurrent
    | MissionRequestList
    | MissionCount
    | MissionClearAll
    | MissionItemReached
    | MissionAck
    | MissionRequestInt
    | MissionItemInt
)

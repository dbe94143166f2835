"""The messages of MAVLink's mission protocol, typed as those of `airlink.messages` are.

Places are in 1e-7 degrees (integers) or in degrees (floats), or whatever the item's command makes of them: the dialect
declares no unit for them, so they stay as they are. Source: MAVLink guide, "Mission Protocol".
"""

from __future__ import annotations

from typing import NamedTuple


class MissionWritePartialList(NamedTuple):
    """MISSION_WRITE_PARTIAL_LIST (38): items from one to another, both included, will be sent anew."""

    target_system: int
    target_component: int
    start_index: int
    end_index: int
    mission_type: int = 0


class MissionItem(NamedTuple):
    """MISSION_ITEM (39): an item with its place in degrees; `current` 2 is a place to fly to now, 3 a height."""

    target_system: int
    target_component: int
    seq: int
    frame: int
    command: int
    current: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: float
    y: float
    z: float
    mission_type: int = 0


class MissionRequest(NamedTuple):
    """MISSION_REQUEST (40): send this item, as MISSION_ITEM or MISSION_ITEM_INT."""

    target_system: int
    target_component: int
    seq: int
    mission_type: int = 0


class MissionSetCurrent(NamedTuple):
    """MISSION_SET_CURRENT (41): go on with this item."""

    target_system: int
    target_component: int
    seq: int


class MissionCurrent(NamedTuple):
    """MISSION_CURRENT (42): the sequence number of the active item, how many there are, MISSION_STATE."""

    seq: int
    total: int = 0
    mission_state: int = 0


class MissionRequestList(NamedTuple):
    """MISSION_REQUEST_LIST (43): how many items there are (MAV_MISSION_TYPE)."""

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
    """MISSION_CLEAR_ALL (45): forget all items."""

    target_system: int
    target_component: int
    mission_type: int = 0


class MissionItemReached(NamedTuple):
    """MISSION_ITEM_REACHED (46): an item has been flown."""

    seq: int


class MissionAck(NamedTuple):
    """MISSION_ACK (47): what became of a mission request (MAV_MISSION_RESULT)."""

    target_system: int
    target_component: int
    type: int
    mission_type: int = 0


class MissionRequestInt(NamedTuple):
    """MISSION_REQUEST_INT (51): send this item, as MISSION_ITEM_INT."""

    target_system: int
    target_component: int
    seq: int
    mission_type: int = 0


class MissionItemInt(NamedTuple):
    """MISSION_ITEM_INT (73): an item with its place in 1e-7 degrees."""

    target_system: int
    target_component: int
    seq: int
    frame: int
    command: int
    current: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float
    mission_type: int = 0


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

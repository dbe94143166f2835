"""The MAVLink messages that we speak, typed and in SI units; a module for each of MAVLink's services.

A class is named after its message and has the fields of the XML definition in the same order, each with its SI unit
in the name: milliseconds become seconds, degE7 and cdeg radians, mm metres, cm/s metres per second. 64-bit integers and
intervals in microseconds stay integers, in the unit that their name says. Where the largest value of a 16-bit field
with a unit means "unknown", the field is NaN. Trailing fields that nothing here needs are left out and sent as 0.
"""

from typing import Final

from airlink import mavlink as m
from airlink.messages import command, mission, system, telemetry
from airlink.messages.payload import Kind, Message

KINDS: Final = {kind.message_id: kind for kind in (*system.KINDS, *telemetry.KINDS, *command.KINDS, *mission.KINDS)}
"""All kinds of messages, by id."""
for _index, _kind in enumerate(KINDS.values()):
    _kind.index = _index
_BY_ID: Final[list[Kind | None]] = [KINDS.get(message_id) for message_id in range(max(KINDS) + 1)]
MISSION_TIME: Final = "MISSION_T"
"""Name of the NAMED_VALUE_FLOAT in which the ground station sends vehicles the mission time, s."""
EKF_READY: Final = (
    m.EKF_ATTITUDE
    | m.EKF_VELOCITY_HORIZ
    | m.EKF_VELOCITY_VERT
    | m.EKF_POS_HORIZ_REL
    | m.EKF_POS_HORIZ_ABS
    | m.EKF_POS_VERT_ABS
    | m.EKF_PRED_POS_HORIZ_REL
    | m.EKF_PRED_POS_HORIZ_ABS
)
"""EKF_STATUS_FLAGS of an ArduPilot that may take off: all that flying in GUIDED needs."""

__all__ = ["EKF_READY", "KINDS", "MISSION_TIME", "Kind", "Message", "kind_of"]


def kind_of(message_id: int) -> Kind | None:
    """Return the kind with an id, None if it isn't one of ours."""
    return _BY_ID[message_id] if message_id < len(_BY_ID) else None

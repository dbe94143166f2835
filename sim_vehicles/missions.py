"""The mission protocol of a vehicle that keeps no missions: every list is empty, and stays so.

Source: MAVLink guide, "Mission Protocol".
"""

from __future__ import annotations

from airlink import mavlink as m
from airlink.messages import MissionAck, MissionClearAll, MissionCount, MissionRequestList

MissionRequest = MissionRequestList | MissionCount | MissionClearAll


def answer(request: MissionRequest, system: int, component: int) -> MissionCount | MissionAck:
    """Return the answer to a request that came from `system` and `component`."""
    if isinstance(request, MissionRequestList):
        return MissionCount(system, component, 0, request.mission_type)
    refused = isinstance(request, MissionCount) and request.count > 0
    result = m.MAV_MISSION_UNSUPPORTED if refused else m.MAV_MISSION_ACCEPTED
    return MissionAck(system, component, result, request.mission_type)

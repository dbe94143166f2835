"""Gives a simulated vehicle its mission, as a ground station would that had planned its landing.

Source: MAVLink guide, "Mission Protocol" (uploading a mission).
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Sequence
from typing import Final

from airlink import mavlink as m
from airlink.frame import FrameWriter
from airlink.messages import Message
from airlink.messages.mission import MissionAck, MissionCount, MissionItemInt, MissionRequest, MissionRequestInt
from airlink.stream_parser import StreamParser
from formation_scenario.stored_landing import LandingItem
from gcs_formation.app.sitl.simulator import SimulatorError

PLANNER: Final = (254, m.MAV_COMP_ID_MISSIONPLANNER)
"""System and component that give it, neither the station's."""
LIMIT_S: Final = 60.0
"""Time of the simulator for all of it, its boot included, s."""
RETRY_S: Final = 1.0
LOOK_S: Final = 0.1
MAX_BYTES: Final = 2048


def mission_of(system: int, landing: Sequence[LandingItem]) -> tuple[MissionItemInt, ...]:
    """Return the items of a landing as they are given to a vehicle."""
    return tuple(_message(system, seq, each) for seq, each in enumerate(landing))


def _message(system: int, seq: int, item: LandingItem) -> MissionItemInt:
    # PX4 takes commands without a position in the frame MISSION alone.
    frame = m.MAV_FRAME_MISSION if item.position_e7 is None else m.MAV_FRAME_GLOBAL_RELATIVE_ALT
    given = 0.0, item.reached_m, 0.0, 0.0
    fields = frame, item.command, 0, 1, *given, *(item.position_e7 or (0, 0)), item.height_m
    return MissionItemInt(system, m.MAV_COMP_ID_AUTOPILOT1, seq, *fields)


class Upload:
    """The planner's side: says how many items there are, gives those that are requested, and takes the answer."""

    def __init__(self, items: Sequence[MissionItemInt]) -> None:
        """Give these to the vehicle whom they are addressed to."""
        self._items = items
        self.system: int = items[0].target_system
        self.begins = MissionCount(self.system, m.MAV_COMP_ID_AUTOPILOT1, len(items))
        """To be sent until the vehicle answers."""
        self.over = False
        """Whether it has accepted them."""

    def answer(self, message: Message) -> MissionItemInt | None:
        """Return the item that a message of the vehicle requests, if it does.

        Raises:
            SimulatorError: it refuses the mission.
        """
        if isinstance(message, (MissionRequest, MissionRequestInt)):
            return self._items[message.seq] if message.seq < len(self._items) else None
        if isinstance(message, MissionAck) and message.mission_type == m.MAV_MISSION_TYPE_MISSION:
            if message.type != m.MAV_MISSION_ACCEPTED:
                found = m.name_of("MAV_MISSION_RESULT", message.type)
                raise SimulatorError(f"vehicle {self.system}: its simulator refused its mission ({found})")
            self.over = True
        return None


def give_mission(port: int, items: Sequence[MissionItemInt], clock_s: Callable[[], float]) -> None:
    """Give the vehicle behind a UDP port of this machine a mission, as soon as it answers; `clock_s` is its time, s.

    Raises:
        SimulatorError: it refuses it, or doesn't answer within `LIMIT_S`.
    """
    upload, writer, parser = Upload(items), FrameWriter(*PLANNER), StreamParser()
    began_s = next_s = clock_s()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.settimeout(LOOK_S)
        link.connect(("127.0.0.1", port))
        while not upload.over:
            now_s = clock_s()
            if now_s - began_s > LIMIT_S:
                raise SimulatorError(f"vehicle {upload.system}: its simulator took no mission within {LIMIT_S:g} s")
            if now_s >= next_s:
                next_s = now_s + RETRY_S
                _send(link, writer.encode(upload.begins))
            for frame in parser.feed(_received(link)):
                message = frame.message if frame.system == upload.system else None
                item = None if message is None else upload.answer(message)
                if item is not None:
                    next_s = now_s + RETRY_S
                    _send(link, writer.encode(item))


def _send(link: socket.socket, data: bytes) -> None:
    try:
        link.send(data)
    except ConnectionError:  # it isn't up yet; there is no time but real time to wait in until it is
        time.sleep(LOOK_S)


def _received(link: socket.socket) -> bytes:
    """Return what came, if something did; an answer that no process receives there counts as nothing."""
    try:
        return link.recv(MAX_BYTES)
    except TimeoutError:
        return b""
    except ConnectionError:  # it isn't up yet, as in `_send`
        time.sleep(LOOK_S)
        return b""

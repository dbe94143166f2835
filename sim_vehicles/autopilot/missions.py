"""One vehicle's mission: its items, and the protocol by which ground stations write and read it.

Sources: MAVLink guide, "Mission Protocol"; answers of ArduPlane 4.7, which stores items as soon as they arrive and
keeps only those parts of an item that it uses. Two differences are deliberate: heights above terrain are heights
above home (the ground is level), and commands that the emulator can't fly, such as NAV_LAND, are refused rather than
kept.

Item 0 is always home, whatever is written there. There are no fences and no rally points: their lists are always
empty, as is an emulated PX4's mission, whose items would begin with the first one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address
from airlink.messages import Message
from airlink.messages.mission import (
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionCurrent,
    MissionItem,
    MissionItemInt,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
    MissionSetCurrent,
    MissionWritePartialList,
)
from airlink.messages.system import Statustext
from flight_model.earth import GeodeticOrigin
from formation_scenario.begin_and_end import StartState
from sim_vehicles.autopilot.board_clock import NEVER

E7 = 1e7
HIGHEST_M = 2**23 / 100
"""ArduPlane keeps heights of items as 24-bit integers of centimetres."""
FRAMES = {
    m.MAV_FRAME_GLOBAL: m.MAV_FRAME_GLOBAL,
    m.MAV_FRAME_GLOBAL_INT: m.MAV_FRAME_GLOBAL,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT: m.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: m.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT: m.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    m.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: m.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}
"""Accepted frames -> the frame with which an item is read back."""
KEPT: dict[int, tuple[bool, bool, bool, bool]] = {
    m.MAV_CMD_NAV_WAYPOINT: (False, True, True, False),
    m.MAV_CMD_NAV_LOITER_UNLIM: (False, False, True, False),
    m.MAV_CMD_NAV_LOITER_TURNS: (True, False, True, True),
    m.MAV_CMD_NAV_LOITER_TIME: (True, False, False, False),
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: (False, False, False, False),
    m.MAV_CMD_NAV_TAKEOFF: (True, False, False, False),
    m.MAV_CMD_DO_JUMP: (True, True, False, False),
    m.MAV_CMD_DO_CHANGE_SPEED: (True, True, True, False),
}
"""Accepted commands -> which of their four parameters are kept; of NAV_LOITER_TIME its direction, and whole seconds."""
PLACELESS = frozenset({m.MAV_CMD_NAV_RETURN_TO_LAUNCH, m.MAV_CMD_DO_JUMP, m.MAV_CMD_DO_CHANGE_SPEED})
YAW_MAY_BE_NAN = frozenset({m.MAV_CMD_NAV_WAYPOINT, m.MAV_CMD_NAV_LOITER_UNLIM, m.MAV_CMD_NAV_TAKEOFF})
MOST_ITEMS = 655
ASK_AGAIN_S, GIVE_UP_S = 1.0, 8.0
"""Time until a missing item is requested again, and until the upload is abandoned."""
ACCEPTED = m.MAV_MISSION_ACCEPTED
PLAN = m.MAV_MISSION_TYPE_MISSION
EMPTY_LISTS = (PLAN, m.MAV_MISSION_TYPE_FENCE, m.MAV_MISSION_TYPE_RALLY)
RECEIVED = Statustext(m.MAV_SEVERITY_INFO, "Flight plan received")
GIVEN_UP = Statustext(m.MAV_SEVERITY_WARNING, "Mission upload timeout")


class Item(NamedTuple):
    """A stored item: latitude and longitude in 1e-7 degrees, height in m relative to its frame."""

    command: int
    frame: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float


def from_message(message: MissionItem | MissionItemInt) -> Item | int:
    """Return the item of a message, or the MAV_MISSION_RESULT that refuses it."""
    kept = KEPT.get(message.command)
    if kept is None:
        return m.MAV_MISSION_UNSUPPORTED
    given = message.param1, message.param2, message.param3, message.param4
    for place, value in enumerate(given):
        yaw = place == 3 and message.command in YAW_MAY_BE_NAN
        if not (math.isfinite(value) or (yaw and math.isnan(value))):
            return m.MAV_MISSION_INVALID_PARAM1 + place
    params = given[0] * kept[0], given[1] * kept[1], given[2] * kept[2], given[3] if kept[3] else 0.0
    if message.command == m.MAV_CMD_NAV_LOITER_TIME:
        params = float(int(given[0])), 0.0, -1.0 if given[2] < 0.0 else 1.0, float(given[3] > 0.0)
    if message.command in PLACELESS:
        return Item(message.command, m.MAV_FRAME_GLOBAL, params, 0, 0, 0.0)
    where = _place(message)
    return where if isinstance(where, int) else Item(message.command, FRAMES[message.frame], params, *where)


def to_message(item: Item, seq: int, system: int, component: int, *, current: bool) -> MissionItemInt:
    """Return the message with which an item is read back."""
    fields = item.frame, item.command, int(current), 1, *item.params, item.x, item.y, item.z
    return MissionItemInt(system, component, seq, *fields)


def in_degrees(message: MissionItemInt) -> MissionItem:
    """Return the older form of an item, with latitude and longitude as floats in degrees."""
    fields: dict[str, Any] = message.values() | {"x": message.x / E7, "y": message.y / E7}
    return MissionItem(**fields)


def _place(message: MissionItem | MissionItemInt) -> tuple[int, int, float] | int:
    """Return latitude, longitude in 1e-7 degrees and height, or the MAV_MISSION_RESULT that refuses them."""
    if message.frame not in FRAMES:
        return m.MAV_MISSION_UNSUPPORTED_FRAME
    scale = 1.0 if isinstance(message, MissionItemInt) else E7
    lat, lon = message.x * scale, message.y * scale
    if not abs(lat) <= 90 * E7:
        return m.MAV_MISSION_INVALID_PARAM5_X
    if not abs(lon) <= 180 * E7:
        return m.MAV_MISSION_INVALID_PARAM6_Y
    if not abs(message.z) <= HIGHEST_M:
        return m.MAV_MISSION_INVALID_PARAM7
    return round(lat), round(lon), message.z


class Sender(NamedTuple):
    """The sender of a request: the address and the component to answer."""

    peer: Address
    system: int
    component: int


@dataclass
class Upload:
    """An upload in progress."""

    sender: Sender
    seq: int
    """The item that is being requested."""
    last: int
    ask_again: Instant
    give_up: Instant


def home_of(start: StartState, origin: GeodeticOrigin) -> Item:
    """Return home, where a vehicle starts, as its mission's first item."""
    lat_rad, lon_rad, alt_m = origin.from_ned(start.north_m, start.east_m, 0.0)
    x, y = (round(math.degrees(each) * E7) for each in (lat_rad, lon_rad))
    return Item(m.MAV_CMD_NAV_WAYPOINT, m.MAV_FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), x, y, alt_m)


class Missions:
    """The stored items, the number of the current one, and the upload in progress, if any."""

    def __init__(self, home: Callable[[], Item], *, stored: bool) -> None:
        """Start with home alone; `stored`: whether more can be written."""
        self._stored = stored
        self.items: list[Item] = [home()]
        self.current: int
        """Number of the current item; 0 before the mission has begun and after it has ended."""
        self.state: int
        """MISSION_STATE, as long as there are items."""
        self._home = home
        self.restart()

    def restart(self) -> None:
        """Start afresh, as after power-up; the items are kept."""
        self.current, self.state = 0, m.MISSION_STATE_NOT_STARTED
        self._upload: Upload | None = None

    @property
    def flyable(self) -> bool:
        """Whether there is more than home."""
        return len(self.items) > 1

    def reported(self) -> MissionCurrent:
        """Return MISSION_CURRENT: the item that it flies to, and how many there are."""
        state = self.state if self.flyable else m.MISSION_STATE_NO_MISSION
        return MissionCurrent(self.current, max(0, len(self.items) - 1), state)

    def choose(self, seq: float) -> bool:
        """Make an item the current one, the first for 0; return False if there is no item of that number."""
        if not 0 <= seq < len(self.items) or not self.flyable:
            return False
        self.current = max(1, int(seq))
        return True

    def take(self, message: Message, sender: Sender, now: Instant) -> list[Message]:
        """Return the answers to a message."""
        kind = getattr(message, "mission_type", PLAN)
        if kind != PLAN or not self._stored:
            return _answer_of_empty_list(message, kind, sender)
        match message:
            case MissionRequestList() | MissionRequestInt() | MissionRequest():
                return self._read(message, sender)
            case MissionCount() | MissionClearAll() | MissionWritePartialList():
                return self._begin(message, sender, now)
            case MissionItem() | MissionItemInt():
                return self._write(message, sender, now)
            case MissionSetCurrent(seq=seq):
                return [self.reported().but(seq=seq)] if self.choose(seq) else []
            case _:
                return []

    def next_due(self) -> Instant:
        """Return when an upload in progress next needs attention."""
        return NEVER if self._upload is None else min(self._upload.ask_again, self._upload.give_up)

    def reminders(self, now: Instant) -> list[tuple[Address, Message]]:
        """Return the messages to send because an item is missing, each with its receiver."""
        upload = self._upload
        if upload is None or now < self.next_due():
            return []
        peer = upload.sender.peer
        if now >= upload.give_up:
            self._upload = None
            return [(peer, _ack(upload.sender, m.MAV_MISSION_OPERATION_CANCELLED)), (peer, GIVEN_UP)]
        return [(peer, self._ask(upload, now))]

    def _read(self, request: MissionRequestList | MissionRequestInt | MissionRequest, sender: Sender) -> list[Message]:
        count, integers = self._count(sender), isinstance(request, MissionRequestInt)
        if self._upload:
            return [_ack(sender, m.MAV_MISSION_DENIED)]
        if isinstance(request, MissionRequestList):
            return [count]
        if request.seq >= max(1, len(self.items)):
            refusal = _ack(sender, m.MAV_MISSION_INVALID_SEQUENCE)
            return [count, refusal] if integers else [refusal]
        item = self.items[request.seq] if request.seq else self._home()
        current = 0 < request.seq == self.current
        reported = to_message(item, request.seq, sender.system, sender.component, current=current)
        return [reported if integers else in_degrees(reported)]

    def _begin(
        self, message: MissionCount | MissionClearAll | MissionWritePartialList, sender: Sender, now: Instant
    ) -> list[Message]:
        """Start an upload of all items or of a part, or clear the list; only its sender may restart an upload."""
        refusal = self._refusal(message, sender)
        if refusal is not None:
            return [_ack(sender, refusal)]
        self._upload = None
        if isinstance(message, MissionWritePartialList):
            first, last = message.start_index, message.end_index
            if not 0 <= first <= last <= len(self.items):
                return [_ack(sender, m.MAV_MISSION_ERROR)]
            return [self._ask(Upload(sender, first, last, now, now), now, fresh=True)]
        count = message.count if isinstance(message, MissionCount) else 0
        if count > MOST_ITEMS:
            return [_ack(sender, m.MAV_MISSION_NO_SPACE)]
        self._shorten(count)
        if count:
            return [self._ask(Upload(sender, 0, count - 1, now, now), now, fresh=True)]
        return [_ack(sender, ACCEPTED), *([RECEIVED] if isinstance(message, MissionCount) else [])]

    def _refusal(self, message: MissionCount | MissionClearAll | MissionWritePartialList, sender: Sender) -> int | None:
        """Return why the list can't be changed: somebody uploads one, or it is being flown and can't be cleared."""
        if self._upload and (isinstance(message, MissionWritePartialList) or self._upload.sender[1:] != sender[1:]):
            return m.MAV_MISSION_DENIED
        flown = self.state == m.MISSION_STATE_ACTIVE and isinstance(message, MissionClearAll)
        return m.MAV_MISSION_ERROR if flown else None

    def _write(self, message: MissionItem | MissionItemInt, sender: Sender, now: Instant) -> list[Message]:
        upload = self._upload
        if upload is None:
            return [_ack(sender, m.MAV_MISSION_ERROR)]
        if message.seq != upload.seq:
            return [_ack(sender, m.MAV_MISSION_INVALID_SEQUENCE)]
        if upload.sender[1:] != sender[1:]:
            return [_ack(sender, m.MAV_MISSION_DENIED)]
        item = from_message(message)
        if not isinstance(item, Item):
            self._upload = None
            return [_ack(sender, item)]
        self.items[message.seq : message.seq + 1] = [item]
        upload.seq += 1
        if upload.seq <= upload.last:
            return [self._ask(upload, now, fresh=True)]
        self._upload = None
        return [_ack(sender, ACCEPTED), RECEIVED]

    def _shorten(self, count: int) -> None:
        del self.items[count:]
        if self.current >= len(self.items):
            self.current, self.state = 0, m.MISSION_STATE_NOT_STARTED

    def _ask(self, upload: Upload, now: Instant, *, fresh: bool = False) -> MissionRequest:
        """Return the request for the next item; `fresh`: it is requested for the first time."""
        self._upload, upload.ask_again = upload, after(now, ASK_AGAIN_S)
        if fresh:
            upload.give_up = after(now, GIVE_UP_S)
        return MissionRequest(upload.sender.system, upload.sender.component, upload.seq)

    def _count(self, sender: Sender) -> MissionCount:
        return MissionCount(sender.system, sender.component, len(self.items))


def _ack(sender: Sender, result: int, kind: int = PLAN) -> MissionAck:
    return MissionAck(sender.system, sender.component, result, kind)


def _answer_of_empty_list(message: Message, kind: int, sender: Sender) -> list[Message]:
    """Return the answers about a list that nothing is written to."""
    match message:
        case MissionRequestList() if kind in EMPTY_LISTS:
            return [MissionCount(sender.system, sender.component, 0, kind)]
        case MissionClearAll() | MissionCount(count=0) if kind in EMPTY_LISTS:
            return [_ack(sender, ACCEPTED, kind)]
        case MissionRequest() | MissionRequestInt() if kind in EMPTY_LISTS:
            return [_ack(sender, m.MAV_MISSION_INVALID_SEQUENCE, kind)]
        case (
            MissionRequestList()
            | MissionClearAll()
            | MissionCount()
            | MissionRequest()
            | MissionRequestInt()
            | MissionWritePartialList()
            | MissionItem()
            | MissionItemInt()
        ):
            return [_ack(sender, m.MAV_MISSION_UNSUPPORTED, kind)]
        case _:
            return []

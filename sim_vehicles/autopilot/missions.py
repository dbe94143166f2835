"""One vehicle's mission: its items, and the protocol with which ground stations write and read it.

Sources: MAVLink guide, "Mission Protocol"; answers of ArduPlane 4.7, which stores items as soon as they arrive.

Item 0 is always home, whatever is written there. Fences and rally points aren't supported: their lists are always
empty, as is an emulated PX4's mission, whose items would be numbered from the first one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after
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
from formation_scenario.start_states import StartState
from sim_vehicles.autopilot.mission_items import E7, Item, from_message, in_degrees, to_message

MAX_ITEMS = 655
ASK_AGAIN_S, GIVE_UP_S = 1.0, 8.0
"""Time until a missing item is requested again, and until the upload is abandoned."""
ACCEPTED = m.MAV_MISSION_ACCEPTED
PLAN = m.MAV_MISSION_TYPE_MISSION
EMPTY_LISTS = (PLAN, m.MAV_MISSION_TYPE_FENCE, m.MAV_MISSION_TYPE_RALLY)
RECEIVED = Statustext(m.MAV_SEVERITY_INFO, "Flight plan received")
GIVEN_UP = Statustext(m.MAV_SEVERITY_WARNING, "Mission upload timeout")


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
    """Number of the requested item."""
    last: int
    ask_again: Instant
    give_up: Instant


def home_of(start: StartState, origin: GeodeticOrigin) -> Item:
    """Return home, the vehicle's starting position, as its mission's first item."""
    lat_rad, lon_rad, alt_m = origin.from_ned(start.north_m, start.east_m, 0.0)
    x, y = (round(math.degrees(each) * E7) for each in (lat_rad, lon_rad))
    return Item(m.MAV_CMD_NAV_WAYPOINT, m.MAV_FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), x, y, alt_m)


class Missions:
    """The stored items, the number of the current one, and the upload in progress, if any."""

    def __init__(self, home: Item, *, stored: bool) -> None:
        """Start with home only; `stored`: whether items can be written."""
        self._home, self._stored = home, stored
        self.items: list[Item] = [home]
        self.current: int
        """Number of the current item, the last one after the mission's end; 0 before the mission has begun."""
        self.state: int
        """MISSION_STATE if there are items; an interrupted mission is NOT_STARTED."""
        self.in_mode: bool
        """Whether the vehicle's mode is the one that flies missions."""
        self.restart()

    def restart(self) -> None:
        """Start afresh, as after power-up; the items are kept."""
        self.current, self.state, self.in_mode = 0, m.MISSION_STATE_NOT_STARTED, False
        self._upload: Upload | None = None

    @property
    def flyable(self) -> bool:
        """Whether there are items besides home."""
        return len(self.items) > 1

    def reported(self) -> MissionCurrent:
        """Return MISSION_CURRENT: the current item, the number of items, and whether the mission is being flown."""
        state = self.state if self.flyable else m.MISSION_STATE_NO_MISSION
        return MissionCurrent(self.current, max(0, len(self.items) - 1), state, int(self.in_mode))

    def choose(self, seq: float) -> bool:
        """Make an item the current one, for 0 the first; return False if there is no such item."""
        if not 0 <= seq < len(self.items) or not self.flyable:
            return False
        self.current = max(1, int(seq))
        if self.state == m.MISSION_STATE_COMPLETE:
            self.state = m.MISSION_STATE_NOT_STARTED
        return True

    def choose_landing(self) -> bool:
        """Make the item where the landing begins the current one; return whether there is one."""
        begins = (seq for seq, item in enumerate(self.items) if item.command == m.MAV_CMD_DO_LAND_START)
        return self.choose(next(begins, -1))

    def handle(self, message: Message, sender: Sender, now: Instant) -> list[Message]:
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
        """Return repeated requests for missing items, each with its receiver."""
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
        item = self.items[request.seq] if request.seq else self._home
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
        if count > MAX_ITEMS:
            return [_ack(sender, m.MAV_MISSION_NO_SPACE)]
        del self.items[count:]
        if isinstance(message, MissionClearAll):
            self.current, self.state = 0, m.MISSION_STATE_NOT_STARTED
        if count:
            return [self._ask(Upload(sender, 0, count - 1, now, now), now, fresh=True)]
        return [_ack(sender, ACCEPTED), *([RECEIVED] if isinstance(message, MissionCount) else [])]

    def _refusal(self, message: MissionCount | MissionClearAll | MissionWritePartialList, sender: Sender) -> int | None:
        """Return why the list can't be changed: somebody else uploads, or clears it while it is flown; else None."""
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
    """Return the answers about a list that can't be written to."""
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

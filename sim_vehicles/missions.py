"""One vehicle's mission, and the protocol by which ground stations write and read it.

Item 0 is always home, whatever is written there. There are no fences and no rally points: their lists are always empty.
Sources: MAVLink guide, "Mission Protocol"; answers of ArduPlane 4.7, which stores items as soon as they arrive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

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
    MissionMessage,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
    MissionSetCurrent,
    MissionWritePartialList,
)
from airlink.messages.system import Statustext
from sim_vehicles.loop import NEVER
from sim_vehicles.mission_items import Item, from_message, in_degrees, to_message

MOST_ITEMS = 655
ASK_AGAIN_S, GIVE_UP_S = 1.0, 8.0
"""Time until a missing item is requested again, and until the upload is abandoned."""
ACCEPTED = m.MAV_MISSION_ACCEPTED
PLAN, EMPTY_LISTS = m.MAV_MISSION_TYPE_MISSION, (m.MAV_MISSION_TYPE_FENCE, m.MAV_MISSION_TYPE_RALLY)
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
    """The item that is being requested."""
    last: int
    ask_again: Instant
    give_up: Instant


class Missions:
    """The stored items, the number of the current one, and the upload in progress, if any."""

    def __init__(self, home: Callable[[], Item]) -> None:
        """Start with home alone."""
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

    def told(self) -> MissionCurrent:
        """Return MISSION_CURRENT."""
        state = self.state if self.flyable else m.MISSION_STATE_NO_MISSION
        return MissionCurrent(self.current, max(0, len(self.items) - 1), state)

    def choose(self, seq: float) -> bool:
        """Make an item the current one, the first for 0; return False if there is no item of that number."""
        if not 0 <= seq < len(self.items) or not self.flyable:
            return False
        self.current = max(1, int(seq))
        return True

    def take(self, message: MissionMessage, sender: Sender, now: Instant) -> list[Message]:
        """Return the answers to a message."""
        kind = getattr(message, "mission_type", PLAN)
        if kind != PLAN:
            return _answer_of_empty_list(message, kind, sender)
        match message:
            case MissionRequestList() | MissionRequestInt() | MissionRequest():
                return self._read(message, sender)
            case MissionCount() | MissionClearAll() | MissionWritePartialList():
                return self._begin(message, sender, now)
            case MissionItem() | MissionItemInt():
                return self._write(message, sender, now)
            case MissionSetCurrent(seq=seq):
                return [self.told()._replace(seq=seq)] if self.choose(seq) else []
            case _:
                return []

    def next_due(self) -> Instant:
        """Return when an upload in progress next needs attention."""
        return NEVER if self._upload is None else min(self._upload.ask_again, self._upload.give_up)

    def remind(self, now: Instant) -> tuple[Address, list[Message]] | None:
        """Return the messages to send because an item is missing, and their receiver."""
        upload = self._upload
        if upload is None or now < self.next_due():
            return None
        if now >= upload.give_up:
            self._upload = None
            return upload.sender.peer, [_ack(upload.sender, m.MAV_MISSION_OPERATION_CANCELLED), GIVEN_UP]
        return upload.sender.peer, [self._ask(upload, now)]

    def _read(self, request: MissionRequestList | MissionRequestInt | MissionRequest, sender: Sender) -> list[Message]:
        count, integers = self._count(sender), isinstance(request, MissionRequestInt)
        if self._upload:
            return [_ack(sender, m.MAV_MISSION_DENIED)]
        if isinstance(request, MissionRequestList):
            return [count]
        if request.seq >= len(self.items):
            refusal = _ack(sender, m.MAV_MISSION_INVALID_SEQUENCE)
            return [count, refusal] if integers else [refusal]
        item = self.items[request.seq] if request.seq else self._home()
        current = 0 < request.seq == self.current
        told = to_message(item, request.seq, sender.system, sender.component, current=current)
        return [told if integers else in_degrees(told)]

    def _begin(
        self, message: MissionCount | MissionClearAll | MissionWritePartialList, sender: Sender, now: Instant
    ) -> list[Message]:
        """Start an upload of all items or of a part, or clear the list; only its sender may restart an upload."""
        partial = isinstance(message, MissionWritePartialList)
        if self._upload and (partial or self._upload.sender[1:] != sender[1:]):
            return [_ack(sender, m.MAV_MISSION_DENIED)]
        self._upload = None
        if partial:
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


def _answer_of_empty_list(message: MissionMessage, kind: int, sender: Sender) -> list[Message]:
    """Return the answers about a list other than the plan."""
    match message:
        case MissionAck():
            return []
        case MissionRequestList() if kind in EMPTY_LISTS:
            return [MissionCount(sender.system, sender.component, 0, kind)]
        case MissionClearAll() | MissionCount(count=0) if kind in EMPTY_LISTS:
            return [_ack(sender, ACCEPTED, kind)]
        case MissionRequest() | MissionRequestInt() if kind in EMPTY_LISTS:
            return [_ack(sender, m.MAV_MISSION_INVALID_SEQUENCE, kind)]
        case _:
            return [_ack(sender, m.MAV_MISSION_UNSUPPORTED, kind)]

# Compiled by mypyc: it runs every tick.
"""The mission of an emulated PX4: it is read, numbered from its first item, and can't be written."""

from __future__ import annotations

from airlink.clock import Instant
from airlink.messages import Message
from airlink.messages.mission import MissionCount, MissionRequest, MissionRequestInt, MissionRequestList
from sim_vehicles.autopilot.mission_items import Item, in_degrees, to_message
from sim_vehicles.autopilot.missions import PLAN, Missions, Sender


class Px4Missions(Missions):
    """A mission without home: what ArduPilots have as item 1 is a PX4's item 0."""

    def __init__(self, home: Item) -> None:
        """Begin without items; `home` stands before them here, but isn't sent."""
        super().__init__(home, stored=False)

    def handle(self, message: Message, sender: Sender, now: Instant) -> list[Message]:
        """Return the answers to a message: items that there are, and otherwise those of an empty list."""
        kind = getattr(message, "mission_type", PLAN)
        if self.flyable and kind == PLAN:
            if isinstance(message, MissionRequestList):
                return [MissionCount(sender.system, sender.component, len(self.items) - 1)]
            if isinstance(message, (MissionRequestInt, MissionRequest)) and message.seq < len(self.items) - 1:
                return [self._requested(message, sender)]
        return super().handle(message, sender, now)

    def _requested(self, asked: MissionRequestInt | MissionRequest, sender: Sender) -> Message:
        item, current = self.items[asked.seq + 1], asked.seq + 1 == self.current
        answer = to_message(item, asked.seq, sender.system, sender.component, current=current)
        return answer if isinstance(asked, MissionRequestInt) else in_degrees(answer)

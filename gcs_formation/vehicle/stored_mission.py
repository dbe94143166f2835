"""Reads the landing of a vehicle's stored mission: where it touches down, and from where it approaches.

Sources: MAVLink guide, "Mission Protocol"; ArduPilot documentation, "Using DO_LAND_START"; PX4 user guide, "Mission
Mode" (landing pattern of fixed wings, whose landing begins at DO_LAND_START or at NAV_LAND itself).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import ComponentId
from airlink.messages import Message
from airlink.messages.mission import MissionAck, MissionCount, MissionItemInt, MissionRequestInt, MissionRequestList
from flight_model.earth import GeodeticOrigin

RETRY_S: Final = 1.0
TRIES: Final = 16
"""Requests without an answer until a vehicle counts as one without a mission."""
E7_RAD: Final = math.radians(1e-7)
FLOWN: Final = frozenset({m.MAV_CMD_NAV_WAYPOINT, m.MAV_CMD_NAV_LOITER_TO_ALT, m.MAV_CMD_NAV_LOITER_TURNS})
"""Items that an approach may begin with, or lead through."""
ABOVE_SEA: Final = (m.MAV_FRAME_GLOBAL, m.MAV_FRAME_GLOBAL_INT)


class LandingSequence(NamedTuple):
    """A landing by a stored mission."""

    north_m: float
    east_m: float
    """Where it touches down, from the origin."""
    course_rad: float
    """Course of its final approach."""
    approach_m: float
    """Greatest height above home at which it is flown."""


class StoredMission:
    """Asks one vehicle for its mission, item by item."""

    def __init__(self, system: int, station: ComponentId, origin: GeodeticOrigin, *, needs_mark: bool) -> None:
        """Prepare requests of `station` to `system`; `needs_mark`: only by DO_LAND_START a mission has a landing."""
        self._system, self._station, self._origin, self._needs_mark = system, station, origin, needs_mark
        self._items, self._count = dict[int, MissionItemInt](), -1
        self._tries, self._next, self._thanked = 0, Instant(0), False

    @property
    def complete(self) -> bool:
        """Whether all is read, or the vehicle doesn't answer."""
        return len(self._items) == self._count or self._tries >= TRIES

    def requests(self, now: Instant) -> list[Message]:
        """Return the request to send now, if one is due, and at the end the acknowledgement."""
        if self.complete:
            return self._thanks()
        if now < self._next:
            return []
        self._next = after(now, RETRY_S)
        self._tries += 1
        if self._count < 0:
            return [MissionRequestList(self._system, m.MAV_COMP_ID_AUTOPILOT1)]
        return [MissionRequestInt(self._system, m.MAV_COMP_ID_AUTOPILOT1, self._missing())]

    def handle(self, message: Message, now: Instant) -> None:
        """Take the number of items, or one; the next one is requested at once.

        Another number is that of another mission, whose items all have to come. What isn't of a mission (a fence, rally
        points), or answers another station, is ignored.
        """
        before = len(self._items), self._count
        if self.complete or not isinstance(message, (MissionCount, MissionItemInt)) or not self._answers_us(message):
            return
        if isinstance(message, MissionItemInt):
            if message.seq < self._count:
                self._items[message.seq] = message
        elif message.count != self._count:
            self._items.clear()
            self._count = message.count
        if (len(self._items), self._count) != before:
            self._tries, self._next = 0, now

    def landing(self, home_above_sea_m: float) -> LandingSequence | None:
        """Return its landing, None without one; `home_above_sea_m` is where relative heights begin."""
        items = [self._items[seq] for seq in sorted(self._items)]
        if len(items) != self._count:
            return None
        marks = [seq for seq, item in enumerate(items) if item.command == m.MAV_CMD_DO_LAND_START]
        if self._needs_mark and not marks:
            return None
        first = marks[0] if marks else 0
        lands = next((seq for seq, item in enumerate(items[first:], first) if item.command == m.MAV_CMD_NAV_LAND), None)
        if lands is None:
            return None
        waypoints = [item for item in items[first if marks else max(0, lands - 1) : lands] if item.command in FLOWN]
        return self._sequence(items[lands], waypoints, home_above_sea_m) if waypoints else None

    def _answers_us(self, message: MissionCount | MissionItemInt) -> bool:
        ours = self._station
        ours_or_all = message.target_system in (0, ours.system) and message.target_component in (0, ours.component)
        return ours_or_all and message.mission_type == m.MAV_MISSION_TYPE_MISSION

    def _sequence(self, land: MissionItemInt, waypoints: list[MissionItemInt], home_m: float) -> LandingSequence:
        north_m, east_m = self._position(land)
        from_north_m, from_east_m = self._position(waypoints[-1])
        highest_m = max(item.z - (home_m if item.frame in ABOVE_SEA else 0.0) for item in waypoints)
        course_rad = math.atan2(east_m - from_east_m, north_m - from_north_m)
        return LandingSequence(north_m, east_m, course_rad, highest_m)

    def _position(self, item: MissionItemInt) -> tuple[float, float]:
        at = self._origin.to_ned(item.x * E7_RAD, item.y * E7_RAD, self._origin.alt_m)
        return at[0], at[1]

    def _thanks(self) -> list[Message]:
        """Return the acknowledgement of all items, once."""
        if self._thanked or len(self._items) != self._count:
            return []
        self._thanked = True
        return [MissionAck(self._system, m.MAV_COMP_ID_AUTOPILOT1, m.MAV_MISSION_ACCEPTED)]

    def _missing(self) -> int:
        return next(seq for seq in range(self._count) if seq not in self._items)

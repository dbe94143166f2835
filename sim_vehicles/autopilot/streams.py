"""When a vehicle sends which message: the interval of each, as ground stations ask for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, Generic, TypeVar

from librt.vecs import vec
from mypy_extensions import i64

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, NEVER, Instant
from airlink.messages import Message
from sim_vehicles.board_clock import LOOP_HZ
from sim_vehicles.link import Link

SHORTEST_US: Final = 1e6 / LOOP_HZ
LONGEST_US: Final = 60e6
DEFAULT, STOP = 0.0, -1.0
GROUPS: dict[int, tuple[int, ...]] = {
    m.MAV_DATA_STREAM_EXTENDED_STATUS: (
        m.MAVLINK_MSG_ID_SYS_STATUS,
        m.MAVLINK_MSG_ID_GPS_RAW_INT,
        m.MAVLINK_MSG_ID_MISSION_CURRENT,
        m.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
    ),
    m.MAV_DATA_STREAM_POSITION: (m.MAVLINK_MSG_ID_LOCAL_POSITION_NED, m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT),
    m.MAV_DATA_STREAM_EXTRA1: (m.MAVLINK_MSG_ID_ATTITUDE,),
    m.MAV_DATA_STREAM_EXTRA2: (m.MAVLINK_MSG_ID_VFR_HUD,),
    m.MAV_DATA_STREAM_EXTRA3: (
        m.MAVLINK_MSG_ID_SYSTEM_TIME,
        m.MAVLINK_MSG_ID_BATTERY_STATUS,
        m.MAVLINK_MSG_ID_WIND,
        m.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
}
"""Messages of REQUEST_DATA_STREAM's groups (ArduPilot documentation, "SRn_ parameters")."""
STREAMED = tuple(message_id for group in GROUPS.values() for message_id in group)
UNASKED_NS: Final = NANOSECONDS
UNASKED: Final = dict.fromkeys((m.MAVLINK_MSG_ID_HEARTBEAT, *STREAMED), UNASKED_NS)
"""Messages streamed without a request, and their intervals, ns."""
V = TypeVar("V")
"""Whose state the messages report."""
Builders = Mapping[int, Callable[[V], Message]]
"""Messages that a kind of vehicle can send, and the functions that build them."""


class Stream(Generic[V]):
    """One periodic message."""

    def __init__(self, message_id: int, build: Callable[[V], Message], interval_ns: int) -> None:
        """Take its id, the function that builds it, and its interval."""
        self.message_id = message_id
        self.build = build
        self.interval_ns: i64 = interval_ns


class Streams(Generic[V]):
    """One vehicle's message intervals. A message is sent in the first cycle of the main loop at or after its time."""

    def __init__(self, now: Instant, unasked: Mapping[int, int], known: Builders[V]) -> None:
        """Start with the messages that need no request; `known` are those that can be sent."""
        self._unasked, self._known = unasked, known
        self._streams = [Stream(message_id, known[message_id], unasked[message_id]) for message_id in sorted(unasked)]
        """Sorted by id, the order in which the messages of a cycle are sent."""
        self._due = vec[i64]([now] * len(self._streams))
        """When each is due next, in an array of its own, because most cycles read nothing else."""
        self.next_due = now
        """When the next message is due; `NEVER` if none is."""
        self._index: i64 = 0
        """Where the search for this cycle's due messages continues."""
        self._plan()

    def set_interval(self, message_id: int, interval_us: float, now: Instant) -> bool:
        """Set an interval, 0 for the default, -1 for never; return False for one shorter than the main loop's.

        Source: MAVLink, MAV_CMD_SET_MESSAGE_INTERVAL.
        """
        if interval_us == DEFAULT:
            self._set(message_id, self._unasked.get(message_id), now)
        elif interval_us == STOP:
            self._set(message_id, None, now)
        elif interval_us >= SHORTEST_US:
            self._set(message_id, round(min(interval_us, LONGEST_US) * 1e3), now)
        else:
            return False
        return True

    def set_group(self, group: int, rate_hz: int, now: Instant) -> None:
        """Set the rate of a group of messages; 0 stops them."""
        members = STREAMED if group == m.MAV_DATA_STREAM_ALL else GROUPS.get(group, ())
        for message_id in members:
            self._set(message_id, NANOSECONDS // min(rate_hz, LOOP_HZ) if rate_hz else None, now)

    def interval_us(self, message_id: int) -> int:
        """Return an interval, -1 for a message that isn't streamed."""
        for each in self._streams:
            if each.message_id == message_id:
                return each.interval_ns // 1000
        return int(STOP)

    def leave_out(self, now: Instant) -> None:
        """Skip messages that were due before now."""
        self._due = vec[i64]([max(due, now) for due in self._due])
        self._plan()

    def send_next(self, vehicle: V, link: Link, now: Instant) -> bool:
        """Send the next message that is due, in order of ids; return whether another is in this cycle."""
        at: i64 = now
        index = self._due_from(self._index, at)
        if index < len(self._due):
            stream = self._streams[index]
            link.broadcast(stream.build(vehicle), now)
            self._due[index] = self._due[index] + stream.interval_ns
            self._index = self._due_from(index + 1, at)
            if self._index < len(self._due):
                return True
        self._index = 0
        self._plan()
        return False

    def _due_from(self, index: i64, at: i64) -> i64:
        """Return the first message from an index on that is due at an instant; their number if there is none."""
        while index < len(self._due) and self._due[index] > at:
            index += 1
        return index

    def _set(self, message_id: int, interval_ns: int | None, now: Instant) -> None:
        known, planned = message_id in self._known, list(zip(self._streams, self._due, strict=True))
        if interval_ns is None or known:
            planned = [each for each in planned if each[0].message_id != message_id]
        if interval_ns is not None and known:
            planned.append((Stream(message_id, self._known[message_id], interval_ns), now))
            planned.sort(key=_number)
        self._streams, self._due = [stream for stream, _ in planned], vec[i64]([due for _, due in planned])
        self._plan()

    def _plan(self) -> None:
        next_due: i64 = NEVER
        for due in self._due:
            next_due = min(next_due, due)
        self.next_due = Instant(next_due)


def _number(planned: tuple[Stream[V], int]) -> int:
    return planned[0].message_id

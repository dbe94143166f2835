"""When each streamed message is due."""

from __future__ import annotations

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant
from sim_vehicles.loop import LOOP_HZ, NEVER
from sim_vehicles.telemetry import BUILDERS

SHORTEST_US = 1e6 / LOOP_HZ
LONGEST_US = 60e6
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
"""What REQUEST_DATA_STREAM's groups consist of (ArduPilot documentation, "SRn_ parameters")."""
STREAMED = tuple(message_id for group in GROUPS.values() for message_id in group)
UNASKED = (m.MAVLINK_MSG_ID_HEARTBEAT, *STREAMED)
"""Messages that are streamed without a request, every `UNASKED_NS`."""
UNASKED_NS = NANOSECONDS


class Streams:
    """One vehicle's message intervals. A message is sent in the first cycle of the main loop at or after its time."""

    def __init__(self, now: Instant) -> None:
        """Start with the messages that need no request."""
        self._interval_ns = dict.fromkeys(UNASKED, UNASKED_NS)
        self._due = dict.fromkeys(UNASKED, now)
        self.next_due = now
        """When the next message is due; `NEVER` when none is."""

    def set_interval(self, message_id: int, interval_us: float, now: Instant) -> bool:
        """Set an interval, 0 for the default one, -1 for never; return False for one shorter than the main loop's.

        Source: MAVLink, MAV_CMD_SET_MESSAGE_INTERVAL.
        """
        if interval_us == DEFAULT:
            self._set(message_id, UNASKED_NS if message_id in UNASKED else None, now)
        elif interval_us == STOP:
            self._set(message_id, None, now)
        elif interval_us >= SHORTEST_US:
            self._set(message_id, round(min(interval_us, LONGEST_US) * 1e3), now)
        else:
            return False
        return True

    def set_group(self, group: int, rate_hz: int, now: Instant) -> None:
        """Set the rate of a group of messages: 0 stops them."""
        members = STREAMED if group == m.MAV_DATA_STREAM_ALL else GROUPS.get(group, ())
        for message_id in members:
            self._set(message_id, NANOSECONDS // min(rate_hz, LOOP_HZ) if rate_hz else None, now)

    def interval_us(self, message_id: int) -> int:
        """Return an interval, -1 for a message that isn't streamed."""
        interval_ns = self._interval_ns.get(message_id)
        return int(STOP) if interval_ns is None else interval_ns // 1000

    def leave_out(self, now: Instant) -> None:
        """Skip messages that were due before now."""
        self._due = {message_id: max(instant, now) for message_id, instant in self._due.items()}
        self._plan()

    def take_due(self, now: Instant) -> list[int]:
        """Return the ids of the messages that are due, in order, and plan their next ones."""
        if now < self.next_due:
            return []
        due = sorted(message_id for message_id, instant in self._due.items() if instant <= now)
        for message_id in due:
            self._due[message_id] = Instant(self._due[message_id] + self._interval_ns[message_id])
        self._plan()
        return due

    def _set(self, message_id: int, interval_ns: int | None, now: Instant) -> None:
        if interval_ns is None:
            self._interval_ns.pop(message_id, None)
            self._due.pop(message_id, None)
        elif message_id in BUILDERS:
            self._interval_ns[message_id] = interval_ns
            self._due[message_id] = now
        self._plan()

    def _plan(self) -> None:
        self.next_due = min(self._due.values(), default=NEVER)

# Compiled by mypyc: it runs every tick.

"""Lowers the rates of one vehicle's messages that come more often than wanted.

A vehicle streams messages by its own parameters (SRn_ of ArduPilot, MAV_n_MODE of PX4) or by another ground station's
request, that no one here reads; and some are of use before take-off only. Requests aren't awaited: one that is lost, or
that another station overrules, shows in what comes, and is repeated after each twice as long.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant, after, seconds_between
from airlink.messages import KINDS, Message
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.vehicle import Vehicle

WINDOW_S: Final = 5.0
"""Time over which messages are counted. Tuned: s; 3 to 10; shown by `pytest
tests/gcs_formation/features/link_budget`."""
TOO_OFTEN: Final = 1.5
"""A message comes too often beyond this multiple of its rate, and two more in a window. Tuned: ratio; 1.2 to 2; shown
by `pytest tests/gcs_formation/features/link_budget`."""
ASK_AGAIN_MAX_S: Final = 320.0
"""Longest interval between requests of a rate that changes nothing. Tuned: s; 60 to 600; shown by `pytest
tests/gcs_formation/features/link_budget`."""
ANSWERS: Final = frozenset(
    {
        m.MAVLINK_MSG_ID_HEARTBEAT,
        m.MAVLINK_MSG_ID_PARAM_VALUE,
        m.MAVLINK_MSG_ID_MISSION_REQUEST,
        m.MAVLINK_MSG_ID_MISSION_COUNT,
        m.MAVLINK_MSG_ID_MISSION_ACK,
        m.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        m.MAVLINK_MSG_ID_MISSION_ITEM_INT,
        m.MAVLINK_MSG_ID_COMMAND_ACK,
        m.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
        m.MAVLINK_MSG_ID_TIMESYNC,
        m.MAVLINK_MSG_ID_LOG_ENTRY,
        m.MAVLINK_MSG_ID_LOG_DATA,
        m.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
        m.MAVLINK_MSG_ID_HOME_POSITION,
        m.MAVLINK_MSG_ID_STATUSTEXT,
        m.MAVLINK_MSG_ID_CURRENT_MODE,
    }
)
"""Messages that come on a request or on a change, and have no rate."""


class StreamRates:
    """One vehicle's streams: what comes of each, against what is wanted."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Start with nothing counted."""
        self._vehicle = vehicle
        self._began, self._counts = Instant(0), dict[int, int]()
        """When the present window began, and the counts then; none while nothing is counted."""
        self._asked = dict[int, tuple[Instant, float]]()
        """For each message that was asked to come less often: when it may be asked again, and the wait after that."""

    def requests(self, wanted_hz: Mapping[int, float], unread_hz: float | None, now: Instant) -> Iterator[Message]:
        """Yield the requests to send now.

        `wanted_hz`: rates of the messages that are read; `unread_hz`: of all others, 0: none at all, None: as they are.
        """
        vehicle = self._vehicle
        if vehicle.commands.outcome is Outcome.WAITING or not vehicle.connection.talks:
            self._counts = {}
        elif not self._counts:
            self._began, self._counts = now, self._counted()
        elif seconds_between(self._began, now) >= WINDOW_S:
            over_s, before = seconds_between(self._began, now), self._counts
            self._began, self._counts = now, self._counted()
            for message_id, count in self._counts.items():
                rate_hz = wanted_hz.get(message_id, unread_hz)
                too_many = rate_hz is not None and count - before.get(message_id, 0) > TOO_OFTEN * rate_hz * over_s + 2
                if too_many and rate_hz is not None and message_id not in ANSWERS:
                    yield from self._request(message_id, rate_hz, now)

    def clear(self) -> None:
        """Reset: other rates are wanted."""
        self._counts = {}
        self._asked.clear()

    def _request(self, message_id: int, rate_hz: float, now: Instant) -> Iterator[Message]:
        due, wait_s = self._asked.get(message_id, (now, WINDOW_S))
        if now >= due:
            self._asked[message_id] = after(now, wait_s), min(2.0 * wait_s, ASK_AGAIN_MAX_S)
            yield self._vehicle.ask(self._vehicle.autopilot.set_message_interval(message_id, rate_hz))

    def _counted(self) -> dict[int, int]:
        """Return how many of each message have come; of kinds unknown to us too."""
        messages_in = self._vehicle.messages_in
        known = {message_id: int(messages_in[kind.index]) for message_id, kind in KINDS.items()}
        return {each: count for each, count in known.items() if count} | self._vehicle.unknown_in

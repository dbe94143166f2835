"""A vehicle's clock by the answer to a command, where it answers no TIMESYNC.

Routers that pass each message on by the system that it names don't know whom TIMESYNC is for as long as their message
definitions lack its target fields, and give all requests to one vehicle (MAVProxy 1.8 with pymavlink 2.4.50). A command
names its target in every version. ArduPilot acknowledges MAV_CMD_REQUEST_MESSAGE of HOME_POSITION, and sends that
message, with its time since boot in microseconds, within 1.3 ms of the acknowledgement (120 of 120 requests in its
simulator, once home is set); unasked it comes when home is set alone. Neither has a number, so one request at a time is
under way, and an answer counts if acknowledgement and message come together.
"""

from __future__ import annotations

from typing import Final

from airlink.clock import NEVER, Instant, seconds_between
from airlink.messages.system import Timesync
from gcs_formation.link.round_trips import RoundTrips

UNANSWERED: Final = 40
"""Number of TIMESYNC requests without any answer from which on it is asked by command: with half of all datagrams lost
each way, so many are lost once in 100,000 starts."""
TOGETHER_S: Final = 0.1
"""Longest time between acknowledgement and message of one answer, s."""
PATIENCE_S: Final = 3.0
"""Time after which a request counts as lost, s."""
STILL_TIMESYNC: Final = 8
"""Of so many requests one is TIMESYNC still: once it is answered, all are."""


class ClockByCommand:
    """The request to one vehicle that is under way."""

    def __init__(self) -> None:
        """Start with none."""
        self._sent = self._acknowledged = self._reported = NEVER
        self._vehicle_ns = 0
        self._turn = 0

    def asks(self, trips: RoundTrips, now: Instant) -> bool:
        """Return whether to ask by command now; then the request is under way."""
        if trips.answered_to or trips.requests < UNANSWERED or not trips.answers_commands:
            return False
        self._turn = (self._turn + 1) % STILL_TIMESYNC
        waits = self._sent != NEVER and seconds_between(self._sent, now) < PATIENCE_S
        if waits or not self._turn:
            return False
        self._sent, self._acknowledged, self._reported = now, NEVER, NEVER
        return True

    def acknowledged(self, now: Instant) -> None:
        """Take the acknowledgement."""
        if self._sent != NEVER:
            self._acknowledged = now

    def tell(self, vehicle_ns: int, now: Instant) -> None:
        """Take a message with the vehicle's time since boot, ns."""
        if self._sent != NEVER:
            self._reported, self._vehicle_ns = now, vehicle_ns

    def take_answer(self) -> tuple[Timesync, Instant] | None:
        """Remove and return the answer as one to TIMESYNC, and when it came; None while it isn't complete."""
        if NEVER in (self._reported, self._acknowledged):
            return None
        if abs(seconds_between(self._reported, self._acknowledged)) > TOGETHER_S:
            return None
        answer, reported = Timesync(self._vehicle_ns, self._sent), self._reported
        self._sent = self._reported = self._acknowledged = NEVER
        return answer, reported

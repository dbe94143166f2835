"""The transfer of one vehicle's log: an engine without I/O.

Source: MAVLink's common message set (LOG_REQUEST_LIST, LOG_REQUEST_DATA, LOG_REQUEST_END). ArduPilot and PX4 send what
is asked for in blocks of 90 bytes without waiting; another request begins there. So what is missing is asked for in one
piece, and gaps once nothing more comes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant, after, seconds_between
from airlink.messages import Message
from airlink.messages.command import LogData, LogEntry, LogRequestData, LogRequestEnd, LogRequestList

BLOCK: Final = 90
"""Bytes of a LOG_DATA."""
ALL: Final = 0xFFFF
LIST_S: Final = 1.0
"""Time between requests for the list."""
STALL_S: Final = 0.6
"""Time without a new block after which what is missing is asked for."""
PATIENCE_S: Final = 15.0
"""Time without any progress after which the transfer is given up."""


class Stage(Enum):
    """Where a transfer is."""

    LISTING = "waiting for its list of logs"
    FETCHING = "fetching"
    DONE = "fetched"
    FAILED = "failed"


class LogTransfer:
    """Fetches the newest log of a vehicle, or the one of a number; what is asked for again isn't kept twice."""

    def __init__(
        self,
        system: int,
        number: int | None,
        now: Instant,
        kept: Callable[[LogEntry], int] = lambda _: 0,
        *,
        by_time: bool = False,
    ) -> None:
        """Begin to fetch.

        Args:
            system: the vehicle's system id.
            number: of the log, None for the newest.
            now: the present instant.
            kept: how many bytes of a log are there already.
            by_time: whether the newest is the one with the latest time: a PX4 lists them in no order.
        """
        self._system, self._wanted, self._kept, self._by_time = system, number, kept, by_time
        self.stage = Stage.LISTING
        self.failure = ""
        """Why it failed."""
        self.entries = dict[int, LogEntry]()
        self.entry: LogEntry | None = None
        """The log that is fetched."""
        self.received = 0
        """Bytes from the beginning of the log without a gap."""
        self._ahead = dict[int, bytes]()
        """Blocks behind a gap, by where they begin."""
        self._ready = list[bytes]()
        self._end = math.inf
        """Where the log ends, once the vehicle has shown that."""
        self._progress = self._next = now
        self._closing = False

    @property
    def over(self) -> bool:
        """Whether it has come to an end."""
        return self.stage in (Stage.DONE, Stage.FAILED)

    @property
    def offers_none(self) -> bool:
        """Whether the vehicle has shown no log at all in this way."""
        return self.stage is Stage.FAILED and not self.entries

    def chunks(self) -> list[bytes]:
        """Remove and return what has come without a gap, in order."""
        ready, self._ready = self._ready, []
        return ready

    def requests(self, now: Instant) -> list[Message]:
        """Return what to send now."""
        if self._closing:
            self._closing = False
            return [LogRequestEnd(self._system, m.MAV_COMP_ID_AUTOPILOT1)]
        if self.over or now < self._next:
            return []
        if seconds_between(self._progress, now) > PATIENCE_S:
            self._give_up(f"nothing came for {PATIENCE_S:g} s while {self.stage.value}")
            return []
        if self.stage is Stage.LISTING:
            self._next = after(now, LIST_S)
            return [LogRequestList(self._system, m.MAV_COMP_ID_AUTOPILOT1, 0, ALL)]
        self._next = after(now, STALL_S)
        return [self._request()]

    def _request(self) -> LogRequestData:
        """Return the request for the first gap, or all of the rest."""
        assert self.entry is not None, "there is one while fetching"
        until = min(self._ahead, default=0) or self.entry.size
        wanted = max(until - self.received, BLOCK)
        return LogRequestData(self._system, m.MAV_COMP_ID_AUTOPILOT1, self.entry.id, self.received, wanted)

    def take(self, message: Message, now: Instant) -> None:
        """Take a message of the vehicle."""
        if isinstance(message, LogEntry) and self.stage is Stage.LISTING:
            self._progress = now
            self._list(message)
        elif isinstance(message, LogData) and self.stage is Stage.FETCHING:
            self._store(message, now)

    def _list(self, entry: LogEntry) -> None:
        if entry.num_logs == 0:
            self._give_up("it has no logs")
            return
        self.entries[entry.id] = entry
        complete = len(self.entries) >= entry.num_logs
        number = self._wanted if self._wanted is not None else entry.last_log_num
        if self._wanted is None and self._by_time:
            number = max(self.entries.values(), key=lambda each: each.time_utc).id if complete else -1
        if number in self.entries:
            self.entry, self.stage = self.entries[number], Stage.FETCHING
            self.received, self._next = self._kept(self.entry), Instant(0)
            if self.received >= self.entry.size:
                self.stage, self._closing = Stage.DONE, True
        elif complete:
            known = ", ".join(str(each) for each in sorted(self.entries))
            self._give_up(f"found no log {number}; allowed: {known}")

    def _store(self, block: LogData, now: Instant) -> None:
        """Keep a block, and pass on what follows without a gap."""
        assert self.entry is not None, "there is one while fetching"
        if block.id != self.entry.id:
            return
        data = bytes(block.data[: block.count])
        begin, end = block.ofs, block.ofs + len(data)
        if len(data) < BLOCK:
            self._end = min(self._end, end)
        if end > self.received and begin not in self._ahead:
            self._ahead[begin] = data
            self._progress, self._next = now, after(now, STALL_S)
        while (part := self._ahead.pop(self.received, None)) is not None and part:
            self._ready.append(part)
            self.received += len(part)
        self._ahead = {at: part for at, part in self._ahead.items() if at > self.received} if self._ahead else {}
        if self.received >= min(self.entry.size, self._end):
            self.stage, self._closing = Stage.DONE, True
        elif len(data) < BLOCK:
            self._next = now  # the end of what was asked for: the gaps before it are asked for at once

    def _give_up(self, why: str) -> None:
        self.stage, self.failure, self._closing = Stage.FAILED, why, True

"""Records the delays of datagrams, and of what lies beyond, as a table that a scenario's `trace` replays.

A row has the time of one datagram, s since the record began, and its delay, empty if it was lost, in the columns of
what it is about: `uplink` and `downlink` through the proxy; `rtt` from the proxy to a vehicle and back, by the
TIMESYNC requests of the ground station that pass (MAVLink guide, "Time Synchronization").
"""

from __future__ import annotations

from collections import OrderedDict
from types import TracebackType
from typing import IO, Final, Self

from airlink.clock import Instant, after, seconds_between
from airlink.engine import DelayQueue
from airlink.impairment import Direction
from airlink.messages.system import Timesync
from airlink.stream_parser import StreamParser

COLUMNS: Final = ("uplink_t_s", "uplink_ms", "downlink_t_s", "downlink_ms", "rtt_t_s", "rtt_ms")
ROUND_TRIP: Final = 4
"""Index of its first column."""
ANSWER_S: Final = 10.0
"""A request without an answer for so long is lost."""
SORTED_S: Final = 60.0
"""Rows are written in the order of their times: each once nothing can come that is older."""
MAX_BYTES: Final = 15_000_000
"""As much as a scenario reads; the record ends there."""


class DelayRecord:
    """Writes rows to a file as the delays become known."""

    def __init__(self, file: IO[str]) -> None:
        """Write to `file`, which is closed at the end."""
        self._file = file
        self._began: Instant | None = None
        self._rows = DelayQueue[tuple[int, float | None]]()
        self._requests = OrderedDict[tuple[int, int], Instant]()
        """When a request to a remote was sent on, by remote and stamp."""
        self._written = file.write(",".join(COLUMNS) + "\n")

    def __enter__(self) -> Self:
        """Return the record."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write what is known, and close the file."""
        self._write(Instant(2**62))
        self._file.close()

    def carried(self, direction: Direction, entered: Instant, delay_s: float | None) -> None:
        """Take a datagram that entered the proxy at an instant; without a delay it was lost."""
        self._add(2 * direction, entered, delay_s)

    def sent_on(self, remote: int, data: bytes, now: Instant) -> None:
        """Take what is sent on to a remote."""
        for stamp_ns, answers in _stamps(data):
            if not answers:
                self._requests[remote, stamp_ns] = now
        while self._requests and after(next(iter(self._requests.values())), ANSWER_S) < now:
            _, sent = self._requests.popitem(last=False)
            self._add(ROUND_TRIP, sent, None)
        self._write(after(now, -SORTED_S))

    def came(self, remote: int, data: bytes, now: Instant) -> None:
        """Take what came from a remote."""
        for stamp_ns, answers in _stamps(data):
            sent = self._requests.pop((remote, stamp_ns), None) if answers else None
            if sent is not None:
                self._add(ROUND_TRIP, sent, seconds_between(sent, now))

    def _add(self, column: int, at: Instant, delay_s: float | None) -> None:
        self._began = at if self._began is None else self._began
        self._rows.push(at, (column, delay_s))

    def _write(self, until: Instant) -> None:
        while (at := self._rows.next()) is not None and at <= until and self._written < MAX_BYTES:
            for column, delay_s in self._rows.pop_due(at):
                at_s = seconds_between(self._began if self._began is not None else at, at)
                filled = f"{max(at_s, 0.0):.6f},{'' if delay_s is None else f'{1e3 * delay_s:.3f}'}"
                self._written += self._file.write("," * column + filled + "," * (len(COLUMNS) - 2 - column) + "\n")
        self._file.flush()


def _stamps(data: bytes) -> list[tuple[int, bool]]:
    """Return the stamp of each TIMESYNC in a datagram, and whether it is of an answer."""
    messages = (frame.message for frame in StreamParser().feed(data))
    return [(each.ts1_ns, each.tc1_ns != 0) for each in messages if isinstance(each, Timesync)]

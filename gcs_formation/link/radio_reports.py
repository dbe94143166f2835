"""What telemetry radios say about themselves: RADIO_STATUS, which a radio adds to what it receives.

A report says nothing of which vehicles it is about. It concerns those that are reached where it came from: several, on
a line that they share. A sender of reports is no vehicle, whatever its system id. Reports from elsewhere aren't taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame
from airlink.messages.system import RadioStatus
from gcs_formation.link.link_health import Connection

UNKNOWN: Final = 255
STALE_S: Final = 5.0
"""A radio reports about once a second; older reports say nothing about now. Tuned: s; 3 to 10; shown by `pytest
tests/gcs_formation/link`."""
COUNTS: Final = 65536
"""Counts of RADIO_STATUS begin again there."""
MIN_S: Final = 0.2
"""Least time between two reports of one radio that are kept for the record. Tuned: s; 0.1 to 1; shown by `pytest
tests/gcs_formation/link`."""
AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1


def always(_: Connection) -> bool:
    """Return that a report is accepted."""
    return True


class RadioReport(NamedTuple):
    """What the radio at our end last said."""

    at: Instant
    rssi: int
    """Strength of what we receive, in the radio's unit: of a SiK radio (rssi / 1.9 - 127) dBm. 255: unknown."""
    remrssi: int
    """Strength of what the other end receives."""
    noise: int
    remnoise: int
    txbuf_percent: int
    """Free share of the buffer for what we send, 0 to 100."""
    rxerrors: int
    """Frames received with errors so far, modulo 65536."""
    fixed: int
    """Frames corrected so far, modulo 65536."""


class RadioReports:
    """The newest report of each radio, by where it is connected."""

    def __init__(self, connections: Iterable[Connection], usable: Callable[[Connection], bool] = always) -> None:
        """Take reports from where the `connections` are; `usable`: whether reports on one are acted on.

        A radio signs nothing. On a signed link anyone could say that it is full, so that there reports are recorded
        alone.
        """
        self._connections, self._usable = list(connections), usable
        self._newest = dict[tuple[int, Address], RadioReport]()
        self._kept = dict[tuple[int, Address], list[RadioReport]]()

    def receive(self, frame: Frame, datagram: Datagram, now: Instant) -> bool:
        """Take a frame that is no vehicle's; return whether it was a report of one of our radios."""
        status = frame.message
        if not isinstance(status, RadioStatus) or frame.component == AUTOPILOT:
            return False
        if all(each.peer != datagram.peer or each.socket != datagram.socket for each in self._connections):
            return False
        report = RadioReport(
            now,
            status.rssi,
            status.remrssi,
            status.noise,
            status.remnoise,
            min(status.txbuf, 100),
            status.rxerrors,
            status.fixed,
        )
        self._newest[datagram.remote] = report
        kept = self._kept.setdefault(datagram.remote, [])
        if not kept or seconds_between(kept[-1].at, now) >= MIN_S:
            kept.append(report)
        return True

    def of(self, connection: Connection, now: Instant) -> RadioReport | None:
        """Return the newest report on a vehicle's radio; None without an accepted one in the last `STALE_S`."""
        if connection.peer is None or not self._usable(connection):
            return None
        found = self._newest.get((connection.socket, connection.peer))
        return None if found is None or seconds_between(found.at, now) > STALE_S else found

    def all_of(self, connection: Connection) -> list[RadioReport]:
        """Return the reports on the radio by which a vehicle was last reached, in the order of time."""
        return [] if connection.peer is None else self._kept.get((connection.socket, connection.peer), [])

"""Whether so much of others arrives that frames of vehicles may be lost."""

from __future__ import annotations

from typing import Final

from airlink.clock import NEVER, Instant, seconds_between
from airlink.stream_parser import ParserCounts
from gcs_formation.recorder import LogEvent

FLOOD_BYTES_PER_S: Final = 100e3
"""Bytes that aren't frames or weren't read; a vehicle sends some 5 kB/s."""
FLOOD_FRAMES_PER_S: Final = 1000.0
"""Frames that aren't taken for a vehicle's."""
SUBSIDED: Final = 0.5
"""A flood is over below this share of both."""


class FloodWatch:
    """Reports when so much of others arrives that the sockets may lose frames of vehicles."""

    def __init__(self, log_event: LogEvent) -> None:
        """Start without counts."""
        self._log_event, self._flooded, self._looked = log_event, False, NEVER
        self._garbage_bytes = self._unread_bytes = self._refused = 0
        self.unread_bytes = 0
        """Bytes of strangers that weren't read, so far."""

    def compare(self, now: Instant, counts: ParserCounts, frames_refused: int) -> None:
        """Compare the counts since the flight began with those of the last call."""
        garbage, refused = counts.garbage_bytes - self._garbage_bytes, frames_refused - self._refused
        unread = counts.unread_bytes - self._unread_bytes
        over_s = 0.0 if self._looked == NEVER else seconds_between(self._looked, now)
        self._garbage_bytes, self._unread_bytes = counts.garbage_bytes, counts.unread_bytes
        self._refused, self._looked = frames_refused, now
        if over_s <= 0.0:
            return
        share = max((garbage + unread) / over_s / FLOOD_BYTES_PER_S, refused / over_s / FLOOD_FRAMES_PER_S)
        if not self._flooded and share > 1.0:
            self._flooded = True
            junk = f"{garbage / over_s / 1e3:.0f} kB of no frame"
            if unread:
                junk += f", {unread / over_s / 1e3:.0f} kB of strangers, which aren't read,"
            what = f"{junk} and {refused / over_s:.0f} frames of others arrive"
            self._log_event(now, "flood", f"{what} a second; frames of vehicles may be lost in that", None, {})
        elif self._flooded and share < SUBSIDED:
            self._flooded = False
            self._log_event(now, "flood", "is over", None, {})

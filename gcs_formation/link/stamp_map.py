"""Maps a vehicle's stamps to the station's clock."""

from __future__ import annotations

import math

from airlink.clock import NANOSECONDS, Instant, after, seconds_between
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.gnss_clock import GnssClock

UNKNOWN_DELAYS_S = math.nan, math.nan
EPOCH = Instant(0)


class StampMap:
    """Maps stamps to instants; a change of the mapping in flight is spread over time.

    With UTC it is a straight line, drawn again at each tick instead of at each answer.
    """

    def __init__(self, round_trips: ClockSync, gnss: GnssClock | None) -> None:
        """Start with round trips; `gnss` is the clock against UTC, None if UTC isn't wanted."""
        self.gnss = gnss
        self._round_trips = round_trips
        self._utc_s: float | None = None
        self._slew_s = self._line_s = self._at_line_s = self._rate = 0.0
        """With UTC: our clock, s, when the vehicle's shows `_line_s`, and our seconds per second of its clock."""

    @property
    def by_utc(self) -> bool:
        """Whether stamps are mapped by UTC."""
        return self._utc_s is not None

    def use_utc(self, utc_s: float | None, now: Instant, slew_s: float) -> None:
        """Map by the vehicle's UTC, given UTC minus our clock; None: by round trips.

        The mapping moves by at most `slew_s` a call when the method or the estimate of UTC changes.
        """
        if self._round_trips.samples and not (utc_s is None and self._utc_s is None):
            stamp_s = now / NANOSECONDS + self._round_trips.offset_s
            before, self._slew_s = self.to_instant(stamp_s), 0.0
            self._utc_s = utc_s
            self._draw(stamp_s)
            self._slew_s = seconds_between(self.to_instant(stamp_s), before)
        self._utc_s = utc_s
        self._slew_s -= math.copysign(min(abs(self._slew_s), slew_s), self._slew_s)

    def to_instant(self, stamp_s: float) -> Instant:
        """Return our instant for the vehicle's time since boot, s."""
        if self._utc_s is None:
            instant = self._round_trips.to_instant(stamp_s)
        else:
            instant = after(EPOCH, self._at_line_s + self._rate * (stamp_s - self._line_s))
        return after(instant, self._slew_s) if self._slew_s else instant

    def _draw(self, stamp_s: float) -> None:
        """Draw the UTC line through a time since boot."""
        if self.gnss is not None and self._utc_s is not None:
            self._line_s, self._at_line_s = stamp_s, self.gnss.to_utc_s(stamp_s) - self._utc_s
            self._rate = 1.0 - self.gnss.drift

    def up_down_s(self, one_way_s: float) -> tuple[float, float]:
        """Return the delays up and down, s, of a round trip of twice `one_way_s`; NaN without UTC."""
        if self.gnss is None or self._utc_s is None:
            return UNKNOWN_DELAYS_S
        more_s = self.gnss.station_utc_s() - self._utc_s
        return max(0.0, one_way_s + more_s), max(0.0, one_way_s - more_s)

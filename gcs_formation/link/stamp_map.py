"""Maps a vehicle's time stamps to our instants: by its UTC where that is used, by round trips otherwise."""

from __future__ import annotations

import math

from airlink.clock import NANOSECONDS, Instant, after, seconds_between
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.gnss_clock import GnssClock

UNKNOWN_WAYS_S = math.nan, math.nan
EPOCH = Instant(0)


class StampMap:
    """The mapping in use; a change of it in flight is spread over time."""

    def __init__(self, round_trips: ClockSync, gnss: GnssClock | None) -> None:
        """Begin by round trips; `gnss` is the clock against UTC, None where nobody asks for that."""
        self.gnss = gnss
        self._round_trips = round_trips
        self._utc_s: float | None = None
        self._slew_s = 0.0

    def use_utc(self, utc_s: float | None, now: Instant, slew_s: float) -> None:
        """Map by the vehicle's UTC, given what UTC minus our clock is; None: by round trips.

        A change comes gradually, by at most `slew_s` a call.
        """
        if (utc_s is None) != (self._utc_s is None) and self._round_trips.samples:
            stamp_s = now / NANOSECONDS + self._round_trips.offset_s
            before = self.to_instant(stamp_s)
            self._utc_s, self._slew_s = utc_s, 0.0
            self._slew_s = seconds_between(self.to_instant(stamp_s), before)
        self._utc_s = utc_s
        self._slew_s -= math.copysign(min(abs(self._slew_s), slew_s), self._slew_s)

    def to_instant(self, stamp_s: float) -> Instant:
        """Return our instant for its time since boot, s."""
        if self.gnss is None or self._utc_s is None:
            instant = self._round_trips.to_instant(stamp_s)
        else:
            instant = after(EPOCH, self.gnss.to_utc_s(stamp_s) - self._utc_s)
        return after(instant, self._slew_s) if self._slew_s else instant

    def ways_s(self, one_way_s: float) -> tuple[float, float]:
        """Return the delays up and down, s, of a round trip that took twice `one_way_s`; NaN where UTC isn't used."""
        if self.gnss is None or self._utc_s is None:
            return UNKNOWN_WAYS_S
        more_s = self.gnss.station_utc_s() - self._utc_s
        return max(0.0, one_way_s + more_s), max(0.0, one_way_s - more_s)

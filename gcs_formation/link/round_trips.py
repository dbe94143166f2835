"""What one vehicle's answers tell: that it hears the station, the delay of its link, and its clock."""

from __future__ import annotations

import math
from typing import Final

from librt.strings import BytesWriter, write_f64_le

from airlink.clock import Instant, nanoseconds, seconds_between
from airlink.messages.system import Timesync
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.gnss_clock import GnssClock, StampMap

MAX_PENDING: Final = 256
"""Unanswered requests that are kept: a minute of them."""


class RoundTrips:
    """The TIMESYNC requests to one vehicle, and what follows from the answers to them and to commands.

    Source: MAVLink documentation, "Time Synchronization Protocol v2".
    """

    def __init__(self, loop_s: float, *, by_utc: bool = False) -> None:
        """Begin with nothing asked; the vehicle answers in a loop of `loop_s`, s.

        With `by_utc` stamps are mapped by the vehicle's UTC, where that is known.
        """
        self._loop_s, self._by_utc = loop_s, by_utc
        self.clock = ClockSync(loop_s)
        self.stamps = self._new_stamps()
        self.delays = BytesWriter()
        """Four numbers of 64 bits for each answered request: when it came back, ns; half the round trip, the way up and
        the way down, s, NaN where it isn't known how the round trip is split."""
        self._answered: Instant | None = None
        """When its newest answer came, to whatever it was asked."""
        self._pending = list[Instant]()
        """When the requests were sent that haven't been answered, the oldest first."""

    def request(self, now: Instant) -> Timesync:
        """Return a TIMESYNC request; its stamp, kept here, tells the answer from those to others."""
        self._pending.append(now)
        if len(self._pending) > MAX_PENDING:
            self._pending.pop(0)
        return Timesync(0, now)

    def forget_requests(self, now: Instant) -> None:
        """Drop pending requests: their answers have waited for us, so their delay isn't the link's. None is overdue."""
        self._pending.clear()
        self._answered = now

    def hear(self, now: Instant) -> None:
        """Note that it has answered something."""
        self._answered = now

    def is_answer(self, message: Timesync) -> bool:
        """Return whether a message answers a request that no other has answered, which isn't pending any more."""
        for place in range(len(self._pending) - 1, -1, -1):
            if self._pending[place] == message.ts1_ns:
                self._pending.pop(place)
                return True
        return False

    def measure(self, answer: Timesync, now: Instant) -> bool:
        """Learn delay and clock from an answer that came now; return whether the vehicle's clock has begun anew."""
        sent = Instant(answer.ts1_ns)
        anew = self.clock.observe(sent, answer.tc1_ns, now)
        if anew:
            self.stamps = self._new_stamps()
        if self.gnss is not None:
            self.gnss.probe(sent, answer.tc1_ns, now)
        one_way_s = self.clock.last_one_way_s()
        up_s, down_s = self.stamps.ways_s(one_way_s)
        write_f64_le(self.delays, float(now))
        write_f64_le(self.delays, one_way_s)
        write_f64_le(self.delays, up_s)
        write_f64_le(self.delays, down_s)
        return anew

    @property
    def gnss(self) -> GnssClock | None:
        """Its clock against UTC, None where nobody asks for that."""
        return self.stamps.gnss

    @property
    def ways_s(self) -> tuple[float, float]:
        """Delay up and down, s; NaN where it isn't known how the round trip is split."""
        return self.stamps.ways_s(self.clock.one_way_s)

    @property
    def down_s(self) -> float:
        """Delay down, s: half the round trip where it isn't known how that is split; NaN before the first."""
        if self.stamps.gnss is None:
            return self.clock.one_way_s
        down_s = self.ways_s[1]
        return self.clock.one_way_s if math.isnan(down_s) else down_s

    def heard_at(self, now: Instant) -> Instant:
        """Return until when it is known to have heard the station: the time of its newest answer less the way back.

        Before the first answer, that is `now`.
        """
        if self._answered is None:
            return now
        down_s = self.down_s
        return self._answered if math.isnan(down_s) else Instant(self._answered - nanoseconds(down_s))

    def unanswered_s(self, last_heard: Instant) -> float:
        """Return for how long frames have come since its newest answer, s, until the instant of the last one."""
        return 0.0 if self._answered is None else max(0.0, seconds_between(self._answered, last_heard))

    def _new_stamps(self) -> StampMap:
        return StampMap(self.clock, GnssClock(self._loop_s) if self._by_utc else None)

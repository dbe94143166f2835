"""TIMESYNC with one vehicle: whether it receives from the station, its link's delay and its clock, also against UTC.

Where UTC is used, a vehicle's stamps are mapped to our instants by it, and it shows how the delay is split. A crystal's
drift is steady, tens of ppm, while a link's delay isn't. So a two-state Kalman filter takes the drift from the slope of
the round trips' midpoints, and a step in these is attributed to the link's split.

ArduPilot takes UTC from its GNSS receiver only while disarmed, and only forwards; otherwise UTC runs on the vehicle's
crystal (AP_RTC). A slow clock therefore departs from UTC on arming, a fast one at boot. Both are corrected by drift
times the time since then, so longer times need a better drift: 0.5 ppm, the filter's best, is 1.8 ms in an hour and
33 ms in 18.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from librt.strings import BytesWriter, write_f64_le

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after, nanoseconds, seconds_between
from airlink.messages import Message
from airlink.messages.system import Timesync
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.gnss_clock import GnssClock
from gcs_formation.link.own_delays import OwnDelays
from gcs_formation.link.stamp_map import StampMap

AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
STEADY_TRIPS, STEADY_S = 12, 3e-3
"""A link is steady if this many round trips in a row differ by no more, besides the wait for the vehicle's loop."""
KNOWN_TRIPS: Final = 200
"""The wait for a loop of 20 ms, 5.8 ms (standard deviation), leaves 0.2 ms of a clock's offset after so many. Tuned:
round trips; 100 to 500; shown by `pytest tests/gcs_formation/link`."""
MAX_PENDING: Final = 256
"""Number of unanswered requests kept: one minute of them. Tuned: requests; 64 to 1024; shown by `pytest
tests/gcs_formation/link`."""


class RoundTrips:
    """The TIMESYNC requests to one vehicle, and what answers to them and to commands tell.

    Source: MAVLink documentation, "Time Synchronization Protocol v2".
    """

    def __init__(self, loop_s: float, *, by_utc: bool = False) -> None:
        """Start without requests; the vehicle answers in a loop with period `loop_s`, s.

        With `by_utc` stamps are mapped by the vehicle's UTC once that is known.
        """
        self.loop_s, self.by_utc = loop_s, by_utc
        self.own: OwnDelays | None = None
        """Estimates the delays from outside."""
        self.clock = ClockSync(loop_s)
        self.stamps = self._new_stamps()
        self.delays = BytesWriter()
        """Four 64-bit numbers for each answered request: arrival, ns; half the round trip, the delay up and the delay
        down, s, NaN while the asymmetry is unknown."""
        self._answered = NEVER
        """Arrival of the newest answer to any message."""
        self.answered_to = Instant(0)
        """When the newest answered request was sent."""
        self.requests = 0
        """Number of requests so far."""
        self._pending = list[Instant]()
        """Send times of the unanswered requests, oldest first."""
        self._recent_s = deque[float](maxlen=STEADY_TRIPS)
        self._arrivals = deque[Instant](maxlen=STEADY_TRIPS)
        """The last round trips, and when each ended."""

    def request(self, now: Instant, system: int = 0) -> Timesync:
        """Return a TIMESYNC request to the autopilot of a system; its stamp identifies the answer.

        Routers pass on what names its target, and on a shared line no other answers.
        """
        self._pending.append(now)
        self.requests += 1
        if len(self._pending) > MAX_PENDING:
            self._pending.pop(0)
        return Timesync(0, now, system, AUTOPILOT if system else 0)

    def overdue(self, usual_s: float, now: Instant) -> int:
        """Return how many of the newest requests in a row should have been answered, within `usual_s`, and weren't."""
        due, since, count = after(now, -usual_s), self.clock.asked, 0
        if self._answered != NEVER:
            since = max(since, after(self._answered, -usual_s))
        for index in range(len(self._pending) - 1, -1, -1):
            sent = self._pending[index]
            if sent <= since:
                break
            if sent <= due:
                count += 1
        return count

    @property
    def steady(self) -> bool:
        """Whether the clock is known by many round trips, of which the last were alike, and none is overdue."""
        recent_s = self._recent_s
        alike = len(recent_s) == STEADY_TRIPS and max(recent_s) - min(recent_s) <= self.loop_s + STEADY_S
        return alike and len(self._pending) <= 1 and self.clock.samples >= KNOWN_TRIPS

    def longest_s(self, since: Instant) -> float:
        """Return the longest of the last round trips that ended since an instant; NaN if none did."""
        each = zip(self._arrivals, self._recent_s, strict=True)
        return max([trip_s for at, trip_s in each if at >= since], default=math.nan)

    def shortest_s(self, since: Instant, fewest: int) -> float:
        """Return the shortest of the round trips that ended since an instant; NaN if these are fewer than `fewest`."""
        each = zip(self._arrivals, self._recent_s, strict=True)
        trips_s = [trip_s for at, trip_s in each if at >= since]
        return min(trips_s) if len(trips_s) >= fewest else math.nan

    def forget_requests(self, now: Instant) -> None:
        """Drop pending requests: answers that waited in our own queue would not measure the link. None is overdue."""
        self._pending.clear()
        self._answered = now

    def record_answer(self, now: Instant) -> None:
        """Record an answer to any message."""
        self._answered = now

    @property
    def answers_commands(self) -> bool:
        """Whether it has answered anything."""
        return self._answered != NEVER

    def awaits(self, message: Message | None) -> bool:
        """Return whether a message answers a pending request."""
        return isinstance(message, Timesync) and message.tc1_ns != 0 and message.ts1_ns in self._pending

    def is_answer(self, message: Timesync) -> bool:
        """Return whether a message answers a pending request, and remove that request."""
        for index in range(len(self._pending) - 1, -1, -1):
            if self._pending[index] == message.ts1_ns:
                self._pending.pop(index)
                return True
        return False

    def measure(self, answer: Timesync, now: Instant) -> bool:
        """Update delay and clock with an answer that arrived now; return whether the vehicle's clock has restarted."""
        sent = Instant(answer.ts1_ns)
        self._recent_s.append(seconds_between(sent, now))
        self._arrivals.append(now)
        restarted = self.clock.observe(sent, answer.tc1_ns, now)
        if restarted:
            self.stamps = self._new_stamps()
        if self.own is not None:
            self._take_own(self.own, sent, answer.tc1_ns, now, restarted)
        if self.gnss is not None:
            self.gnss.probe(sent, answer.tc1_ns, now)
        one_way_s = self.clock.last_one_way_s()
        up_s, down_s = self.stamps.up_down_s(one_way_s) if self.own is None else self.own.up_down_s
        write_f64_le(self.delays, float(now))
        write_f64_le(self.delays, one_way_s)
        write_f64_le(self.delays, up_s)
        write_f64_le(self.delays, down_s)
        return restarted

    def _take_own(self, own: OwnDelays, sent: Instant, vehicle_ns: int, now: Instant, restarted: bool) -> None:
        """Have the delays estimated from outside; our clock maps stamps by their asymmetry."""
        clock = self.clock
        if restarted:
            own.reset()
        usual_s = max(0.0, clock.one_way_s + clock.asymmetry_s), max(0.0, clock.one_way_s - clock.asymmetry_s)
        up_s, down_s = own.estimate(sent, vehicle_ns, now, self.loop_s, usual_s)
        clock.one_way_s, clock.asymmetry_s = (up_s + down_s) / 2, (up_s - down_s) / 2

    @property
    def knows_asymmetry(self) -> bool:
        """Whether the delays' asymmetry, and so each of up and down, may be known."""
        return self.own is not None or self.stamps.gnss is not None

    @property
    def gnss(self) -> GnssClock | None:
        """The vehicle's clock against UTC, None if UTC isn't wanted."""
        return self.stamps.gnss

    @property
    def up_down_s(self) -> tuple[float, float]:
        """Delay up and down, s; NaN while the asymmetry is unknown."""
        return self.stamps.up_down_s(self.clock.one_way_s) if self.own is None else self.own.up_down_s

    @property
    def down_s(self) -> float:
        """Delay down, s: half the round trip while the asymmetry is unknown; NaN before the first."""
        if not self.knows_asymmetry:
            return self.clock.one_way_s
        down_s = self.up_down_s[1]
        return self.clock.one_way_s if math.isnan(down_s) else down_s

    def received_at(self, now: Instant) -> Instant:
        """Return until when it is known to have received the station: its newest answer's time less the delay down.

        Before the first answer this is `now`.
        """
        if self._answered == NEVER:
            return now
        down_s = self.down_s
        return self._answered if math.isnan(down_s) else Instant(self._answered - nanoseconds(down_s))

    def unanswered_s(self, last_received: Instant) -> float:
        """Return the time from its newest answer to its last frame, s."""
        return 0.0 if self._answered == NEVER else max(0.0, seconds_between(self._answered, last_received))

    def _new_stamps(self) -> StampMap:
        return StampMap(self.clock, GnssClock(self.loop_s) if self.by_utc else None)

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
from itertools import islice
from statistics import median, median_high, median_low
from typing import Final

from librt.strings import BytesWriter, write_f64_le

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, NEVER, Instant, after, nanoseconds, seconds_between
from airlink.messages import Message
from airlink.messages.system import Timesync
from gcs_formation.link.clock_filter import ClockFilter
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.own_delays import OwnDelays
from gcs_formation.link.trip_variance import RESOLUTION_S

DRIFT = 1e-4
"""Standard deviation of an unknown crystal's drift."""
OFFSET_NOISE, DRIFT_NOISE = 1e-5, 2e-8
"""Random walk of offset (s) and drift, per square root of a second."""
FEWEST = 8
"""Number of round trips after which the split is known."""
WINDOW = 12
"""Number of round trips (3 s) over which a step is tested, by the median of their innovations."""
PRIOR_JITTER_S, PRIOR_WEIGHT = 0.02, 4.0
"""Prior standard deviation of round trips, and the number of samples that it weighs, until `WINDOW` are known. Without
it, two round trips that agree by chance would fix the first estimate for minutes."""
STEP_SIGMAS, STEP_S = 5.0, 3e-3
GATE_SIGMAS, GATE_S = 4.0, 5e-3
TRIP_SIGMAS, MEDIAN = 2.0, 1.2533
"""A step is the link's if round trips changed with it by more than this multiple of what their medians differ by by
chance. Ratio of a median's standard deviation to a mean's, for normally distributed noise."""
UNSTEADY_STEPS, UNSTEADY_S = 4, 60.0
"""A clock that steps this many times within `UNSTEADY_S`, with round trips as long as before, is unsteady."""
OLDEST_UNIX_S = 1.5e9
"""Times before July 2017 mean that UTC hasn't been set."""
EPOCH_YEAR, YEAR_S = 1970, 365.2425 * 86400.0
JUMP_S = 0.01
UNKNOWN_DRIFT_S = 0.01
"""Largest error by drift with which UTC is used, s."""
SIGMAS = 3.0
"""Number of standard deviations of the drift taken as its bounds."""
IN_USE = 2.0
"""UTC that is already in use is kept up to this multiple of `UNKNOWN_DRIFT_S`."""
UNKNOWN_DELAYS_S = math.nan, math.nan
EPOCH = Instant(0)
AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
STEADY_TRIPS, STEADY_S = 12, 3e-3
"""A link is steady if this many round trips in a row differ by no more, besides the wait for the vehicle's loop."""
KNOWN_TRIPS: Final = 200
"""The wait for a loop of 20 ms, 5.8 ms (standard deviation), leaves 0.2 ms of a clock's offset after so many."""
MAX_PENDING: Final = 256
"""Number of unanswered requests kept: one minute of them."""


class GnssClock:
    """One vehicle's clock against UTC and against ours."""

    def __init__(self, loop_s: float) -> None:
        """Start without samples; `loop_s` is the period of the vehicle's loop that answers requests."""
        self._loop_s = loop_s
        self.samples = 0
        self.jump_s = 0.0
        """Jump of its UTC since it was last accepted, s, 0 if there is none; a jump in flight isn't followed."""
        self._filter = ClockFilter(DRIFT, OFFSET_NOISE, DRIFT_NOISE)
        self._trips = deque[float](maxlen=WINDOW)
        self._spans = deque[tuple[float, float]](maxlen=2 * WINDOW)
        """Twice as many, and how far off the estimate each one's midpoint was."""
        self._off = deque[tuple[float, float]](maxlen=WINDOW)
        self._steps = deque[Instant](maxlen=UNSTEADY_STEPS)
        self._utc_s = math.nan
        self._unset_year = 0
        """Year of the last UTC that can't be; 0 if none was."""
        self._readings = 0
        self._disarmed_s: float | None = None
        """Time since boot of the last UTC reading while disarmed."""
        self._first_s = math.nan

    @property
    def drift(self) -> float:
        """Rate of the vehicle's clock relative to ours, minus 1."""
        return self._filter.drift

    @property
    def half_round_trip_s(self) -> float:
        """How far off the clock's estimate may be at most by the recent round trips: it was read while each lasted.

        Half of a trip and what its own midpoint differs by. A trip of before a step of the link, or of after one that
        the estimate hasn't followed yet, so doesn't count as if the estimate were its own.
        """
        recent = islice(reversed(self._spans), WINDOW)
        return min((trip_s / 2 + abs(off_s) for trip_s, off_s in recent), default=math.nan)

    def why_not(self, *, used: bool = False) -> str | None:
        """Return why its UTC can't be used, None if it can; `used`: it is in use already."""
        if math.isnan(self._utc_s):
            return self._why_none()
        if self.samples < FEWEST:
            return "it has answered too few requests"
        if len(self._steps) == UNSTEADY_STEPS and seconds_between(self._steps[0], self._filter.reference) < UNSTEADY_S:
            return "its clock doesn't run steadily"
        max_s = UNKNOWN_DRIFT_S * (IN_USE if used else 1.0)
        if self._disarmed_s is None and self.drift < 0 and -self.drift * self._first_s > max_s:
            return "it was armed before it was first heard, and its clock has drifted since"
        unsure_s = self.utc_uncertainty_s()
        if unsure_s > max_s:
            return f"its clock's drift isn't known well enough: {unsure_s:.3f} s more or less since it had UTC last"
        return None

    def _why_none(self) -> str:
        if self._unset_year > EPOCH_YEAR:
            return f"the UTC that it sends is of {self._unset_year}, which can't be: its receiver hasn't set it yet"
        return "it sends no UTC"

    def utc_uncertainty_s(self) -> float:
        """Return the bound of its UTC's error by unknown drift, s (three standard deviations)."""
        off = SIGMAS * self._filter.drift_deviation
        boot_s = self._filter.reference / NANOSECONDS + self._filter.offset_s
        gained_s = self._gained_s(self.drift, boot_s)
        return max(abs(self._gained_s(self.drift + each, boot_s) - gained_s) for each in (off, -off))

    def probe(self, sent: Instant, vehicle_time_ns: int, received: Instant) -> None:
        """Take an answered TIMESYNC request."""
        trip_s, middle = seconds_between(sent, received), Instant((sent + received) // 2)
        self._trips.append(trip_s)
        wait_s, variance = self._wait(trip_s)
        # The vehicle reads its clock after waiting for its loop: half of that wait later than the midpoint.
        sample_s = (vehicle_time_ns - middle) / NANOSECONDS - wait_s / 2
        self.samples += 1
        if self.samples == 1:
            self._filter.begin(middle, sample_s, variance)
            self._spans.append((trip_s, 0.0))
            return
        self._filter.advance(middle)
        off_s = sample_s - self._filter.predict(middle)
        self._off.append((off_s, variance))
        self._spans.append((trip_s, off_s))
        if abs(off_s) <= GATE_SIGMAS * math.sqrt(self._filter.offset_variance + variance) + GATE_S:
            self._filter.correct(middle, sample_s, variance)
        self._judge_step()

    def utc(self, unix_s: float, boot_s: float, *, armed: bool) -> None:
        """Take UTC and time since boot, from one SYSTEM_TIME."""
        if unix_s < OLDEST_UNIX_S:
            self._unset_year = EPOCH_YEAR + int(max(0.0, unix_s) / YEAR_S)
            return
        ahead_s = unix_s - boot_s
        if math.isnan(self._utc_s):
            self._first_s = boot_s
        elif abs(ahead_s - self._utc_s) > JUMP_S and armed:
            self.jump_s = ahead_s - self._utc_s
            return
        fresh = math.isnan(self._utc_s) or not armed
        self._readings = 1 if fresh else self._readings + 1
        self._utc_s = ahead_s if fresh else self._utc_s + (ahead_s - self._utc_s) / self._readings
        self.jump_s = 0.0
        if not armed:
            self._disarmed_s = boot_s

    def to_utc_s(self, boot_s: float) -> float:
        """Return UTC, s since 1970, at a time since boot."""
        return boot_s + self._utc_s - self._gained_s(self.drift, boot_s)

    def station_utc_s(self) -> float:
        """Return UTC minus our clock, s, on the assumption of equal delays up and down.

        An uplink delay that is longer by d makes the result too large by d/2.
        """
        reference_s = self._filter.reference / NANOSECONDS
        return self.to_utc_s(reference_s + self._filter.offset_s) - reference_s

    def _gained_s(self, drift: float, boot_s: float) -> float:
        """Return what its UTC has gained on true UTC by drift, at a time since boot."""
        if drift >= 0:
            return drift * boot_s
        return drift * (boot_s - (self._first_s / 2 if self._disarmed_s is None else self._disarmed_s))

    def _wait(self, trip_s: float) -> tuple[float, float]:
        """Return a round trip's wait for the answering loop, and the variance of the midpoint.

        It is the best linear estimate: the wait is uniformly distributed, the remaining jitter is the link's.
        """
        count = len(self._trips)
        mean_s = sum(self._trips) / count
        prior = PRIOR_WEIGHT if count < WINDOW else 0.0
        off_s2 = sum((each - mean_s) ** 2 for each in self._trips) + prior * PRIOR_JITTER_S**2
        jitter_s2 = off_s2 / (count - 1 + prior)
        loop_s2 = self._loop_s**2 / 12
        share = min(1.0, loop_s2 / jitter_s2) if jitter_s2 > 0 else 1.0
        wait_s = self._loop_s / 2 + share * (trip_s - mean_s)
        rest_s = (1.0 - share) * (trip_s - mean_s)
        return wait_s, RESOLUTION_S**2 + (max(0.0, jitter_s2 - loop_s2) + rest_s**2) / 4

    def _judge_step(self) -> None:
        """Attribute a common step of the last round trips to the link's split, and shift the offset by it."""
        if len(self._off) < WINDOW:
            return
        off_s = [each for each, _ in self._off]
        step_s = min(median_low(off_s), median_high(off_s), key=abs)  # where half of them are old, not half of a step
        variance = median(variance for _, variance in self._off)
        if abs(step_s) <= STEP_SIGMAS * math.sqrt(variance / WINDOW) + STEP_S:
            return
        reference = self._filter.reference
        self._filter.step(reference, self._filter.offset_s + step_s, variance)
        self._off.clear()
        if not self._trips_step_with(step_s):
            self._steps.append(reference)
        self._spans = deque([(trip_s, off_s - step_s) for trip_s, off_s in self._spans], 2 * WINDOW)

    def _trips_step_with(self, step_s: float) -> bool:
        """Return whether the round trips' length changed with a step of their midpoints: a clock's changes none."""
        before_s = [trip_s for trip_s, off_s in self._spans if abs(off_s) < abs(off_s - step_s)]
        since_s = [trip_s for trip_s, off_s in self._spans if abs(off_s) >= abs(off_s - step_s)]
        if not before_s or not since_s:
            return False
        total_s2 = 0.0
        for trips_s in (before_s, since_s):
            mean_s = sum(trips_s) / len(trips_s)
            total_s2 += sum((each - mean_s) ** 2 for each in trips_s)
        jitter_s2 = total_s2 / max(1, len(self._spans) - 2)
        chance_s = MEDIAN * math.sqrt(jitter_s2 * (1.0 / len(before_s) + 1.0 / len(since_s)))
        return abs(median(since_s) - median(before_s)) > TRIP_SIGMAS * chance_s + STEP_S


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
        down, s, NaN while the split is unknown."""
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
        for place in range(len(self._pending) - 1, -1, -1):
            sent = self._pending[place]
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

    def hear(self, now: Instant) -> None:
        """Record an answer to any message."""
        self._answered = now

    def awaits(self, message: Message | None) -> bool:
        """Return whether a message answers a pending request."""
        return isinstance(message, Timesync) and message.tc1_ns != 0 and message.ts1_ns in self._pending

    def is_answer(self, message: Timesync) -> bool:
        """Return whether a message answers a pending request, and remove that request."""
        for place in range(len(self._pending) - 1, -1, -1):
            if self._pending[place] == message.ts1_ns:
                self._pending.pop(place)
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
        up_s, down_s = own.take(sent, vehicle_ns, now, self.loop_s, usual_s)
        clock.one_way_s, clock.asymmetry_s = (up_s + down_s) / 2, (up_s - down_s) / 2

    @property
    def knows_ways(self) -> bool:
        """Whether delays up and down may be known apart."""
        return self.own is not None or self.stamps.gnss is not None

    @property
    def gnss(self) -> GnssClock | None:
        """The vehicle's clock against UTC, None if UTC isn't wanted."""
        return self.stamps.gnss

    @property
    def up_down_s(self) -> tuple[float, float]:
        """Delay up and down, s; NaN while the split is unknown."""
        return self.stamps.up_down_s(self.clock.one_way_s) if self.own is None else self.own.up_down_s

    @property
    def down_s(self) -> float:
        """Delay down, s: half the round trip while the split is unknown; NaN before the first."""
        if not self.knows_ways:
            return self.clock.one_way_s
        down_s = self.up_down_s[1]
        return self.clock.one_way_s if math.isnan(down_s) else down_s

    def heard_at(self, now: Instant) -> Instant:
        """Return until when it is known to have heard the station: its newest answer's time less the delay down.

        Before the first answer this is `now`.
        """
        if self._answered == NEVER:
            return now
        down_s = self.down_s
        return self._answered if math.isnan(down_s) else Instant(self._answered - nanoseconds(down_s))

    def unanswered_s(self, last_heard: Instant) -> float:
        """Return the time from its newest answer to its last frame, s."""
        return 0.0 if self._answered == NEVER else max(0.0, seconds_between(self._answered, last_heard))

    def _new_stamps(self) -> StampMap:
        return StampMap(self.clock, GnssClock(self.loop_s) if self.by_utc else None)

"""Maps a vehicle's clock to ours, and measures the delay, from TIMESYNC round trips.

Sources: MAVLink guide, "Time Synchronization Protocol v2"; the weighting of samples by their excess
delay is NTP's clock filter (RFC 5905, section 10) put into a two-state Kalman filter.
"""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS, Instant, nanoseconds
from flight_model.autopilot_model import squared

WINDOW: Final = 16
"""Number of round trips (4 s) over which the fastest is determined and the delay is averaged."""
RESOLUTION_S: Final = 0.5e-3
"""Standard deviation of a sample that had no excess delay."""
STEPPED: Final = 8
"""A link's delay has stepped once this many round trips in a row (2 s) are `FAR` from those before."""
SPLIT_S: Final = 30.0
"""Time constant with which a round trip's split, as a step showed it, is forgotten: steps too small or too slow to be
seen add up meanwhile."""
FAR: Final = 4.0
"""Round trips this many times as far off as either group scatters are far from those before."""
NORMAL: Final = 1.4826
"""Standard deviation of normal noise by its median absolute deviation."""
FEW: Final = 8
UNKNOWN_SCATTER_S: Final = 0.1
"""Assumed standard deviation of round trips as long as there are fewer than `FEW`, large: these aren't believed."""
CRYSTAL_DRIFT: Final = 1e-4
"""Standard deviation of an unknown clock's rate, if a crystal keeps it."""
INITIAL_DRIFT: Final = 0.02
"""The same, if nothing is known of it: a PX4 simulator's runs 1.5 % off."""
UNUSUAL: Final = math.log(100.0)
"""By so much the logarithm of the likelihood has to speak against a crystal."""
OFFSET_NOISE: Final = 1e-4
DRIFT_NOISE: Final = 2e-6
"""Random walk of offset (s) and drift per square root of a second."""
STEP_S: Final = 1.0
"""A sample that is off by more than its uncertainty and this shows that the clock has stepped, or begun anew."""


class ClockFilter:
    """A Kalman filter of a clock's offset and drift."""

    def __init__(
        self, believed_drift: float, offset_noise: float = OFFSET_NOISE, drift_noise: float = DRIFT_NOISE
    ) -> None:
        """Start with a standard deviation of the clock's rate.

        Offset (s) and drift are taken to wander by `offset_noise` and `drift_noise` per square root of a second.
        """
        self.offset_s: float = math.nan
        """The clock minus ours at the reference."""
        self.drift: float = 0.0
        """Rate of change of the offset."""
        self._believed_drift, self._offset_noise, self._drift_noise = believed_drift, offset_noise, drift_noise
        self.reference = Instant(0)
        """Of which instant its offset is."""
        self._p00: float = 1.0
        self._p01: float = 0.0
        self._p11: float = squared(believed_drift)
        """Variance of offset and drift."""

    def predict(self, at: Instant) -> float:
        """Return the offset at an instant, s."""
        return self.offset_s + self.drift * (at - self.reference) / NANOSECONDS

    def begin(self, at: Instant, sample_s: float, variance: float) -> None:
        """Start with a clock of which this sample, of a variance in s², is the first."""
        self.drift, self._p11 = 0.0, squared(self._believed_drift)
        self.step(at, sample_s, variance)

    def step(self, at: Instant, sample_s: float, variance: float) -> None:
        """Follow a clock that has stepped: its rate is what it was."""
        self.offset_s, self.reference = sample_s, at
        self._p00, self._p01 = variance, 0.0

    def correct(self, at: Instant, sample_s: float, variance: float) -> float:
        """Take a sample of the offset, s; return the logarithm of its likelihood, but for a constant.

        One that comes late, behind a newer one, is held against what the offset was then.
        """
        self.advance(at)
        total = self._p00 + variance
        innovation_s = sample_s - self.predict(at)
        gain0, gain1 = self._p00 / total, self._p01 / total
        self.offset_s += gain0 * innovation_s
        self.drift += gain1 * innovation_s
        self._p11 -= gain1 * self._p01
        self._p00 *= 1.0 - gain0
        self._p01 *= 1.0 - gain0
        return (0.0 - math.log(total) - squared(innovation_s) / total) / 2.0

    def to_instant(self, clock_s: float) -> Instant:
        """Return our instant at which the clock showed a time, s."""
        at_reference_s = self.reference / NANOSECONDS + self.offset_s
        return Instant(self.reference + nanoseconds((clock_s - at_reference_s) / (1 + self.drift)))

    def age_s(self, clock_s: float, now: Instant) -> float:
        """Return how long before `now` the clock showed a time, s."""
        since_s = (now - self.reference) / NANOSECONDS
        return since_s - (clock_s - self.reference / NANOSECONDS - self.offset_s) / (1 + self.drift)

    @property
    def offset_variance(self) -> float:
        """Variance of the offset, s²."""
        return self._p00

    @property
    def drift_deviation(self) -> float:
        """Standard deviation of the drift."""
        return math.sqrt(max(0.0, self._p11))

    def advance(self, to: Instant) -> None:
        """Let the clock run on to an instant; it never runs back."""
        if to <= self.reference:
            return
        elapsed_s = (to - self.reference) / NANOSECONDS
        self.offset_s += self.drift * elapsed_s
        self.reference = to
        grown = elapsed_s * (2.0 * self._p01 + elapsed_s * self._p11)
        self._p00 = self._p00 + grown + squared(self._offset_noise) * elapsed_s
        self._p01 += elapsed_s * self._p11
        self._p11 += squared(self._drift_noise) * elapsed_s


class ClockSync:
    """Maps a vehicle's time since boot to our instants.

    Two filters take the same samples: one believes that a crystal keeps the clock's rate, the other nothing. The first
    is used until the samples say that it is wrong (static multiple models: Bar-Shalom, Li, Kirubarajan, "Estimation
    with Applications to Tracking and Navigation", 11.6.2). Samples are weighted by how much their round trips took
    longer than the fastest, and by how much round trips vary.

    A clock doesn't step as round trips do, so by how much the samples step then tells which way takes longer than it
    did. The filters follow the samples at once, and stamps are mapped as before until that is forgotten.
    """

    def __init__(self, loop_s: float = 0.0) -> None:
        """Start with nothing known; `loop_s`: period of the loop on which the vehicle answers."""
        self.loop_s = loop_s
        """Half of it is in every round trip."""
        self.round_trip_s = math.nan
        self.samples = 0
        self.one_way_s = math.nan
        """Half the mean of the recent round trips, without the answering loop's share."""
        self._crystal, self._any = ClockFilter(CRYSTAL_DRIFT), ClockFilter(INITIAL_DRIFT)
        self._used = self._crystal
        self._unlike: float = 0.0
        """Logarithm of how many times as likely the samples are if nothing is believed of the clock's rate."""
        self._asked = Instant(0)
        """When the newest answered probe was sent: the vehicle ran on its clock after that."""
        self._shown_ns = 0
        """What the clock showed last."""
        self._recent, self._count = vec[float]([0.0] * WINDOW), i64(0)
        """The last round trips, the oldest first, and how many there are."""
        self._off = vec[float]([0.0] * WINDOW)
        """By how much the samples of those were off what was predicted."""
        self.split_s: float = 0.0
        """How much longer than half the round trip the way up takes, as far as a step told."""
        self._sorted = vec[float]([0.0] * WINDOW)

    @property
    def offset_s(self) -> float:
        """The vehicle's clock minus ours when it was read last; NaN before."""
        return self._used.offset_s

    @property
    def drift(self) -> float:
        """The offset's rate of change."""
        return self._used.drift

    @property
    def scatter_s(self) -> float:
        """Standard deviation of the recent round trips."""
        recent, count, mean_s, total = self._recent, self._count, self._mean_s(), 0.0
        if count < 2:
            return 0.0
        for place in range(count):
            total += squared(recent[place] - mean_s)
        return math.sqrt(total / (float(count) - 1.0))

    @property
    def usual_scatter_s(self) -> float:
        """The same, of most round trips alone: few that are far off aren't in it."""
        return min(self.scatter_s, self._usual_scatter_s(self._count))

    def _usual_scatter_s(self, count: i64) -> float:
        """Return the standard deviation of noise that has the median absolute deviation of the first `count`."""
        middle_s, each = self._median_s(0, count), self._sorted
        for place in range(count):
            each[place] = abs(each[place] - middle_s)
        return NORMAL * _median(each, count)

    def _median_s(self, begin: i64, end: i64) -> float:
        """Return the median of the recent round trips from one place to before another, and leave these sorted."""
        return self._median_of(self._recent, begin, end)

    def _median_of(self, values: vec[float], begin: i64, end: i64) -> float:
        each = self._sorted
        for place in range(begin, end):
            each[place - begin] = values[place]
        return _median(each, end - begin)

    def _take(self, round_trip_s: float, off_s: float) -> float:
        """Take a round trip, and how far off its sample was.

        Return by how much samples step where this shows that the link has, beyond chance: 0 where both ways step alike.
        """
        recent, off, count = self._recent, self._off, self._count
        if count == WINDOW:
            count -= 1
            for place in range(count):
                recent[place], off[place] = recent[place + 1], off[place + 1]
        recent[count], off[count] = round_trip_s, off_s
        self._count = count + 1
        known = self._count == WINDOW  # for long enough before: the first probes wait for who knows what
        if not self._forget_before_step() or not known:
            return 0.0
        step_s = self._median_of(off, 0, STEPPED)
        return step_s if abs(step_s) > self._usual_scatter_s(STEPPED) else 0.0

    def _forget_before_step(self) -> bool:
        """Forget the round trips before the last few, where these are far from the others' median; return whether."""
        recent, since = self._recent, self._count - STEPPED
        if since <= 0:
            return False
        near_s = FAR * _range(recent, since, self._count)
        if _range(recent, 0, self._count) <= near_s:
            return False  # as nearly always: no two are farther apart
        apart_s = abs(self._median_s(since, self._count) - self._median_s(0, since))
        stepped = apart_s > near_s and apart_s > near_s + FAR * self._usual_scatter_s(since)
        if stepped:
            for place in range(STEPPED):
                recent[place], self._off[place] = recent[since + place], self._off[since + place]
            self._count = STEPPED
        return stepped

    def _follow_link(self, at: Instant, step_s: float, variance: float) -> None:
        """Follow the samples where the link has stepped; what they step by is the link's, not the clock's."""
        self._crystal.step(at, self._crystal.predict(at) + step_s, variance)
        self._any.step(at, self._any.predict(at) + step_s, variance)
        self.split_s += step_s

    def _mean_s(self) -> float:
        recent, count, total = self._recent, self._count, 0.0
        for place in range(count):
            total += recent[place]
        return total / float(count) if count else math.nan

    def last_one_way_s(self) -> float:
        """Half of the last round trip, without the answering loop's mean share; can be below 0."""
        return (self.round_trip_s - self.loop_s / 2) / 2

    def observe(self, sent: Instant, vehicle_time_ns: int, received: Instant) -> bool:
        """Take an answered probe; return whether it shows that the vehicle's clock has restarted."""
        self.round_trip_s = (received - sent) / NANOSECONDS
        middle = Instant((sent + received) // 2)
        sample_s = (vehicle_time_ns - middle) / NANOSECONDS
        off_s = self._off_s(middle, sample_s) if self.samples else 0.0
        step_s = self._take(self.round_trip_s, off_s)
        self.one_way_s = max(0.0, (self._mean_s() - self.loop_s / 2) / 2)
        stepped = abs(off_s) > STEP_S + self.round_trip_s / 2
        # A clock that stood still (a machine or a simulator was held up) is behind, shows no less than it did, and has
        # run for longer than nothing was read of it. Any other has begun anew, or is another vehicle's.
        restarted = stepped and (
            off_s > 0.0
            or vehicle_time_ns < self._shown_ns
            or vehicle_time_ns <= (received - self._asked) * (1.0 + INITIAL_DRIFT)
        )
        variance = self._sample_variance()
        if self.samples == 0 or restarted:
            self._crystal.begin(middle, sample_s, variance)
            self._any.begin(middle, sample_s, variance)
            self._unlike, self._used, self.split_s = 0.0, self._crystal, 0.0
        elif step_s:
            self._follow_link(middle, step_s, variance)
        elif stepped:
            self._crystal.step(middle, sample_s, variance)
            self._any.step(middle, sample_s, variance)
        else:
            crystal, unknown = (
                self._crystal.correct(middle, sample_s, variance),
                self._any.correct(middle, sample_s, variance),
            )
            self._judge(unknown - crystal)
        # nothing arrives before it was sent
        left_s = self.split_s * math.exp(-max(0.0, (sent - self._asked) / NANOSECONDS) / SPLIT_S)
        self.split_s = max(-self.one_way_s, min(self.one_way_s, left_s))
        self._asked, self._shown_ns = max(self._asked, sent), vehicle_time_ns
        self.samples += 1
        return restarted

    def to_instant(self, vehicle_time_s: float) -> Instant:
        """Return our instant for a vehicle's time since boot in seconds."""
        return self._used.to_instant(vehicle_time_s + self.split_s)

    def age_s(self, vehicle_time_s: float, now: Instant) -> float:
        """Return how long before `now` a vehicle's time since boot was, s."""
        return self._used.age_s(vehicle_time_s + self.split_s, now)

    def _judge(self, unlike: float) -> None:
        """Take how much less likely a sample is if a crystal keeps the clock; not before its scatter is known."""
        if self._count >= FEW:
            self._unlike += unlike
            self._used = self._any if self._unlike > UNUSUAL else self._crystal

    def _off_s(self, at: Instant, sample_s: float) -> float:
        """Return how far a sample is off what the filter predicts that is nearer to it."""
        one_s, other_s = sample_s - self._crystal.predict(at), sample_s - self._any.predict(at)
        return one_s if abs(one_s) < abs(other_s) else other_s

    def _sample_variance(self) -> float:
        """Return the variance of a sample's offset, from half its own excess delay and half the delays' scatter.

        Where queues cause the delay, the fastest round trips are the most accurate; where both delays vary at random,
        none is better than the others.
        """
        recent, fastest_s = self._recent, self.round_trip_s
        for place in range(self._count):
            fastest_s = min(fastest_s, recent[place])
        excess_s = self.round_trip_s - fastest_s
        scatter_s = self.scatter_s if self._count >= FEW else UNKNOWN_SCATTER_S
        return squared(RESOLUTION_S) + (squared(excess_s) + squared(scatter_s)) / 4


def _range(values: vec[float], begin: i64, end: i64) -> float:
    """Return by how much the greatest exceeds the least, from one place to before another."""
    least = greatest = values[begin]
    for place in range(begin, end):
        least, greatest = min(least, values[place]), max(greatest, values[place])
    return greatest - least


def _median(values: vec[float], count: i64) -> float:
    """Return the median of the first `count` values, 0 of none; they are sorted in place."""
    for end in range(1, count):
        value, place = values[end], end
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value
    middle = count // 2
    if count % 2:
        return values[middle]
    return (values[middle - 1] + values[middle]) / 2.0 if count else 0.0

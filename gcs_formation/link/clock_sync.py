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
"""So many round trips in a row (2 s) that are far from those before are what the link takes from now on."""
FAR: Final = 4.0
"""By how many times what either scatters they are that."""
NORMAL: Final = 1.4826
"""Standard deviation of normal noise by its median absolute deviation."""
FEW: Final = 8
UNKNOWN_SCATTER_S: Final = 0.02
"""Assumed standard deviation of round trips as long as there are fewer than `FEW`."""
INITIAL_DRIFT: Final = 0.02
"""Standard deviation of an unknown clock's rate: a PX4 simulator's runs 1.5 % off."""
OFFSET_NOISE: Final = 1e-4
DRIFT_NOISE: Final = 2e-6
"""Random walk of offset (s) and drift per square root of a second."""
STEP_S: Final = 1.0
"""A sample that is off by more than its uncertainty and this shows that the clock has stepped, or begun anew."""


class ClockSync:
    """Maps a vehicle's time since boot to our instants.

    `offset_s` is vehicle minus ours at `reference`, `drift` its rate of change. Samples are
    weighted by how much their round trips took longer than the fastest, and by how much round trips vary.
    """

    def __init__(self, loop_s: float = 0.0) -> None:
        """Start with nothing known; `loop_s`: period of the loop on which the vehicle answers."""
        self.loop_s = loop_s
        """Half of it is in every round trip."""
        self.round_trip_s = math.nan
        self.samples = self.restarts = 0
        self.one_way_s = math.nan
        """Half the mean of the recent round trips, without the answering loop's share."""
        self.offset_s: float = math.nan
        self.drift: float = 0.0
        self._reference = Instant(0)
        self._asked = Instant(0)
        """When the newest answered probe was sent: the vehicle ran on its clock after that."""
        self._shown_ns = 0
        """What the clock showed last."""
        self._p00: float = 1.0
        self._p01: float = 0.0
        self._p11: float = squared(INITIAL_DRIFT)
        """Variance of offset and drift."""
        self._recent, self._count = vec[float]([0.0] * WINDOW), i64(0)
        """The last round trips, the oldest first, and how many there are."""
        self._sorted = vec[float]([0.0] * WINDOW)

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
        """The same, of most round trips alone: a few that are far off, as where a link's delay steps, aren't in it."""
        return min(self.scatter_s, self._usual_scatter_s(self._count))

    def _usual_scatter_s(self, count: i64) -> float:
        """Return the standard deviation of noise that has the median absolute deviation of the first `count`."""
        middle_s, each = self._median_s(0, count), self._sorted
        for place in range(count):
            each[place] = abs(each[place] - middle_s)
        return NORMAL * _median(each, count)

    def _median_s(self, begin: i64, end: i64) -> float:
        """Return the median of the recent round trips from one place to before another, and leave these sorted."""
        recent, each = self._recent, self._sorted
        for place in range(begin, end):
            each[place - begin] = recent[place]
        return _median(each, end - begin)

    def _take(self, round_trip_s: float) -> None:
        recent, count = self._recent, self._count
        if count == WINDOW:
            count -= 1
            for place in range(count):
                recent[place] = recent[place + 1]
        recent[count] = round_trip_s
        self._count = count + 1
        self._forget_before_step()

    def _forget_before_step(self) -> None:
        """Forget the round trips before the last few, where these are far from the others' median."""
        recent, since = self._recent, self._count - STEPPED
        if since <= 0:
            return
        near_s = FAR * _range(recent, since, self._count)
        if _range(recent, 0, self._count) <= near_s:
            return  # as nearly always: no two are farther apart
        apart_s = abs(self._median_s(since, self._count) - self._median_s(0, since))
        if apart_s > near_s and apart_s > near_s + FAR * self._usual_scatter_s(since):
            for place in range(STEPPED):
                recent[place] = recent[since + place]
            self._count = STEPPED

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
        self._take(self.round_trip_s)
        self.one_way_s = max(0.0, (self._mean_s() - self.loop_s / 2) / 2)
        middle = Instant((sent + received) // 2)
        sample_s = (vehicle_time_ns - middle) / NANOSECONDS
        off_s = sample_s - self._predict(middle) if self.samples else 0.0
        stepped = abs(off_s) > STEP_S + self.round_trip_s / 2
        # A clock that stood still (a machine or a simulator was held up) is behind, shows no less than it did, and has
        # run for longer than nothing was read of it. Any other has begun anew, or is another vehicle's.
        restarted = stepped and (
            off_s > 0.0
            or vehicle_time_ns < self._shown_ns
            or vehicle_time_ns <= (received - self._asked) * (1.0 + INITIAL_DRIFT)
        )
        if self.samples == 0 or restarted:
            self._begin(middle, sample_s)
        elif stepped:
            self._step(middle, sample_s)
        else:
            self._advance(middle)
            self._correct(sample_s)
        self._asked, self._shown_ns = max(self._asked, sent), vehicle_time_ns
        self.samples += 1
        self.restarts += restarted
        return restarted

    def to_instant(self, vehicle_time_s: float) -> Instant:
        """Return our instant for a vehicle's time since boot in seconds."""
        at_reference_s = self._reference / NANOSECONDS + self.offset_s
        return Instant(self._reference + nanoseconds((vehicle_time_s - at_reference_s) / (1 + self.drift)))

    def age_s(self, vehicle_time_s: float, now: Instant) -> float:
        """Return how long before `now` a vehicle's time since boot was, s."""
        since_s = (now - self._reference) / NANOSECONDS
        return since_s - (vehicle_time_s - self._reference / NANOSECONDS - self.offset_s) / (1 + self.drift)

    def _predict(self, at: Instant) -> float:
        return self.offset_s + self.drift * (at - self._reference) / NANOSECONDS

    def _begin(self, at: Instant, sample_s: float) -> None:
        self.offset_s, self.drift, self._reference = sample_s, 0.0, at
        self._p00, self._p01, self._p11 = self._sample_variance(), 0.0, squared(INITIAL_DRIFT)

    def _step(self, at: Instant, sample_s: float) -> None:
        """Follow a clock that has stepped: its rate is what it was."""
        self.offset_s, self._reference = sample_s, at
        self._p00, self._p01 = self._sample_variance(), 0.0

    def _advance(self, to: Instant) -> None:
        elapsed_s = max(0.0, (to - self._reference) / NANOSECONDS)
        self.offset_s += self.drift * elapsed_s
        self._reference = to
        grown = elapsed_s * (2.0 * self._p01 + elapsed_s * self._p11)
        self._p00 = self._p00 + grown + squared(OFFSET_NOISE) * elapsed_s
        self._p01 += elapsed_s * self._p11
        self._p11 += squared(DRIFT_NOISE) * elapsed_s

    def _correct(self, sample_s: float) -> None:
        total = self._p00 + self._sample_variance()
        innovation = sample_s - self.offset_s
        gain0, gain1 = self._p00 / total, self._p01 / total
        self.offset_s += gain0 * innovation
        self.drift += gain1 * innovation
        self._p11 -= gain1 * self._p01
        self._p00 *= 1.0 - gain0
        self._p01 *= 1.0 - gain0

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

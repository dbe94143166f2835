"""Maps a vehicle's clock to ours, and measures the delay, from TIMESYNC round trips.

Sources: MAVLink guide, "Time Synchronization Protocol v2"; the weighting of samples by their excess
delay is NTP's clock filter (RFC 5905, section 10) put into a two-state Kalman filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

from airlink.clock import NANOSECONDS, Instant, nanoseconds
from flight_model.autopilot import squared

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


@dataclass
class ClockSync:
    """Maps a vehicle's time since boot to our instants.

    `offset_s` is vehicle minus ours at `reference`, `drift` its rate of change. Samples are
    weighted by how much their round trips took longer than the fastest, and by how much round trips vary.
    """

    loop_s: float = 0.0
    """Period of the loop on which the vehicle answers; half of it is in every round trip."""
    round_trip_s: float = math.nan
    samples: int = 0
    restarts: int = 0
    one_way_s: float = math.nan
    """Half the mean of the recent round trips, without the answering loop's share."""
    offset_s: float = math.nan
    drift: float = 0.0
    _reference: Instant = Instant(0)
    _asked: Instant = Instant(0)
    """When the newest answered probe was sent: the vehicle ran on its clock after that."""
    _shown_ns: int = 0
    """What the clock showed last."""
    _variance: tuple[float, float, float] = (1.0, 0.0, INITIAL_DRIFT**2)
    _recent: list[float] = field(default_factory=list[float])
    """The last round trips, `WINDOW` at most."""

    @property
    def scatter_s(self) -> float:
        """Standard deviation of the recent round trips."""
        count = len(self._recent)
        if count < 2:
            return 0.0
        mean_s = self._mean_s()
        total = 0.0
        for each in self._recent:
            total += squared(each - mean_s)
        return math.sqrt(total / (count - 1.0))

    @property
    def usual_scatter_s(self) -> float:
        """The same, of most round trips alone: a few that are far off, as where a link's delay steps, aren't in it."""
        return min(self.scatter_s, _usual_scatter(self._recent))

    def _forget_before_step(self) -> None:
        """Forget the round trips before the last few, where these are far from the others' median."""
        if len(self._recent) <= STEPPED:
            return
        since = self._recent[-STEPPED:]
        near_s = FAR * _range(since)
        if _range(self._recent) <= near_s:
            return  # as nearly always: no two are farther apart
        before = self._recent[:-STEPPED]
        apart_s = abs(_median(since) - _median(before))
        if apart_s > near_s and apart_s > near_s + FAR * _usual_scatter(before):
            self._recent = since

    def _mean_s(self) -> float:
        total = 0.0
        for each in self._recent:
            total += each
        return total / float(len(self._recent))

    def last_one_way_s(self) -> float:
        """Half of the last round trip, without the answering loop's mean share; can be below 0."""
        return (self.round_trip_s - self.loop_s / 2) / 2

    def observe(self, sent: Instant, vehicle_time_ns: int, received: Instant) -> bool:
        """Take an answered probe; return whether it shows that the vehicle's clock has restarted."""
        self.round_trip_s = (received - sent) / NANOSECONDS
        self._recent.append(self.round_trip_s)
        if len(self._recent) > WINDOW:
            del self._recent[0]
        self._forget_before_step()
        self.one_way_s = max(0.0, (self._mean_s() - self.loop_s / 2) / 2)
        middle = Instant((sent + received) // 2)
        sample_s = (vehicle_time_ns - middle) / NANOSECONDS
        off_s = sample_s - self._predict(middle) if self.samples else 0.0
        stepped = abs(off_s) > STEP_S + self.round_trip_s / 2
        # A clock that stood still (a machine or a simulator was held up) is behind, shows no less than it did, and has
        # run for longer than nothing was read of it. Any other has begun anew, or is another vehicle's.
        began = vehicle_time_ns <= (received - self._asked) * (1.0 + INITIAL_DRIFT)
        restarted = stepped and (off_s > 0.0 or vehicle_time_ns < self._shown_ns or began)
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
        self._variance = (self._sample_variance(), 0.0, squared(INITIAL_DRIFT))

    def _step(self, at: Instant, sample_s: float) -> None:
        """Follow a clock that has stepped: its rate is what it was."""
        self.offset_s, self._reference = sample_s, at
        self._variance = (self._sample_variance(), 0.0, self._variance[2])

    def _advance(self, to: Instant) -> None:
        elapsed_s = max(0.0, (to - self._reference) / NANOSECONDS)
        p00, p01, p11 = self._variance
        self.offset_s += self.drift * elapsed_s
        self._reference = to
        self._variance = (
            p00 + elapsed_s * (2 * p01 + elapsed_s * p11) + squared(OFFSET_NOISE) * elapsed_s,
            p01 + elapsed_s * p11,
            p11 + squared(DRIFT_NOISE) * elapsed_s,
        )

    def _correct(self, sample_s: float) -> None:
        p00, p01, p11 = self._variance
        total = p00 + self._sample_variance()
        innovation = sample_s - self.offset_s
        gain0, gain1 = p00 / total, p01 / total
        self.offset_s += gain0 * innovation
        self.drift += gain1 * innovation
        self._variance = ((1 - gain0) * p00, (1 - gain0) * p01, p11 - gain1 * p01)

    def _sample_variance(self) -> float:
        """Return the variance of a sample's offset, from half its own excess delay and half the delays' scatter.

        Where queues cause the delay, the fastest round trips are the most accurate; where both delays vary at random,
        none is better than the others.
        """
        fastest_s = self.round_trip_s
        for each in self._recent:
            fastest_s = min(fastest_s, each)
        excess_s = self.round_trip_s - fastest_s
        scatter_s = self.scatter_s if len(self._recent) >= FEW else UNKNOWN_SCATTER_S
        return squared(RESOLUTION_S) + (squared(excess_s) + squared(scatter_s)) / 4


def _range(values: list[float]) -> float:
    """Return by how much the greatest of one value or more exceeds the least."""
    least = greatest = values[0]
    for each in values:
        least, greatest = min(least, each), max(greatest, each)
    return greatest - least


def _usual_scatter(values: list[float]) -> float:
    """Return the standard deviation of normal noise that has the values' median absolute deviation."""
    middle = _median(values)
    return NORMAL * _median([abs(each - middle) for each in values])


def _median(values: list[float]) -> float:
    """Return the median, 0 of none."""
    ordered, middle = sorted(values), len(values) // 2
    if len(values) % 2:
        return ordered[middle]
    return (ordered[middle - 1] + ordered[middle]) / 2.0 if values else 0.0

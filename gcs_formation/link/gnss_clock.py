"""A vehicle's clock by the UTC that it reports."""

from __future__ import annotations

import math
from collections import deque
from itertools import islice
from statistics import median, median_high, median_low

from airlink.clock import NANOSECONDS, Instant, seconds_between
from gcs_formation.link.clock_filter import ClockFilter
from gcs_formation.link.trip_variance import RESOLUTION_S

DRIFT = 1e-4
"""Standard deviation of an unknown crystal's drift. Tuned: a number; 5e-5 to 2e-4; shown by `pytest
tests/gcs_formation/link`."""
OFFSET_NOISE, DRIFT_NOISE = 1e-5, 2e-8
"""Random walk of offset (s) and drift, per square root of a second."""
FEWEST = 8
"""Number of round trips after which the split is known. Tuned: round trips; 4 to 16; shown by `python -m
benchmarks.gnss_grid`."""
WINDOW = 12
"""Number of round trips (3 s) over which a step is tested, by the median of their innovations. Tuned: round trips; 8 to
20; shown by `python -m benchmarks.gnss_grid`."""
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
"""Step of UTC against the vehicle's clock from which on it is a jump. Tuned: s; 5e-3 to 50e-3; shown by `pytest
tests/gcs_formation/link`."""
UNKNOWN_DRIFT_S = 0.01
"""Largest error by drift with which UTC is used, s. Tuned: s; 5e-3 to 20e-3; shown by `pytest
tests/gcs_formation/link`."""
SIGMAS = 3.0
"""Number of standard deviations of the drift taken as its bounds. Tuned: standard deviations; 2 to 4; shown by `pytest
tests/gcs_formation/link`."""
IN_USE = 2.0
"""UTC that is already in use is kept up to this multiple of `UNKNOWN_DRIFT_S`. Tuned: ratio; 1.5 to 3; shown by `pytest
tests/gcs_formation/link`."""


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
            self._filter.initialise(middle, sample_s, variance)
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

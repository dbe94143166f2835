"""Maps a vehicle's clock to ours, and measures the delay, from TIMESYNC round trips.

Source: MAVLink guide, "Time Synchronization Protocol v2".
"""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS, Instant, nanoseconds
from flight_model.autopilot_model import squared, within
from gcs_formation.link.clock_filter import CRYSTAL_DRIFT_NOISE, CRYSTAL_OFFSET_NOISE, ClockFilter
from gcs_formation.link.delay_edges import DelayEdges
from gcs_formation.link.round_trip_window import RoundTripWindow
from gcs_formation.link.trip_variance import FEW, TripVariance

ASYMMETRY_S: Final = 30.0
"""Time constant with which the estimate of the delay's split decays: changes too small or slow to detect add up. Tuned:
s; 15 to 120; shown by `python -m benchmarks.latency_grid`."""
CRYSTAL_DRIFT: Final = 5e-5
"""Standard deviation of an unknown clock's drift if a crystal drives it: autopilots' and computers' are specified to 10
to 50 ppm each. Tuned: a number; 2e-5 to 1e-4; shown by `pytest tests/gcs_formation/link`."""
INITIAL_DRIFT: Final = 0.02
"""The same without that assumption: a PX4 simulator's clock runs 1.5 % off. Tuned: a number; 0.01 to 0.05; shown by
`pytest tests/gcs_formation/link`."""
MAX_LOG_RATIO: Final = math.log(100.0)
"""Log-likelihood ratio above which the crystal hypothesis is rejected."""
REMEMBERED_LOG_RATIO: Final = 2.0 * MAX_LOG_RATIO
"""Bound of the ratio, both ways: hours of a steady clock don't outweigh a minute in which it no longer is."""
WIDE_S: Final = 2e-3
"""Standard deviation of both delays from which on their edges count. Tuned: s; 1e-3 to 5e-3; shown by `python -m
benchmarks.clock_limits`."""
BETTER: Final = 0.7
"""They count where their deviation is below this multiple of the mean's. Tuned: ratio; 0.5 to 0.9; shown by `python -m
benchmarks.clock_limits`."""
GATE: Final = 5.0
"""And where they differ from the mean by less than this multiple of its deviation. Tuned: standard deviations; 4 to 6;
shown by `python -m benchmarks.clock_limits`."""
MIN_VARIANCE: Final = 1e-12
"""Lower bound of round trips' variance, s², that is divided by."""
JITTERY_S: Final = 5e-3
"""Standard deviation of round trips, beyond that of the wait, from which on jitter keeps the clock from being known.
Tuned: s; 2e-3 to 10e-3; shown by `pytest tests/gcs_formation/link`."""
UNCERTAIN_S: Final = 0.25e-3
"""Deviation of the clock's offset that is good enough: 0.8 cm at 22 m/s between two vehicles. Tuned: s; 0.1e-3 to 1e-3;
shown by `pytest tests/gcs_formation/link`."""
STEP_S: Final = 1.0
"""A sample that is off by more than its uncertainty plus this shows that the clock has stepped or restarted. Tuned: s;
0.5 to 5; shown by `pytest tests/gcs_formation/link`."""


class ClockSync:
    """Maps a vehicle's time since boot to our instants.

    Two filters take the same samples: one assumes that a crystal drives the clock, the other doesn't. The first is used
    until the samples' likelihood rejects it (static multiple models: Bar-Shalom, Li, Kirubarajan, "Estimation with
    Applications to Tracking and Navigation", 11.6.2). Where delays have sharp bounds, the crystal's line is drawn
    by these (`delay_edges`).

    Clocks don't step when round trips do. So if both step together, the step of the samples is a change in how the
    delay is split between the two ways. The filters follow the samples at once; stamps are corrected by the split, so
    that they are mapped as before. The split decays with `ASYMMETRY_S`.
    """

    def __init__(self, loop_s: float = 0.0) -> None:
        """Start without samples; `loop_s`: period of the vehicle's loop that answers requests."""
        self.loop_s = loop_s
        """Half of it is the mean wait within a round trip."""
        self._variance = TripVariance(loop_s)
        self.round_trip_s = math.nan
        self.samples = 0
        self.one_way_s = math.nan
        """Half the mean of the recent round trips, less the answering loop's share."""
        self._crystal = ClockFilter(CRYSTAL_DRIFT, CRYSTAL_OFFSET_NOISE, CRYSTAL_DRIFT_NOISE)
        self._any_drift = ClockFilter(INITIAL_DRIFT)
        self._used = self._crystal
        self._log_ratio: float = 0.0
        """Log-likelihood ratio of the samples: no assumption about the drift over a crystal's drift."""
        self._asked = Instant(0)
        """When the newest answered request was sent: the vehicle's clock was running after that."""
        self._shown_ns = 0
        """The vehicle's time in the last answer."""
        self._recent = RoundTripWindow()
        """The recent round trips."""
        self.asymmetry_s: float = 0.0
        """Excess of the uplink delay over half the round trip, as estimated from steps."""
        self._edges = DelayEdges(loop_s)
        self._base_s: float = 0.0
        """The first sample, which is subtracted from the delays whose edges are found."""
        # _farthest_s, _farthest_at: the largest sample since the clock began, and when it was taken
        self._farthest_s, self._farthest_at = 0.0, Instant(0)
        self._by_edges = False
        """Whether the crystal's line is that of the delays' edges."""

    @property
    def offset_s(self) -> float:
        """The vehicle's clock minus ours at the last sample; NaN before the first."""
        return self._used.offset_s

    @property
    def drift(self) -> float:
        """Rate of change of the offset."""
        return self._used.drift

    @property
    def offset_deviation_s(self) -> float:
        """Standard deviation of the offset, for jitter that is alike both ways; NaN before the first sample."""
        return math.sqrt(self._used.offset_variance) if self.samples else math.nan

    @property
    def drift_deviation(self) -> float:
        """Standard deviation of the drift."""
        return self._used.drift_deviation

    @property
    def wants_more(self) -> bool:
        """Whether jitter leaves the clock more uncertain than `UNCERTAIN_S`."""
        jittery = self._variance.jitter_s2 > squared(JITTERY_S)
        return jittery and self._used.offset_variance > squared(UNCERTAIN_S)

    @property
    def jitter_s(self) -> float:
        """Standard deviation of the recent round trips."""
        return self._recent.jitter_s

    @property
    def usual_jitter_s(self) -> float:
        """Robust standard deviation of the recent round trips: a few outliers don't affect it."""
        return self._recent.usual_jitter_s

    def _take(self, round_trip_s: float, off_s: float) -> float:
        """Store a round trip and its sample's innovation; return the step of the samples, 0 without one."""
        step_s = self._recent.add(round_trip_s, off_s)
        if self._recent.stepped:
            self._forget_edges()
        return step_s

    def _follow_link(self, at: Instant, step_s: float, variance: float) -> None:
        """Shift both filters by a step of the link's delay, and count it in the split instead of the clock's offset."""
        self._crystal.step(at, self._crystal.predict(at) + step_s, variance)
        self._any_drift.step(at, self._any_drift.predict(at) + step_s, variance)
        self.asymmetry_s += step_s

    def _wait_s(self) -> float:
        """Return the last round trip's wait for the answering loop: the best linear estimate from the recent ones.

        All of their jitter up to that of the wait is the wait's, the rest is the link's.
        """
        wait_s = self.loop_s / 2.0
        if self._recent.count >= FEW:
            wait_s2 = self._variance.wait_s2
            share = wait_s2 / max(squared(self._recent.jitter_s), wait_s2, MIN_VARIANCE)
            wait_s += share * (self.round_trip_s - self._recent.mean_s)
        return within(wait_s, 0.0, self.loop_s)

    def last_one_way_s(self) -> float:
        """Return half of the last round trip, less the answering loop's mean share; can be negative."""
        return (self.round_trip_s - self.loop_s / 2) / 2

    def observe(self, sent: Instant, vehicle_time_ns: int, received: Instant) -> bool:
        """Take an answered request; return whether it shows that the vehicle's clock has restarted."""
        self.round_trip_s = (received - sent) / NANOSECONDS
        middle = Instant((sent + received) // 2)
        # The vehicle reads its clock after waiting for its loop: half of that wait later than the midpoint.
        sample_s = (vehicle_time_ns - middle) / NANOSECONDS - self._wait_s() / 2.0
        off_s = self._off_s(middle, sample_s) if self.samples else 0.0
        step_s = self._take(self.round_trip_s, off_s)
        self.one_way_s = max(0.0, (self._recent.mean_s - self.loop_s / 2) / 2)
        stepped = abs(off_s) > STEP_S + self.round_trip_s / 2
        # A clock that was paused (a suspended machine or simulator) is behind, hasn't gone back, and has run for longer
        # than since the last answer; one that then catches up isn't ahead of where it has been. Any other clock that
        # steps has restarted, or belongs to another vehicle.
        restarted = stepped and (
            (off_s > 0.0 and sample_s > self._latest_s(middle))
            or vehicle_time_ns < self._shown_ns
            or vehicle_time_ns <= (received - self._asked) * (1.0 + INITIAL_DRIFT)
        )
        excess_s = self.round_trip_s - self._recent.median_s
        variance = self._variance.sample_s2(excess_s, self._recent.count, self.jitter_s, self.usual_jitter_s)
        if self.samples == 0 or restarted:
            self._begin(middle, sample_s, variance)
        elif step_s:
            self._follow_link(middle, step_s, variance)
        elif stepped:
            self._crystal.step(middle, sample_s, variance)
            self._any_drift.step(middle, sample_s, variance)
            self._forget_edges()
        else:
            crystal, unknown = (
                self._crystal.correct(middle, sample_s, variance),
                self._any_drift.correct(middle, sample_s, variance),
            )
            self._judge(unknown - crystal)
            self._see_edges(sent, vehicle_time_ns, received)
        if sample_s > self._farthest_s:
            self._farthest_s, self._farthest_at = sample_s, middle
        # delays can't be negative: the split is at most half the round trip
        left_s = self.asymmetry_s * math.exp(-max(0.0, (sent - self._asked) / NANOSECONDS) / ASYMMETRY_S)
        self.asymmetry_s = max(-self.one_way_s, min(self.one_way_s, left_s))
        self._asked, self._shown_ns = max(self._asked, sent), vehicle_time_ns
        self.samples += 1
        return restarted

    def _latest_s(self, at: Instant) -> float:
        """Return by how much the vehicle's clock may be ahead of ours if it has gained no more than it had lost."""
        elapsed_s = max(0.0, (at - self._farthest_at) / NANOSECONDS)
        return self._farthest_s + self.round_trip_s / 2 + INITIAL_DRIFT * elapsed_s

    def _begin(self, at: Instant, sample_s: float, variance: float) -> None:
        """Begin with the first sample of a clock."""
        self._crystal.initialise(at, sample_s, variance)
        self._any_drift.initialise(at, sample_s, variance)
        self._log_ratio, self._used, self.asymmetry_s = 0.0, self._crystal, 0.0
        self._base_s = self._farthest_s = sample_s
        self._farthest_at = at
        self._forget_edges()

    def continue_from(self, other: ClockSync, now: Instant) -> None:
        """Map stamps as another link's clock does, which is the same: the difference is an unequal split of the delays.

        It decays as a split that was found by a step.
        """
        difference_s = self._used.predict(now) - other._used.predict(now)
        self.asymmetry_s = within(other.asymmetry_s + difference_s, -self.one_way_s, self.one_way_s)

    @property
    def asked(self) -> Instant:
        """When the newest answered request was sent."""
        return self._asked

    def to_instant(self, vehicle_time_s: float) -> Instant:
        """Return our instant for a vehicle's time since boot, s."""
        return self._used.to_instant(vehicle_time_s + self.asymmetry_s)

    def offset_at_s(self, at_s: float) -> float:
        """Return the vehicle's clock minus ours, s, at a time on our clock, s."""
        return self._used.predict(Instant(nanoseconds(at_s)))

    def age_s(self, vehicle_time_s: float, now: Instant) -> float:
        """Return the age at `now` of a vehicle's time since boot, s."""
        return self._used.age_s(vehicle_time_s + self.asymmetry_s, now)

    def _see_edges(self, sent: Instant, vehicle_time_ns: int, received: Instant) -> None:
        """Have the crystal's line follow the edges of the delays, where these are sharp and as the means say."""
        base_ns = nanoseconds(self._base_s)
        up_s = (vehicle_time_ns - sent - base_ns) / NANOSECONDS
        down_s = (received + base_ns - vehicle_time_ns) / NANOSECONDS
        edges, crystal = self._edges, self._crystal
        wide_s2 = max(squared(WIDE_S), self._variance.wait_s2)  # a wait of as much blurs the edges
        due = edges.add(sent / NANOSECONDS, up_s, down_s) and self._variance.jitter_s2 > wide_s2
        if not due or not edges.find(crystal.drift):
            return
        offset_s = self._base_s + edges.offset_s + edges.drift * (crystal.reference - sent) / NANOSECONDS
        mean_s2 = self._variance.mean_s2 if self._by_edges else crystal.offset_variance
        known = edges.deviation_s < BETTER * math.sqrt(mean_s2)
        self._by_edges = known and abs(offset_s - crystal.offset_s) < GATE * math.sqrt(mean_s2)
        if self._by_edges:
            crystal.begin_line(crystal.reference, offset_s, edges.drift, edges.deviation_s, edges.span_s)
            self._log_ratio, self._used = -REMEMBERED_LOG_RATIO, crystal

    def _forget_edges(self) -> None:
        self._edges.clear()
        self._by_edges = False

    def _judge(self, log_ratio: float) -> None:
        """Add a sample's log-likelihood ratio once its jitter is known, and choose the filter."""
        if self._recent.count >= FEW and not self._by_edges:
            self._log_ratio = within(self._log_ratio + log_ratio, -REMEMBERED_LOG_RATIO, REMEMBERED_LOG_RATIO)
            self._used = self._any_drift if self._log_ratio > MAX_LOG_RATIO else self._crystal

    def _off_s(self, at: Instant, sample_s: float) -> float:
        """Return the smaller of the sample's innovations in the two filters."""
        one_s, other_s = sample_s - self._crystal.predict(at), sample_s - self._any_drift.predict(at)
        return one_s if abs(one_s) < abs(other_s) else other_s

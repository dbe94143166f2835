# Compiled by mypyc: it runs every tick.

"""Simulations of a vehicle from its setpoints alone, by models (7) of several time constants at once."""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS
from flight_model.autopilot_model import AutopilotModel, climbed, finite, remaining, within, wrap
from flight_model.decay import Decay
from flight_model.slot import Vector3
from gcs_formation.estimation.setpoint_history import SentSetpoints

FREE: Final = 0.6
"""Share of a rate limit beyond which a batch isn't used: at its limit a vehicle doesn't show its time constant, and the
limit may be lower than declared (the faster an aircraft flies, the slower it turns). Tuned: share; 0.4 to 0.8; by
judgement."""
STEP_NS: Final = 100_000_000
"""Approximate time step; in each step the simulations follow the mean of the setpoints that act in it. Tuned: ns; 50 to
200 ms; shown by `pytest tests/gcs_formation/features/time_constants`."""
ALIKE_NS: Final = 1_000_000
"""Steps that differ by no more count as equal, which saves exponentials. The next step makes up for the difference.
Tuned: ns; 0.1 to 5 ms; by judgement."""
Seen = tuple[float, float, float, float]
"""Airspeed, heading, height and climb, m/s, rad, m."""


class ResidualBatch:
    """A vehicle's residuals in one channel: for each sample, the K simulations minus telemetry, then 1."""

    def __init__(self, simulations: int, samples: int) -> None:
        """Take K and the largest number of samples."""
        self.count: i64 = 0
        """Number of samples."""
        self.rows = vec[vec[float]]([vec[float]([0.0] * simulations + [1.0]) for _ in range(samples)])
        """(B, K + 1)."""

    def next(self) -> vec[float]:
        """Add a sample and return its row, to be filled."""
        self.count += 1
        return self.rows[self.count - 1]

    def clear(self) -> None:
        """Remove all samples."""
        self.count = 0

    def excited(self, resolution: float) -> bool:
        """Return whether the first and the last simulation differ by more than `resolution`."""
        for sample in range(self.count):
            row = self.rows[sample]
            if abs(row[0] - row[len(row) - 2]) > resolution:
                return True
        return False


class FirstOrder:
    """Simulations of airspeed or heading by K time constants."""

    def __init__(self, taus_s: list[float], declared_s: float, rate_max: float, *, turns: bool) -> None:
        """Take the time constants, the declared one, and the rate limit; `turns`: the value is an angle."""
        self._taus_s, self._values = vec[float](taus_s), vec[float]([0.0] * len(taus_s))
        self._made_good = vec[float]([0.0] * len(taus_s))
        """Share of an error that a step removes."""
        self._rate_max, self._turns, self._step_s = rate_max, turns, 0.0
        self._free = FREE * rate_max * declared_s
        self._off = 0.0
        """Largest error in the batch, as a mean over the simulations."""

    def initialise(self, value: float) -> None:
        """Restart from a value."""
        for node in range(len(self._values)):
            self._values[node] = value

    def begin_batch(self) -> None:
        """Reset the largest error."""
        self._off = 0.0

    def free(self) -> bool:
        """Return whether the simulations kept clear of the rate limit in the batch."""
        return self._off < self._free

    def step_by(self, time_s: float) -> None:
        """Set the time step."""
        self._step_s = time_s
        for node in range(len(self._taus_s)):
            self._made_good[node] = 1.0 - math.exp(-time_s / self._taus_s[node])

    def step(self, setpoint: float) -> None:
        """Follow a setpoint for a step."""
        values, taus_s, made_good, off = self._values, self._taus_s, self._made_good, 0.0
        turns, rate_max = self._turns, self._rate_max
        for node in range(len(values)):
            error = setpoint - values[node]
            if turns:
                error = wrap(error)
            size, share = abs(error), made_good[node]
            off += size
            change = share * error
            if size > rate_max * taus_s[node]:
                change = error - remaining(error, self._step_s, taus_s[node], rate_max, 1.0 - share)
            values[node] = values[node] + change
        self._off = max(self._off, off / float(len(values)))

    def compare(self, seen: float, row: vec[float]) -> None:
        """Put the simulations minus what was seen into a row."""
        values, turns = self._values, self._turns
        for node in range(len(values)):
            row[node] = wrap(values[node] - seen) if turns else values[node] - seen


class SecondOrder:
    """Simulations of height by K pairs of time constants."""

    def __init__(self, pairs_s: list[tuple[float, float]], declared: AutopilotModel) -> None:
        """Take the pairs of time constants, and the declared model."""
        self._slow_s = vec[float]([max(pair) for pair in pairs_s])
        self._fast_s = vec[float]([min(pair) for pair in pairs_s])
        self._heights_m, self._climbs_mps = vec[float]([0.0] * len(pairs_s)), vec[float]([0.0] * len(pairs_s))
        self._left = [Decay() for _ in pairs_s]
        """Decay over a step; `_climb_s` repeats its `climb_s`."""
        self._climb_s = vec[float]([0.0] * len(pairs_s))
        self._height_of_error, self._climb_of_error, self._climb_of_climb = (
            vec[float]([0.0] * len(pairs_s)) for _ in range(3)
        )
        """Height and climb after a step from an error of 1 m, and climb after a step from a climb of 1 m/s."""
        self._max_mps, self._step_s = declared.climb_max_mps, 0.0
        self._free_m = FREE * declared.climb_max_mps * (declared.tau_ha_s + declared.tau_hb_s)
        self._off_m = 0.0

    def initialise(self, height_m: float, climb_mps: float) -> None:
        """Restart from a height and a climb."""
        for node in range(len(self._heights_m)):
            self._heights_m[node], self._climbs_mps[node] = height_m, climb_mps

    def begin_batch(self) -> None:
        """Reset the largest error."""
        self._off_m = 0.0

    def free(self) -> bool:
        """Return whether the simulations kept clear of the rate limit in the batch."""
        return self._off_m < self._free_m

    def step_by(self, time_s: float) -> None:
        """Set the time step."""
        self._step_s = time_s
        for node in range(len(self._slow_s)):
            slow_s, fast_s, left = self._slow_s[node], self._fast_s[node], self._left[node]
            left.compute(time_s, math.inf, math.inf, slow_s, fast_s)
            climb_s = self._climb_s[node] = left.climb_s
            self._height_of_error[node] = left.slow + climb_s / slow_s
            self._climb_of_error[node] = -climb_s / (slow_s * fast_s)
            self._climb_of_climb[node] = left.fast - climb_s / slow_s

    def step(self, height_m: float) -> None:
        """Follow a setpoint for a step."""
        heights_m, climbs_mps, max_mps, off_m = self._heights_m, self._climbs_mps, self._max_mps, 0.0
        climb_s, climb_of_error, climb_of_climb = self._climb_s, self._climb_of_error, self._climb_of_climb
        max_m, height_of_error = max_mps * self._step_s, self._height_of_error
        for node in range(len(heights_m)):
            now_m, now_mps = heights_m[node], climbs_mps[node]
            error_m = now_m - height_m
            off_m += abs(error_m)
            change_m = height_of_error[node] * error_m + climb_s[node] * now_mps - error_m
            later_mps = climb_of_error[node] * error_m + climb_of_climb[node] * now_mps
            if abs(change_m) <= max_m and abs(later_mps) <= max_mps:
                heights_m[node], climbs_mps[node] = now_m + change_m, later_mps
            else:
                self._climb_at_limit(node, height_m)
        self._off_m = max(self._off_m, off_m / float(len(heights_m)))

    def _climb_at_limit(self, node: i64, height_m: float) -> None:
        now_m, now_mps, left = self._heights_m[node], self._climbs_mps[node], self._left[node]
        self._heights_m[node], self._climbs_mps[node] = climbed(
            now_m, now_mps, self._max_mps, height_m, self._step_s, left
        )

    def compare(self, seen_m: float, row: vec[float]) -> None:
        """Put the simulations minus what was seen into a row."""
        heights_m = self._heights_m
        for node in range(len(heights_m)):
            row[node] = heights_m[node] - seen_m


class Samples:
    """A vehicle's telemetry at the ticks of a batch; the first sample is the last of the batch before."""

    def __init__(self, maximum: int) -> None:
        """Make room for `maximum` samples."""
        self.count: i64 = 0
        self.stamps = vec[i64]([0] * maximum)
        """In order, ns."""
        self.speeds_mps, self.headings_rad, self.heights_m = (vec[float]([0.0] * maximum) for _ in range(3))

    def add(self, stamp: i64, motion: Seen) -> None:
        """Add a sample if it is newer than the last."""
        if self.count > 0 and stamp <= self.stamps[self.count - 1]:
            return
        self.stamps[self.count] = stamp
        self.speeds_mps[self.count], self.headings_rad[self.count], self.heights_m[self.count], _ = motion
        self.count += 1

    def near(self, sample: i64, instant: i64) -> Vector3:
        """Return airspeed, heading and height at an instant near a sample's, linearly through it and the one before."""
        last = sample - 1
        back = float(self.stamps[sample] - instant) / float(self.stamps[sample] - self.stamps[last])
        return (
            self.speeds_mps[sample] + back * (self.speeds_mps[last] - self.speeds_mps[sample]),
            self.headings_rad[sample] + back * wrap(self.headings_rad[last] - self.headings_rad[sample]),
            self.heights_m[sample] + back * (self.heights_m[last] - self.heights_m[sample]),
        )

    @property
    def span_s(self) -> float:
        """Time from the first to the last sample."""
        return float(self.stamps[self.count - 1] - self.stamps[0]) / NANOSECONDS


class ModelSet:
    """A vehicle's simulations from its setpoints alone."""

    def __init__(self, declared: AutopilotModel, air: list[list[float]], height: list[list[float]]) -> None:
        """Simulate the declared ones times exp(`air`), for airspeed and heading, and times exp(`height`), (K, 2)."""
        self.flying = False
        """Whether the simulations have begun."""
        speed_s, heading_s = declared.tau_v_s, declared.tau_psi_s
        speeds_s = [speed_s * math.exp(each[0]) for each in air]
        headings_s = [heading_s * math.exp(each[0]) for each in air]
        pairs_s = [(declared.tau_ha_s * math.exp(one), declared.tau_hb_s * math.exp(other)) for one, other in height]
        self._speeds = FirstOrder(speeds_s, speed_s, declared.accel_max_mps2, turns=False)
        self._headings = FirstOrder(headings_s, heading_s, declared.turn_rate_max_rps, turns=True)
        self._heights = SecondOrder(pairs_s, declared)
        self._slowest_mps, self._fastest_mps = declared.speed_min_mps, declared.speed_max_mps
        self._at: i64 = 0
        """The instant of the simulations, ns."""
        self._step: i64 = 0

    def initialise(self, estimated: list[bool], stamp: i64, seen: Seen) -> None:
        """Restart from what was `seen` those simulations of airspeed, heading and height that aren't `estimated`."""
        self.flying = not math.isnan(seen[0])
        speed_mps, heading_rad, height_m, climb_mps = seen if self.flying else (0.0, 0.0, 0.0, 0.0)
        if not any(estimated):
            self._at = stamp
        if not estimated[0]:
            self._speeds.initialise(speed_mps)
        if not estimated[1]:
            self._headings.initialise(heading_rad)
        if not estimated[2]:
            self._heights.initialise(height_m, climb_mps)

    def fly(self, samples: Samples, sent: SentSetpoints, batch: list[ResidualBatch]) -> list[bool]:
        """Fill the empty batches of airspeed, heading and height with the simulations minus telemetry.

        Return which of them are to be used: those that kept clear of the rate limits; none if the vehicle wasn't `sent`
        setpoints all the time.
        """
        self._speeds.begin_batch()
        self._headings.begin_batch()
        self._heights.begin_batch()
        index = sent.acting(self._at)
        for sample in range(1, samples.count):
            stamp = samples.stamps[sample]
            steps = max((stamp - self._at + STEP_NS // 2) // STEP_NS, 1)
            while steps > 0 and stamp - self._at > ALIKE_NS:
                self._step_by((stamp - self._at) // steps)
                index = sent.later(index, self._at)
                speed_mps, heading_rad, height_m = sent.mean(index, self._at, self._at + self._step)
                if not finite(speed_mps + heading_rad + height_m):
                    return [False, False, False]
                self._speeds.step(within(speed_mps, self._slowest_mps, self._fastest_mps))
                self._headings.step(heading_rad)
                self._heights.step(height_m)
                self._at += self._step
                steps -= 1
            speed_mps, heading_rad, height_m = samples.near(sample, self._at)
            self._speeds.compare(speed_mps, batch[0].next())
            self._headings.compare(heading_rad, batch[1].next())
            self._heights.compare(height_m, batch[2].next())
        return [self._speeds.free(), self._headings.free(), self._heights.free()]

    def _step_by(self, step: i64) -> None:
        """Set the time step, ns, unless it's about the same."""
        if -ALIKE_NS <= step - self._step <= ALIKE_NS:
            return
        self._step, step_s = step, float(step) / NANOSECONDS
        self._speeds.step_by(step_s)
        self._headings.step_by(step_s)
        self._heights.step_by(step_s)

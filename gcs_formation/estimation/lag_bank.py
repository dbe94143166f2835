"""A vehicle simulated by models (7) of several lags at once, and what the simulations are off from its telemetry."""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS
from flight_model.autopilot import AutopilotModel, climbed, remaining, within, wrap
from flight_model.decay import of_climb
from flight_model.slot import Triple
from gcs_formation.estimation.setpoint_history import Flown

FREE: Final = 0.6
"""Share of a rate limit beyond which nothing is learnt of a lag: what flies at its limit doesn't show it, and the limit
may be lower than believed (an aircraft turns the slower, the faster it flies)."""
Motion = tuple[float, float, float, float]
"""Airspeed, heading, height and climb, m/s, rad, m."""


class Tracks:
    """A vehicle's batch of samples of a channel: K simulations minus telemetry, and 1; all 0: there is no sample."""

    __slots__ = ("rows",)

    def __init__(self, simulations: int, samples: int) -> None:
        """Take K and B, without a sample."""
        self.rows = zeros(simulations + 1, samples)
        """(K + 1, B)."""

    def clear(self) -> None:
        """Take the samples away."""
        for row in self.rows:
            for sample in range(len(row)):
                row[sample] = 0.0

    def excited(self, resolution: float) -> bool:
        """Return whether the simulations differ by more than a resolution: the first from the last."""
        first, last, most = self.rows[0], self.rows[len(self.rows) - 2], 0.0
        for sample in range(len(first)):
            most = max(most, abs(first[sample] - last[sample]))
        return most > resolution


class Bank:
    """A vehicle's simulations from its setpoints alone: K of its height, fewer of its airspeed and heading."""

    def __init__(self, believed: AutopilotModel, air: list[list[float]], height: list[list[float]]) -> None:
        """Simulate lags that are the believed ones times e to the power of `height` (K, 2), and of `air`, fewer."""
        self.flying = False
        """Whether the simulations have begun."""
        self._believed = AutopilotModel(*believed.values())
        self._speeds_mps, self._headings_rad = vec[float]([0.0] * len(air)), vec[float]([0.0] * len(air))
        self._speed_lags_s = vec[float]([believed.tau_v_s * math.exp(each[0]) for each in air])
        self._heading_lags_s = vec[float]([believed.tau_psi_s * math.exp(each[0]) for each in air])
        self._heights_m, self._climbs_mps = vec[float]([0.0] * len(height)), vec[float]([0.0] * len(height))
        pairs = [(believed.tau_ha_s * math.exp(one), believed.tau_hb_s * math.exp(other)) for one, other in height]
        lags_s = sorted({lag_s for pair in pairs for lag_s in pair})
        self._lags_s, self._left = vec[float](lags_s), vec[float]([1.0] * len(lags_s))
        """The heights' lags, several simulations share each, and what each leaves of 1 after the time that is flown."""
        self._slow = vec[i64]([lags_s.index(max(pair)) for pair in pairs])
        self._fast = vec[i64]([lags_s.index(min(pair)) for pair in pairs])
        """(K) places of the slower and the faster lag."""
        self._off_mps = self._off_rad = self._off_m = 0.0
        """The largest errors that were simulated last: the mean of all simulations of airspeed, heading, height."""

    def begin(self, learnt: list[bool], seen: Motion) -> None:
        """Begin those simulations, of airspeed, heading and height, anew that aren't `learnt` from what was `seen`."""
        self.flying = not math.isnan(seen[0])
        speed_mps, heading_rad, height_m, climb_mps = seen if self.flying else (0.0, 0.0, 0.0, 0.0)
        if not learnt[0]:
            _fill(self._speeds_mps, speed_mps)
        if not learnt[1]:
            _fill(self._headings_rad, heading_rad)
        if not learnt[2]:
            _fill(self._heights_m, height_m)
            _fill(self._climbs_mps, climb_mps)

    def free(self) -> list[bool]:
        """Return whether airspeed, heading and height kept clear of the rate limits in what was simulated last."""
        model = self._believed
        return [
            self._off_mps < FREE * model.accel_max_mps2 * model.tau_v_s,
            self._off_rad < FREE * model.turn_rate_max_rps * model.tau_psi_s,
            self._off_m < FREE * model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s),
        ]

    def fly(self, stamps: list[int], seen: list[Motion], flown: Flown, batch: list[Tracks]) -> None:
        """Put the simulations minus telemetry at the stamps after the first into a batch; none that isn't newer.

        Args:
            stamps: (B + 1), ns, in order; the simulations are at the first.
            seen: (B + 1) what was measured.
            flown: by what it flew, all finite.
            batch: of airspeed, heading and height, without samples.
        """
        self._off_mps = self._off_rad = self._off_m = 0.0
        acts, setpoints, at, acting = flown.acts, flown.setpoints, stamps[0], 0
        last = len(acts) - 1
        for sample in range(1, len(stamps)):
            stamp = stamps[sample]
            if stamp <= at:
                continue
            while at < stamp:
                while acting < last and acts[acting + 1] <= at:
                    acting += 1
                end = stamp
                if acting != last and acts[acting + 1] < stamp:
                    end = acts[acting + 1]
                self._follow(setpoints[acting], (end - at) / NANOSECONDS)
                at = end
            self._compare(seen[sample], batch, sample - 1)

    def _compare(self, seen: Motion, batch: list[Tracks], sample: i64) -> None:
        """Put what the simulations are off from what is `seen` into a batch."""
        _put(self._speeds_mps, seen[0], batch[0].rows, sample)
        _put(self._heights_m, seen[2], batch[2].rows, sample)
        headings_rad, rows, heading_rad = self._headings_rad, batch[1].rows, seen[1]
        for node in range(len(headings_rad)):
            rows[node][sample] = wrap(headings_rad[node] - heading_rad)
        rows[len(rows) - 1][sample] = 1.0

    def _follow(self, setpoints: Triple, time_s: float) -> None:
        """Move all simulations on by a time in which a setpoint acts, and note how far they are off."""
        speed_mps, heading_rad, height_m = setpoints
        speed_mps = within(speed_mps, self._believed.speed_min_mps, self._believed.speed_max_mps)
        self._off_mps = max(self._off_mps, self._speed_up(speed_mps, time_s))
        self._off_rad = max(self._off_rad, self._turn(heading_rad, time_s))
        self._off_m = max(self._off_m, self._climb(height_m, time_s))

    def _speed_up(self, speed_mps: float, time_s: float) -> float:
        """Move the airspeeds on; return the mean of how far they were off."""
        speeds_mps, lags_s = self._speeds_mps, self._speed_lags_s
        off_mps, most_mps2 = 0.0, self._believed.accel_max_mps2
        for node in range(len(speeds_mps)):
            faster_mps = speed_mps - speeds_mps[node]
            off_mps += abs(faster_mps)
            lag_s = lags_s[node]
            left_mps = remaining(faster_mps, time_s, lag_s, most_mps2, math.exp(-time_s / lag_s))
            speeds_mps[node] = speeds_mps[node] + faster_mps - left_mps
        return off_mps / float(len(speeds_mps))

    def _turn(self, heading_rad: float, time_s: float) -> float:
        """Move the headings on likewise."""
        headings_rad, lags_s = self._headings_rad, self._heading_lags_s
        off_rad, most_rps = 0.0, self._believed.turn_rate_max_rps
        for node in range(len(headings_rad)):
            turn_rad = wrap(heading_rad - headings_rad[node])
            off_rad += abs(turn_rad)
            lag_s = lags_s[node]
            left_rad = remaining(turn_rad, time_s, lag_s, most_rps, math.exp(-time_s / lag_s))
            headings_rad[node] = headings_rad[node] + turn_rad - left_rad
        return off_rad / float(len(headings_rad))

    def _climb(self, height_m: float, time_s: float) -> float:
        """Move heights and climb rates on likewise."""
        heights_m, climbs_mps, most_mps, off_m = self._heights_m, self._climbs_mps, self._believed.climb_max_mps, 0.0
        lags_s, left, slowest, fastest = self._lags_s, self._left, self._slow, self._fast
        for place in range(len(lags_s)):
            left[place] = math.exp(-time_s / lags_s[place])
        for node in range(len(heights_m)):
            now_m, now_mps, slow, fast = heights_m[node], climbs_mps[node], slowest[node], fastest[node]
            slow_s, fast_s, slow_left, fast_left = lags_s[slow], lags_s[fast], left[slow], left[fast]
            climb_s = of_climb(time_s, slow_s, fast_s, slow_left, fast_left)
            off_m += abs(height_m - now_m)
            heights_m[node], climbs_mps[node] = climbed(
                now_m, now_mps, most_mps, height_m, time_s, slow_s, fast_s, slow_left, fast_left, climb_s
            )
        return off_m / float(len(heights_m))


def zeros(rows: int, columns: int) -> vec[vec[float]]:
    """Return a matrix of zeros."""
    return vec[vec[float]]([vec[float]([0.0] * columns) for _ in range(rows)])


def _fill(values: vec[float], value: float) -> None:
    for place in range(len(values)):
        values[place] = value


def _put(simulated: vec[float], seen: float, rows: vec[vec[float]], sample: i64) -> None:
    """Put a sample into a batch's rows: simulations minus what was seen, and 1."""
    for node in range(len(simulated)):
        rows[node][sample] = simulated[node] - seen
    rows[len(simulated)][sample] = 1.0

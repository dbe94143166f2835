"""The lags of equation (7) as each vehicle flies them, learnt from its telemetry and what it was sent.

Output-error identification (Ljung, "System Identification", 2nd ed., 4.2 and 10.2): each vehicle is simulated from its
setpoints alone by several models at once, whose lags span `RATIO_MAX`. Between them the simulated motion is
interpolated by a polynomial in the logarithm of the lag's ratio to the believed one. The ratio found is the one that
comes nearest to the telemetry by least squares, held by a normal prior about the believed lag. No measurement enters
the simulation, so white noise in the telemetry doesn't bias it; a constant difference (a sensor's bias) isn't fitted.
"""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS
from flight_model.autopilot import AutopilotModel, climbed, finite, remaining, within, wrap
from flight_model.decay import of_climb
from flight_model.slot import Triple
from gcs_formation.estimation.lag_fit import BATCH_S, Channel, Nodes, Tracks
from gcs_formation.estimation.setpoint_history import Flown, SetpointHistory

RESOLUTION: Final = (0.02, 0.002, 0.05)
"""Residuals of airspeed (m/s), heading (rad) and height (m) count as no smaller: telemetry's digits, and the instant at
which a setpoint acts, aren't known better."""
GAP_S: Final = 3.0
"""A longer gap in the telemetry starts the simulation anew."""
FREE: Final = 0.6
"""Share of a rate limit beyond which nothing is learnt of a lag: what flies at its limit doesn't show it, and the limit
may be lower than believed (an aircraft turns the slower, the faster it flies)."""
Motion = tuple[float, float, float, float]
"""Airspeed, heading, height and climb, m/s, rad, m."""


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
        """Move the headings on; return the mean of how far they were off."""
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
        """Move heights and climb rates on; return the mean of how far the heights were off."""
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


class VehicleLags:
    """A vehicle's batch of samples, and its simulations."""

    def __init__(self, model: AutopilotModel, air: Nodes, height: Nodes, samples: int) -> None:
        """Start with the lags that `model` has; so many `samples` are a batch."""
        self.lagging = True
        """Whether it flies by (7); of others, whose model only comes near them, no lags are learnt."""
        self.model = model
        self.stamps: list[int] = []
        """Of the samples, ns; the first ended the batch before."""
        self._lags_s = model.tau_v_s, model.tau_psi_s, model.tau_ha_s, model.tau_hb_s
        self._bank = Bank(model, air.at, height.at)
        self.batch = [Tracks(len(nodes.at), samples) for nodes in (air, air, height)]
        """Of airspeed, heading and height."""
        self._motion: Motion = (math.nan, math.nan, math.nan, math.nan)
        self._stamp = 0
        self._seen: list[Motion] = []
        self._learning = True
        self._learnt = [False, False, False]

    def hear(self, stamp: int, motion: Motion) -> None:
        """Take its motion as measured at `stamp`."""
        self._stamp, self._motion = max(stamp, self._stamp), motion

    def note(self, *, learning: bool) -> None:
        """Add the newest sample; `learning`: it flies as it was commanded."""
        self._learning = self._learning and learning and not math.isnan(self._motion[0])
        self.stamps.append(self._stamp)
        self._seen.append(self._motion)

    def learns(self, setpoints: list[Triple]) -> bool:
        """Return whether a batch with these `setpoints` shows its lags."""
        if not (self._learning and self.lagging and self._bank.flying):
            return False
        if (self.stamps[-1] - self.stamps[0]) / NANOSECONDS > GAP_S + BATCH_S:
            return False
        return all(finite(speed_mps + heading_rad + height_m) for speed_mps, heading_rad, height_m in setpoints)

    def fly(self, flown: Flown) -> None:
        """Put the simulations minus telemetry into the batch."""
        self._bank.fly(self.stamps, self._seen, flown, self.batch)
        self._learnt = self._bank.free()
        for channel, free in enumerate(self._learnt):
            if not free:
                self.batch[channel].clear()

    def begin(self) -> None:
        """Begin a batch with the newest sample; the simulations that didn't teach begin anew from it."""
        self._bank.begin(self._learnt, self._seen[-1])
        self.stamps, self._seen = self.stamps[-1:], self._seen[-1:]
        self._learning, self._learnt = True, [False, False, False]
        for tracks in self.batch:
            tracks.clear()

    def use(self, log_ratios: list[float]) -> None:
        """Give its model lags by their ratios to the believed ones: of airspeed and heading, and both of height."""
        speed, heading, slow, fast = log_ratios
        model, (speed_s, heading_s, slow_s, fast_s) = self.model, self._lags_s
        model.tau_v_s, model.tau_psi_s = speed_s * math.exp(speed), heading_s * math.exp(heading)
        model.tau_ha_s, model.tau_hb_s = slow_s * math.exp(slow), fast_s * math.exp(fast)


class LagEstimator:
    """Keeps the lags of the models of all vehicles, (C,), as they fly; they are changed in place.

    Everyone who predicts or steers by those models reads them anew each tick.
    """

    def __init__(
        self,
        models: list[AutopilotModel],
        history: SetpointHistory,
        telemetry_hz: float,
        law_hz: float,
        *,
        in_use: bool,
    ) -> None:
        """Start with the lags that `models` have; `history` holds what was commanded.

        Not `in_use`, the models stay as they are, and only their misfit is watched.
        """
        air, height, self._ticks = Nodes(5, 1), Nodes(4, 2), max(2, round(BATCH_S * law_hz))
        self.vehicles = [VehicleLags(model, air, height, self._ticks) for model in models]
        each = zip((air, air, height), RESOLUTION, strict=True)
        self.channels = [Channel(nodes, len(models), finest, telemetry_hz, in_use=in_use) for nodes, finest in each]
        """Airspeed, heading, height."""
        self._in_use = in_use
        self._history = history
        self._noted = 0

    @property
    def misfit(self) -> list[list[float]]:
        """(3, C) by what share the lags of airspeed, heading and height seem to differ from those in use."""
        return [channel.misfit for channel in self.channels]

    def log_ratios(self, column: int) -> list[float]:
        """Return logarithms of a vehicle's lags by the believed ones: of airspeed, of heading, and both of height."""
        return [each for channel in self.channels for each in channel.log_ratio[column]]

    def hear(self, column: int, stamp: int, motion: Motion) -> None:
        """Take a vehicle's airspeed, heading, height and climb as measured at `stamp`, m/s, rad, m."""
        self.vehicles[column].hear(stamp, motion)

    def learn(self, learning: list[bool]) -> None:
        """Take the newest samples at a tick; `learning` (C,): vehicles that fly as they were commanded.

        Once in `BATCH_S` the models' lags are fitted.
        """
        for column, flies in enumerate(learning):
            self.vehicles[column].note(learning=flies)
        self._noted += 1
        if self._noted <= self._ticks:
            return
        begins = [each.stamps[0] for each in self.vehicles]
        self._fit(self._history.between(begins, [each.stamps[-1] for each in self.vehicles]))
        for each in self.vehicles:
            each.begin()
        self._noted = 1

    def _fit(self, flown: list[Flown]) -> None:
        """Fit the lags to a batch, in which each vehicle was `flown` so."""
        learns = [each.learns(flown[column].setpoints) for column, each in enumerate(self.vehicles)]
        if not any(learns):
            return
        for column, each in enumerate(self.vehicles):
            if learns[column]:
                each.fly(flown[column])
        for place, channel in enumerate(self.channels):
            channel.learn([each.batch[place] for each in self.vehicles])
        if self._in_use:
            for column, each in enumerate(self.vehicles):
                each.use(self.log_ratios(column))


def _fill(values: vec[float], value: float) -> None:
    for place in range(len(values)):
        values[place] = value


def _put(simulated: vec[float], seen: float, rows: vec[vec[float]], sample: i64) -> None:
    """Put a sample into a batch's rows: simulations minus what was seen, and 1."""
    for node in range(len(simulated)):
        rows[node][sample] = simulated[node] - seen
    rows[len(simulated)][sample] = 1.0

"""The lags that fit a vehicle's telemetry, from simulations of it by models (7) of several lags: `lags` says when."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from librt.vecs import vec

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array
from flight_model.autopilot import AutopilotModel, FlightState, climb_by, respond_in_air, squared, within, wrap
from flight_model.slot import Triple

FREE: Final = 0.6
"""Share of a rate limit beyond which nothing is learnt of a lag: what flies at its limit doesn't show it, and the limit
may be lower than believed (an aircraft turns the slower, the faster it flies)."""
Motion = tuple[float, float, float, float]
"""Airspeed, heading, height and climb, m/s, rad, m."""
RATIO_MAX: Final = 2.0
"""A lag is found between the believed one divided and multiplied by this."""
BOUND: Final = math.log(RATIO_MAX)
BELIEVED_SPREAD: Final = 0.35
"""Standard deviation of the logarithm of a lag's ratio before anything is learnt: 40 %."""
BELIEF: Final = 1.0 / BELIEVED_SPREAD**2
CORRELATED_S: Final = 1.0
"""Residuals this far apart count as independent."""
BATCH_S: Final = 1.0
"""How often lags are fitted."""
STEP_MAX: Final = 0.1
"""Largest change of a ratio's logarithm at a fit."""
LEAST_SPREAD: Final = 0.02
"""What was seen first is forgotten once the ratio is known better than this: lags may change. Without excitation
nothing is learnt, and nothing forgotten."""
RECENT_S: Final = 20.0
"""Memory of the misfit."""
SIGNIFICANT: Final = 2.0
"""Standard deviations of the misfit that don't count."""


class Tracks:
    """A channel's batch of samples, (C, K + 1, B): K simulations minus telemetry, and 1; all 0: there is no sample."""

    __slots__ = ("rows", "samples", "values")

    def __init__(self, columns: int, simulations: int, samples: int) -> None:
        """Take C, K and B, without a sample."""
        self.rows = simulations + 1
        self.samples = samples
        self.values = vec[float]([0.0] * (columns * self.rows * samples))

    def begin(self, column: int) -> int:
        """Return the place of a vehicle's first value."""
        return column * self.rows * self.samples

    def clear(self, column: int) -> None:
        """Take a vehicle's samples away."""
        for place in range(self.begin(column), self.begin(column + 1)):
            self.values[place] = 0.0

    def excited(self, column: int, resolution: float) -> bool:
        """Return whether a vehicle's simulations differ by more than a resolution: the first from the last."""
        values, first, last = self.values, self.begin(column), self.begin(column + 1) - 2 * self.samples
        most = 0.0
        for sample in range(self.samples):
            most = max(most, abs(values[first + sample] - values[last + sample]))
        return most > resolution

    def table(self) -> Array:
        """Return them as an array."""
        return _table(self.values, -1, self.rows, self.samples)


class Bank:
    """A vehicle's simulations from its setpoints alone: K of its height, the first of them of the rest, too."""

    def __init__(self, believed: AutopilotModel, air: list[list[float]], height: list[list[float]]) -> None:
        """Simulate lags that are the believed ones times e to the power of `height` (K, 2), and of `air`, fewer."""
        self.flying = False
        """Whether the simulations have begun."""
        self._believed = AutopilotModel(*believed.values())
        self._states = [FlightState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) for _ in height]
        self._air = [AutopilotModel(*believed.values()) for _ in air]
        for place, model in enumerate(self._air):
            model.tau_v_s *= math.exp(air[place][0])
            model.tau_psi_s *= math.exp(air[place][0])
        pairs = [(believed.tau_ha_s * math.exp(one), believed.tau_hb_s * math.exp(other)) for one, other in height]
        lags_s = sorted({lag_s for pair in pairs for lag_s in pair})
        self._lags_s, self._left = vec[float](lags_s), vec[float]([1.0] * len(lags_s))
        """The heights' lags, several simulations share each, and what each leaves of 1 after the time that is flown."""
        self._slow, self._fast = (
            [lags_s.index(max(pair)) for pair in pairs],
            [lags_s.index(min(pair)) for pair in pairs],
        )
        """(K) places of the slower and the faster lag."""
        self._off_mps = self._off_rad = self._off_m = 0.0
        """The largest errors that were simulated last: the mean of all simulations of airspeed, heading, height."""

    def begin(self, learnt: list[bool], seen: Motion) -> None:
        """Begin those simulations, of airspeed, heading and height, anew that aren't `learnt` from what was `seen`."""
        self.flying = not math.isnan(seen[0])
        speed_mps, heading_rad, height_m, climb_mps = seen if self.flying else (0.0, 0.0, 0.0, 0.0)
        for state in self._states:
            if not learnt[0]:
                state.airspeed_mps = speed_mps
            if not learnt[1]:
                state.heading_rad = heading_rad
            if not learnt[2]:
                state.height_m, state.climb_mps = height_m, climb_mps

    def free(self) -> list[bool]:
        """Return whether airspeed, heading and height kept clear of the rate limits in what was simulated last."""
        model = self._believed
        return [
            self._off_mps < FREE * model.accel_max_mps2 * model.tau_v_s,
            self._off_rad < FREE * model.turn_rate_max_rps * model.tau_psi_s,
            self._off_m < FREE * model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s),
        ]

    def fly(
        self,
        stamps: list[int],
        seen: list[Motion],
        acts: list[int],
        setpoints: list[Triple],
        batch: list[Tracks],
        column: int,
    ) -> None:
        """Put the simulations minus telemetry at the stamps after the first into a batch; none that isn't newer.

        Args:
            stamps: (B + 1), ns, in order; the simulations are at the first.
            seen: (B + 1) what was measured.
            acts: (R) when setpoints act, ns, in order.
            setpoints: (R) these, all finite.
            batch: of airspeed, heading and height, without this vehicle's samples.
            column: the vehicle's.
        """
        self._off_mps = self._off_rad = self._off_m = 0.0
        at, acting, last = stamps[0], 0, len(acts) - 1
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
            self._compare(seen[sample], batch, column, sample - 1)

    def _compare(self, seen: Motion, batch: list[Tracks], column: int, sample: int) -> None:
        """Put what the simulations are off from what is `seen` into a batch."""
        of_speed, of_heading, of_height = batch[0], batch[1], batch[2]
        speeds, headings, heights = of_speed.values, of_heading.values, of_height.values
        samples, states, speed_mps, heading_rad, height_m = of_height.samples, self._states, seen[0], seen[1], seen[2]
        place = of_speed.begin(column) + sample
        for node in range(len(self._air)):
            state = states[node]
            speeds[place] = state.airspeed_mps - speed_mps
            headings[place] = wrap(state.heading_rad - heading_rad)
            place += samples
        speeds[place] = headings[place] = 1.0
        place = of_height.begin(column) + sample
        for state in states:
            heights[place] = state.height_m - height_m
            place += samples
        heights[place] = 1.0

    def _follow(self, setpoints: Triple, time_s: float) -> None:
        """Move all simulations on by a time in which a setpoint acts, and note how far they are off."""
        speed_mps, heading_rad, height_m = setpoints
        speed_mps = within(speed_mps, self._believed.speed_min_mps, self._believed.speed_max_mps)
        off_mps = off_rad = off_m = 0.0
        states, most_mps, lags_s, left = self._states, self._believed.climb_max_mps, self._lags_s, self._left
        for node, model in enumerate(self._air):
            state = states[node]
            off_mps += abs(speed_mps - state.airspeed_mps)
            off_rad += abs(wrap(heading_rad - state.heading_rad))
            respond_in_air(state, model, speed_mps, heading_rad, time_s)
        for place in range(len(lags_s)):
            left[place] = math.exp(-time_s / lags_s[place])
        for node, state in enumerate(states):
            off_m += abs(height_m - state.height_m)
            slow, fast = self._slow[node], self._fast[node]
            climb_by(state, most_mps, height_m, time_s, lags_s[slow], lags_s[fast], left[slow], left[fast])
        of_air, of_height = float(len(self._air)), float(len(states))
        self._off_mps = max(self._off_mps, off_mps / of_air)
        self._off_rad = max(self._off_rad, off_rad / of_air)
        self._off_m = max(self._off_m, off_m / of_height)


class Nodes:
    """Interpolation between simulations: n Chebyshev points of [-BOUND, BOUND] for each of P parameters, 1 or 2."""

    def __init__(self, count: int, parameters: int) -> None:
        """Take n and P."""
        points = [BOUND * math.cos((2 * place + 1) * math.pi / (2 * count)) for place in range(count)]
        self.parameters = parameters
        self.at = [[one] for one in points] if parameters == 1 else [[one, two] for one in points for two in points]
        """(K, P) logarithms of the simulations' ratios; K is n to the power of P."""
        self._count, self._alone = count, vec[float]([1.0])
        terms: list[float] = np.linalg.inv(np.vander(points)).T.ravel().tolist()
        self._terms = vec[float](terms)
        """(n, n) coefficients, the highest power's first, of the polynomials that are 1 at one point, 0 at the rest."""

    def weigh(self, log_ratio: list[float], to: vec[float], place: int) -> None:
        """Put (P + 2, K + 1) in a row of zeros from a place on.

        These are weights of the simulations, and of 1, at `log_ratio` (P), their derivatives, and 1.
        """
        size, second = len(self.at) + 1, self._alone
        first, by_first = self._of_one(log_ratio[0])
        if self.parameters > 1:
            second, by_second = self._of_one(log_ratio[1])
            _put_products(to, place + 2 * size, first, by_second)
        _put_products(to, place, first, second)
        _put_products(to, place + size, by_first, second)
        to[place + (self.parameters + 2) * size - 1] = 1.0

    def _of_one(self, log_ratio: float) -> tuple[vec[float], vec[float]]:
        """Return the weights (n) for one parameter, and their derivatives."""
        weights, slopes, term = vec[float]([0.0] * self._count), vec[float]([0.0] * self._count), 0
        for point in range(self._count):
            weight = slope = 0.0
            for _ in range(self._count):
                slope = slope * log_ratio + weight
                weight = weight * log_ratio + self._terms[term]
                term += 1
            weights[point] = weight
            slopes[point] = slope
        return weights, slopes


def _put_products(to: vec[float], place: int, rows: vec[float], columns: vec[float]) -> None:
    """Put all products of two lists' numbers in a row, those of the first of `rows` first."""
    for row in rows:
        for column in columns:
            to[place] = row * column
            place += 1


class Channel:
    """Airspeed, heading or height of all vehicles: what was seen, and the P lags that fit it."""

    def __init__(self, nodes: Nodes, columns: int, resolution: float, rate_hz: float, *, in_use: bool) -> None:
        """Start with the believed lags.

        `rate_hz` is that of the telemetry; `in_use`: whether the lags found are, not the believed ones.
        """
        self.nodes = nodes
        self.log_ratio = [[0.0] * nodes.parameters for _ in range(columns)]
        """(C, P) of the lags to the believed ones."""
        self.spread = [[BELIEVED_SPREAD] * nodes.parameters for _ in range(columns)]
        """(C, P) standard deviations of these."""
        self.misfit = [0.0] * columns
        """(C) share by which lags seem to differ from those in use, beyond chance, in what was flown last."""
        self._resolution, self._in_use = resolution, in_use
        self._least_variance = resolution**2
        self._alike = max(1.0, CORRELATED_S * rate_hz)
        self._kept = [1.0] * columns
        """Share of what was seen that counts from now on."""
        self._size = len(nodes.at) + 1
        self._sums: Array = np.zeros((2, columns, self._size, self._size))
        """(2, C, K + 1, K + 1) sums of products over all samples that count, and over recent ones: of K simulations
        minus telemetry, and of 1."""

    def learn(self, tracks: Tracks) -> None:
        """Take a batch and fit the lags anew."""
        batch, columns = tracks.table(), len(self.log_ratio)
        kept = vec[float]([math.exp(-BATCH_S / RECENT_S)] * (2 * columns))
        counted = vec[float]([1.0] * (2 * columns))
        for column in range(columns):
            kept[column] = self._kept[column]
            counted[column] = 1.0 if tracks.excited(column, self._resolution) else 0.0
        self._sums *= _table(kept, 2, -1, 1, 1)
        self._sums += batch @ batch.transpose(0, 2, 1) * _table(counted, 2, -1, 1, 1)
        weights = self._weights()
        forms: list[list[list[list[float]]]] = (weights @ self._sums @ weights.transpose(0, 1, 3, 2)).tolist()
        for column in range(columns):
            self._fit(column, forms[0][column])
            self._judge(column, forms[1][column])

    def _weights(self) -> Array:
        """Return (1 or 2, C, P + 2, K + 1): weights at the lags found, and at those in use where they aren't these."""
        rows, columns = self.nodes.parameters + 2, len(self.log_ratio)
        each = rows * self._size
        weights = vec[float]([0.0] * ((1 if self._in_use else 2) * columns * each))
        for column, log_ratio in enumerate(self.log_ratio):
            self.nodes.weigh(log_ratio, weights, column * each)
            if not self._in_use:
                self.nodes.weigh([0.0] * self.nodes.parameters, weights, (columns + column) * each)
        return _table(weights, -1, columns, rows, self._size)

    def _fit(self, column: int, seen: list[list[float]]) -> None:
        """Make a Gauss-Newton step towards the most likely lags, and forget what is more than enough.

        `seen`: the sums of products (P + 2, P + 2) of the simulation with these lags, of its derivatives, and of 1.
        """
        log_ratio, end = self.log_ratio[column], len(seen) - 1
        variance = scatter(seen, 0, 0) / max(seen[-1][-1], 1.0) + self._least_variance
        worth = 1.0 / (variance * self._alike)
        information = [[scatter(seen, one, other) * worth for other in range(1, end)] for one in range(1, end)]
        covariance = _inverse_with(information, BELIEF)
        pull = [-scatter(seen, slope, 0) * worth - log_ratio[slope - 1] * BELIEF for slope in range(1, end)]
        most = 1.0
        for place, row in enumerate(covariance):
            wanted = 0.0
            for other, each in enumerate(row):
                wanted += each * pull[other]
            log_ratio[place] = within(log_ratio[place] + within(wanted, -STEP_MAX, STEP_MAX), -BOUND, BOUND)
            self.spread[column][place] = math.sqrt(row[place])
            most = max(most, information[place][place])
        self._kept[column] = min(1.0, 1.0 / (LEAST_SPREAD**2 * most))

    def _judge(self, column: int, seen: list[list[float]]) -> None:
        """Find by what common share the lags in use, those of `seen` as above, differ from those of the last flight."""
        by_all, shown, end = 0.0, 0.0, len(seen) - 1
        for one in range(1, end):
            shown += scatter(seen, one, 0)
            for other in range(1, end):
                by_all += scatter(seen, one, other)
        excitation = max(by_all, 1e-12)
        left = max(scatter(seen, 0, 0) - squared(shown) / excitation, 0.0) / max(seen[-1][-1], 1.0)
        chance = math.sqrt((left + self._least_variance) * self._alike / excitation)
        self.misfit[column] = max(0.0, abs(shown) / excitation - SIGNIFICANT * chance)


def _table(values: vec[float], *shape: int) -> Array:
    """Return numbers as an array, which shares their memory."""
    return np.frombuffer(memoryview(values)).reshape(shape)


def scatter(seen: list[list[float]], one: int, other: int) -> float:
    """Return the sum of two quantities' products about their means; `seen`: their sums of products, the last with 1."""
    return seen[one][other] - seen[one][-1] * seen[other][-1] / max(seen[-1][-1], 1.0)


def _inverse_with(matrix: list[list[float]], diagonal: float) -> list[list[float]]:
    """Return the inverse of a symmetric matrix, 1 by 1 or 2 by 2, with `diagonal` added to its diagonal."""
    first = matrix[0][0] + diagonal
    if len(matrix) == 1:
        return [[1.0 / first]]
    second, cross = matrix[1][1] + diagonal, matrix[0][1]
    determinant = first * second - cross * cross
    return [[second / determinant, -cross / determinant], [-cross / determinant, first / determinant]]

"""The lags that fit a vehicle's telemetry, from simulations of it by models (7) of several lags: `lags` says when."""

from __future__ import annotations

import math
import struct
from typing import Final

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array
from flight_model.autopilot import AutopilotModel, FlightState, climb, respond, within, wrap
from flight_model.slot import Triple

FREE: Final = 0.6
"""Share of a rate limit beyond which nothing is learnt of a lag: what flies at its limit doesn't show it, and the limit
may be lower than believed (an aircraft turns the slower, the faster it flies)."""
Motion = tuple[float, float, float, float]
"""Airspeed, heading, height and climb, m/s, rad, m."""
Tracks = list[list[list[float]]]
"""Of airspeed, heading and height, (K + 1, B): K simulations minus telemetry, and 1; all 0 where there is no sample."""
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


class Bank:
    """A vehicle's simulations from its setpoints alone: K of its height, the first of them of the rest, too."""

    def __init__(self, believed: AutopilotModel, air: list[list[float]], height: list[list[float]]) -> None:
        """Simulate lags that are the believed ones times e to the power of `height` (K, 2), and of `air`, fewer."""
        self.flying = False
        """Whether the simulations have begun."""
        self._believed = AutopilotModel(*believed.values())
        self._of_air = len(air)
        self._states = [FlightState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) for _ in height]
        self._models = [AutopilotModel(*believed.values()) for _ in height]
        for node, model in enumerate(self._models):
            model.tau_ha_s *= math.exp(height[node][0])
            model.tau_hb_s *= math.exp(height[node][1])
            if node < self._of_air:
                model.tau_v_s *= math.exp(air[node][0])
                model.tau_psi_s *= math.exp(air[node][0])
        self._off = [0.0, 0.0, 0.0]
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
        model, off = self._believed, self._off
        return [
            off[0] < FREE * model.accel_max_mps2 * model.tau_v_s,
            off[1] < FREE * model.turn_rate_max_rps * model.tau_psi_s,
            off[2] < FREE * model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s),
        ]

    def fly(self, stamps: list[int], seen: list[Motion], acts: list[int], setpoints: list[Triple]) -> Tracks:
        """Return the simulations minus telemetry at the stamps after the first; one not newer than the last is none.

        Args:
            stamps: (B + 1), ns, in order; the simulations are at the first.
            seen: (B + 1) what was measured.
            acts: (R) when setpoints act, ns, in order.
            setpoints: (R) these.
        """
        tracks, of_air = self.unseen(len(stamps) - 1), self._of_air
        self._off = [0.0, 0.0, 0.0]
        at, acting, last = stamps[0], 0, len(acts) - 1
        for sample, stamp in enumerate(stamps[1:]):
            if stamp <= at:
                continue
            while at < stamp:
                while acting < last and acts[acting + 1] <= at:
                    acting += 1
                end = stamp if acting == last else min(stamp, acts[acting + 1])
                self._follow(setpoints[acting], (end - at) / NANOSECONDS)
                at = end
            speed_mps, heading_rad, height_m, _ = seen[sample + 1]
            for node, state in enumerate(self._states):
                tracks[2][node][sample] = state.height_m - height_m
                if node < of_air:
                    tracks[0][node][sample] = state.airspeed_mps - speed_mps
                    tracks[1][node][sample] = wrap(state.heading_rad - heading_rad)
            for track in tracks:
                track[-1][sample] = 1.0
        return tracks

    def unseen(self, samples: int) -> Tracks:
        """Return tracks without a sample."""
        sizes = self._of_air + 1, self._of_air + 1, len(self._states) + 1
        return [[[0.0] * samples for _ in range(size)] for size in sizes]

    def _follow(self, setpoints: Triple, time_s: float) -> None:
        """Move all simulations on by a time in which a setpoint acts, and note how far they are off."""
        speed_mps, heading_rad, height_m = setpoints
        speed_mps = within(speed_mps, self._believed.speed_min_mps, self._believed.speed_max_mps)
        off_mps = off_rad = off_m = 0.0
        of_air = self._of_air
        for node, state in enumerate(self._states):
            off_m += abs(height_m - state.height_m)
            if node < of_air:
                off_mps += abs(speed_mps - state.airspeed_mps)
                off_rad += abs(wrap(heading_rad - state.heading_rad))
                respond(state, self._models[node], speed_mps, heading_rad, height_m, time_s)
            else:
                climb(state, self._models[node], height_m, time_s)
        off = self._off
        self._off = [
            max(off[0], off_mps / of_air),
            max(off[1], off_rad / of_air),
            max(off[2], off_m / len(self._states)),
        ]


class Nodes:
    """Interpolation between simulations: n Chebyshev points of [-BOUND, BOUND] for each of P parameters, 1 or 2."""

    def __init__(self, count: int, parameters: int) -> None:
        """Take n and P."""
        points = [BOUND * math.cos((2 * place + 1) * math.pi / (2 * count)) for place in range(count)]
        self.parameters = parameters
        self.at = [[one] for one in points] if parameters == 1 else [[one, two] for one in points for two in points]
        """(K, P) logarithms of the simulations' ratios; K is n to the power of P."""
        self._terms: list[list[float]] = np.linalg.inv(np.vander(points)).T.tolist()
        """(n, n) coefficients, the highest power's first, of the polynomials that are 1 at one point, 0 at the rest."""

    def weights(self, log_ratio: list[float]) -> list[list[float]]:
        """Return (P + 2, K + 1): weights of the simulations, and of 1, at `log_ratio` (P), their derivatives, and 1."""
        alone = [0.0] * len(self.at) + [1.0]
        first, by_first = self._of_one(log_ratio[0])
        if self.parameters == 1:
            return [[*first, 0.0], [*by_first, 0.0], alone]
        second, by_second = self._of_one(log_ratio[1])
        return [_products(first, second), _products(by_first, second), _products(first, by_second), alone]

    def _of_one(self, log_ratio: float) -> tuple[list[float], list[float]]:
        """Return the weights (n) for one parameter, and their derivatives."""
        weights: list[float] = []
        slopes: list[float] = []
        for terms in self._terms:
            weight = slope = 0.0
            for term in terms:
                slope = slope * log_ratio + weight
                weight = weight * log_ratio + term
            weights.append(weight)
            slopes.append(slope)
        return weights, slopes


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
        size = len(nodes.at) + 1
        self._all: Array = np.zeros((columns, size, size))
        self._recent: Array = np.zeros((columns, size, size))
        """(C, K + 1, K + 1) sums of products over samples, of K simulations minus telemetry, and of 1."""

    def learn(self, tracks: list[list[list[float]]]) -> None:
        """Take a batch and fit the lags anew: (C, K + 1, B), simulations minus telemetry, and 1; all 0: no sample."""
        batch = _table(tracks)
        products = batch @ batch.transpose(0, 2, 1)
        self._recent *= math.exp(-BATCH_S / RECENT_S)
        self._recent += products
        self._all *= np.array(self._kept)[:, None, None]
        self._all += products * np.array([self._excites(each) for each in tracks])[:, None, None]
        weights = _table([self.nodes.weights(each) for each in self.log_ratio])
        in_use = weights
        if not self._in_use:
            in_use = _table([self.nodes.weights([0.0] * len(each)) for each in self.log_ratio])
        each = zip(_forms(self._all, weights), _forms(self._recent, in_use), strict=True)
        for column, (seen, seen_lately) in enumerate(each):
            self._fit(column, seen)
            self._judge(column, seen_lately)

    def _excites(self, track: list[list[float]]) -> float:
        """Return 1 if the simulations of a vehicle differ by more than the resolution, else 0."""
        last = track[-2]
        for sample, each in enumerate(track[0]):
            if abs(each - last[sample]) > self._resolution:
                return 1.0
        return 0.0

    def _fit(self, column: int, seen: list[list[float]]) -> None:
        """Make a Gauss-Newton step towards the most likely lags, and forget what is more than enough.

        `seen`: the sums of products (P + 2, P + 2) of the simulation with these lags, of its derivatives, and of 1.
        """
        log_ratio, slopes = self.log_ratio[column], range(1, len(seen) - 1)
        variance = scatter(seen, 0, 0) / max(seen[-1][-1], 1.0) + self._least_variance
        worth = 1.0 / (variance * self._alike)
        information = [[scatter(seen, one, other) * worth for other in slopes] for one in slopes]
        covariance = _inverse_with(information, BELIEF)
        pull = [-scatter(seen, slope, 0) * worth - log_ratio[slope - 1] * BELIEF for slope in slopes]
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
        excitation, shown, slopes = 1e-12, 0.0, range(1, len(seen) - 1)
        by_all = 0.0
        for one in slopes:
            shown += scatter(seen, one, 0)
            for other in slopes:
                by_all += scatter(seen, one, other)
        excitation = max(by_all, 1e-12)
        left = max(scatter(seen, 0, 0) - shown**2 / excitation, 0.0) / max(seen[-1][-1], 1.0)
        chance = math.sqrt((left + self._least_variance) * self._alike / excitation)
        self.misfit[column] = max(0.0, abs(shown) / excitation - SIGNIFICANT * chance)


def _table(lists: list[list[list[float]]]) -> Array:
    """Return equally long lists of lists as an array; by way of its bytes, a quarter of what numpy takes for them."""
    flat: list[float] = []
    for rows in lists:
        for row in rows:
            flat.extend(row)
    shape = len(lists), len(lists[0]), len(lists[0][0])
    return np.frombuffer(struct.pack(f"{len(flat)}d", *flat)).reshape(shape)


def _forms(products: Array, weights: Array) -> list[list[list[float]]]:
    """Return the sums of products (C, Q, Q) of combinations by `weights` (C, Q, K + 1), from those of each."""
    forms: list[list[list[float]]] = (weights @ products @ weights.transpose(0, 2, 1)).tolist()
    return forms


def scatter(seen: list[list[float]], one: int, other: int) -> float:
    """Return the sum of two quantities' products about their means; `seen`: their sums of products, the last with 1."""
    return seen[one][other] - seen[one][-1] * seen[other][-1] / max(seen[-1][-1], 1.0)


def _products(rows: list[float], columns: list[float]) -> list[float]:
    """Return all products of two lists' numbers, those of the first number of `rows` first, and 0."""
    return [*[row * column for row in rows for column in columns], 0.0]


def _inverse_with(matrix: list[list[float]], diagonal: float) -> list[list[float]]:
    """Return the inverse of a symmetric matrix, 1 by 1 or 2 by 2, with `diagonal` added to its diagonal."""
    first = matrix[0][0] + diagonal
    if len(matrix) == 1:
        return [[1.0 / first]]
    second, cross = matrix[1][1] + diagonal, matrix[0][1]
    determinant = first * second - cross * cross
    return [[second / determinant, -cross / determinant], [-cross / determinant, first / determinant]]

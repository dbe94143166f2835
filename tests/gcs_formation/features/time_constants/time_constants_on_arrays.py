"""Estimates the lags of many vehicles on arrays, all vehicles and all simulations at once: a test oracle of `lags`."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array, Mask, within, wrap
from flight_model.autopilot_model import AutopilotModel
from flight_model.vehicle_arrays import AutopilotModels, Height, HeightSteps, air_errors
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.time_constants.estimator import FINEST, GAP_S, RESOLUTION
from gcs_formation.features.time_constants.fit import (
    CORRELATED_S,
    MIN_SPREAD,
    PRIOR_SPREAD,
    RECENT_S,
    SETTLED,
    SIGNIFICANT,
    STEP_MAX,
)
from gcs_formation.features.time_constants.interpolation import BOUND, RATIO_MAX
from gcs_formation.features.time_constants.model_set import FREE, STEP_NS, Seen
from gcs_formation.features.time_constants.persistence import ALIKE_S, BATCH_S, PRIOR_BATCHES, PRIOR_WORTH
from tests.gcs_formation.tables import Instants


class ModelSet:
    """K simulations of each vehicle from its setpoints alone: airspeed and heading by one lag, height by two."""

    def __init__(self, assumed: AutopilotModels, air: Array, height: Array) -> None:
        """Simulate lags that are the assumed ones times e to the power of `air` (K,) and `height` (K', 2)."""
        self._columns = columns = assumed.tau_v_s.size
        self.flying: Mask = np.zeros(columns, dtype=bool)
        """(C,) whether a vehicle's simulations have begun."""
        none = np.zeros_like
        self._believed = assumed
        self._air_model = _spanned(assumed, np.array((air, air, none(air), none(air))))
        self._height_model = _spanned(assumed, np.array((*none(height.T), *height.T)))
        self._air: Array = np.zeros((2, columns * len(air)))
        self._height = Height(np.zeros(columns * len(height)), np.zeros(columns * len(height)))

    def begin(self, which: Mask, seen: Array) -> None:
        """Begin some simulations, (3, C) of airspeed, heading and height, from measurements.

        `seen`, (4, C), is airspeed, heading, height and climb.
        """
        self.flying = np.isfinite(seen[0])
        air_k, height_k = self._air.shape[1] // self._columns, self._height.height_m.size // self._columns
        seen = np.where(self.flying, seen, 0.0)
        of_air, of_height = np.repeat(seen[:2], air_k, axis=1), np.repeat(seen[2:], height_k, axis=1)
        self._air = np.where(np.repeat(which[:2], air_k, axis=1), of_air, self._air)
        self._height = Height(*np.where(np.repeat(which[2], height_k), of_height, self._height))

    def fly(self, stamps: Instants, acts: Instants, commands: Array) -> tuple[tuple[Array, Array, Array], Mask]:
        """Return airspeed, heading and height at all stamps but the first, (B, C, K) each.

        Also which of them, (3, C), stayed within the rate limits.

        Args:
            stamps: (B + 1, C), ascending, the same for all vehicles; the simulations are at the first.
            acts: (R, C) ascending, when the setpoints act, the same for all vehicles.
            told: (R, 3, C) setpoints.
        """
        assert (stamps == stamps[:, :1]).all()
        assert (acts == acts[:, :1]).all()
        samples = stamps[:, 0]
        parts = np.maximum(np.rint(np.diff(samples) / STEP_NS).astype(int), np.diff(samples) > 0)
        each = zip(samples, samples[1:], parts, strict=False)
        pieces = [np.linspace(since, until, count + 1)[1:] for since, until, count in each]
        borders = np.concatenate((samples[:1], *pieces))
        begin, end = borders[:-1, None], borders[1:, None]
        until = np.append(acts[1:, 0], np.iinfo(np.int64).max)
        since = np.append(np.iinfo(np.int64).min, acts[1:, 0])
        overlap = np.maximum(np.minimum(end, until) - np.maximum(begin, since), 0) / (end - begin)
        segments = np.einsum("sr,rqc->sqc", overlap, commands)
        duration_s = np.repeat((end - begin) / NANOSECONDS, stamps.shape[1], axis=1)
        at = np.searchsorted(borders, samples[1:])
        air, air_free = self._through_air(segments[:, :2], duration_s)
        height, height_free = self._through_heights(segments[:, 2], duration_s)
        return (air[at, 0], air[at, 1], height[at]), np.concatenate((air_free, height_free[None]))

    def _through_air(self, commands: Array, duration_s: Array) -> tuple[Array, Mask]:
        """Return airspeeds and headings at segments' ends, (S + 1, 2, C, K), and which stayed within limits, (2, C)."""
        model, count = self._air_model, self._air.shape[1] // self._columns
        commands = np.repeat(commands, count, axis=2)
        commands[:, 0] = within(commands[:, 0], model.speed_min_mps, model.speed_max_mps)
        each_s = np.repeat(duration_s, count, axis=1)[:, None]
        values, errors = [self._air], list[Array]()
        for segment, segment_s in zip(commands, each_s, strict=True):
            errors.append(air_errors(values[-1], segment))
            values.append(values[-1] + errors[-1] - model.remaining(errors[-1], segment_s))
        self._air = values[-1]
        error = np.abs(errors).reshape(-1, 2, self._columns, count).mean(axis=3).max(axis=0)
        free: Mask = error < FREE * self._believed.air_rates_max * self._believed.air_taus_s
        return np.array(values).reshape(-1, 2, self._columns, count), free

    def _through_heights(self, commanded_m: Array, duration_s: Array) -> tuple[Array, Mask]:
        """Return heights at the ends of S segments, (S + 1, C, K), and which stayed within limits, (C,)."""
        count = self._height.height_m.size // self._columns
        commanded_m = np.repeat(commanded_m, count, axis=1)
        steps = HeightSteps.of(self._height_model, np.repeat(duration_s, count, axis=1))
        height, heights = self._height, [self._height.height_m]
        for step, target_m in enumerate(commanded_m):
            height = steps.after(step, height, target_m)
            heights.append(height.height_m)
        self._height, table = height, np.array(heights)
        error_m = np.abs(commanded_m - table[:-1]).reshape(-1, self._columns, count).mean(axis=2).max(axis=0)
        free: Mask = error_m < FREE * self._believed.climb_max_mps * (self._believed.tau_ha_s + self._believed.tau_hb_s)
        return table.reshape(-1, self._columns, count), free


def _spanned(assumed: AutopilotModels, logs: Array) -> AutopilotModels:
    """Return (C K,) models whose lags are the assumed ones (C,) times e to the power of each of `logs` (4, K)."""
    table = np.repeat(assumed.table, logs.shape[1], axis=1)
    table[:4] *= np.tile(np.exp(logs), assumed.tau_v_s.size)
    return AutopilotModels.of(table)


class Nodes(NamedTuple):
    """Interpolation between simulations: logarithms of their ratios, (K, P), and the polynomials' coefficients."""

    at: Array
    inverse: Array
    """(n, n) of one parameter's Vandermonde matrix, n to the power of P being K."""

    @classmethod
    def of(cls, count: int, parameters: int) -> Nodes:
        """Return `count` Chebyshev points of [-BOUND, BOUND] for each of 1 or 2 parameters."""
        points = BOUND * np.cos((2 * np.arange(count) + 1) * np.pi / (2 * count))
        at = np.stack(np.meshgrid(*[points] * parameters, indexing="ij"), axis=-1).reshape(-1, parameters)
        return cls(at, np.linalg.inv(np.vander(points, increasing=True)).astype(np.float64))

    def weights(self, log_ratio: Array) -> tuple[Array, Array]:
        """Return the weights (C, K) of the simulations at `log_ratio` (C, P), and their derivatives (C, P, K)."""
        powers = np.arange(len(self.inverse))
        each = log_ratio[..., None] ** powers @ self.inverse
        slopes = powers * log_ratio[..., None] ** np.maximum(powers - 1, 0) @ self.inverse
        if log_ratio.shape[1] == 1:
            return each[:, 0], slopes
        (first, second), (first_slope, second_slope) = each.swapaxes(0, 1), slopes.swapaxes(0, 1)
        pairs = (first, second), (first_slope, second), (first, second_slope)
        weights, by_first, by_second = (np.einsum("ci,cj->cij", a, b).reshape(len(a), -1) for a, b in pairs)
        return weights, np.stack((by_first, by_second), axis=1)


@dataclass
class Sums:
    """Sums over samples of the differences between K simulations and the telemetry."""

    count: Array
    """(C,)."""
    first: Array
    """(C, K)."""
    second: Array
    """(C, K, K)."""

    @classmethod
    def none(cls, columns: int, nodes: int) -> Sums:
        """Return the sums over no samples."""
        return cls(np.zeros(columns), np.zeros((columns, nodes)), np.zeros((columns, nodes, nodes)))

    def add(self, differences: Array, counted: Mask) -> None:
        """Add samples (B, C, K) where `counted` (B, C)."""
        kept = np.where(counted[..., None], differences, 0.0)
        self.count += counted.sum(axis=0)
        self.first += kept.sum(axis=0)
        by_column = kept.swapaxes(0, 1)
        self.second += by_column.swapaxes(1, 2) @ by_column

    def keep(self, share: Array | float) -> None:
        """Keep only a share of the sums, a number or (C,)."""
        share = np.broadcast_to(share, self.count.shape)
        self.count *= share
        self.first *= share[:, None]
        self.second *= share[:, None, None]

    def spread(self) -> Array:
        """Return the sums of products about the mean, (C, K, K)."""
        mean = self.first / np.maximum(self.count, 1.0)[:, None]
        return self.second - mean[:, :, None] * self.first[:, None, :]


class Fit(NamedTuple):
    """What samples say about the logarithms of ratios near some values, without the prior."""

    pull: Array
    """(C, P) gradient of the log-likelihood."""
    information: Array
    """(C, P, P)."""

    @classmethod
    def of(cls, spread: Array, weights: Array, slopes: Array, worth: Array) -> Fit:
        """Return the fit at the simulations' `weights` (C, K), whose derivatives are `slopes` (C, P, K).

        `worth`: inverse variance of each sample, (C,).
        """
        mismatch = (spread @ weights[..., None])[..., 0]
        pull = -(slopes @ mismatch[..., None])[..., 0] * worth[:, None]
        return cls(pull, slopes @ spread @ slopes.swapaxes(1, 2) * worth[:, None, None])


class Means:
    """Means of successive batches of residuals of C vehicles, each weighted anew."""

    def __init__(self, columns: int, resolution: float) -> None:
        """Begin without any."""
        self._means: list[list[float]] = [[] for _ in range(columns)]
        self._resolution = resolution
        self.variance: Array = np.full(columns, resolution**2)
        """(C,) of the means, the resolution's counting as one batch."""

    def take(self, means: Array, counted: Mask) -> Array:
        """Add a batch's means, NaN where none is `counted`; return the weight of a batch of independent residuals."""
        for column, each in enumerate(self._means):
            each.append(float(means[column]) if counted[:, column].any() else math.nan)
        batches, self.variance = np.array([self._batches(each) for each in self._means]).T
        return batches

    def _batches(self, means: list[float]) -> tuple[float, float]:
        """Return (1 + rho) / (1 - rho) of pairs of neighbours, and their variance, by definition, not running sums."""
        share = math.exp(-BATCH_S / ALIKE_S)
        pairs = [(a, b) for a, b in itertools.pairwise(means) if not math.isnan(a + b)]
        kept = np.array([share ** (len(pairs) - 1 - place) for place in range(len(pairs))])
        later, step = np.array([b for _, b in pairs]), np.array([b - a for a, b in pairs])
        resolution = self._resolution**2 * share ** len(pairs)
        mean = float(kept @ later / kept.sum()) if pairs else 0.0
        size = resolution + float(kept @ (later - mean) ** 2)
        steps = 2.0 * resolution + float(kept @ step**2)
        seen = max(1.0, 4.0 * size / steps - 1.0)
        batches = np.average((PRIOR_BATCHES, seen), weights=(PRIOR_WORTH, kept.sum()))
        return float(batches), size / (1.0 + float(kept.sum()))


class Channel:
    """Airspeed, heading or height of all vehicles: what was measured, and the P lags that fit it."""

    def __init__(
        self, nodes: Nodes, columns: int, resolution: float, finest: float, rate_hz: float, *, in_use: bool
    ) -> None:
        """Start with the assumed lags.

        `rate_hz`: the telemetry's rate. `finest`: the least deviation that residuals are taken to have. `in_use`:
        whether the estimated lags are used instead of the assumed ones.
        """
        self.nodes = nodes
        self.log_ratio: Array = np.zeros((columns, nodes.at.shape[1]))
        """(C, P) logarithms of the ratios of the lags to the assumed ones."""
        self.mismatch: Array = np.zeros(columns)
        """(C,) share by which the lags of the latest flight seem to differ from those in use, beyond chance."""
        self._resolution, self._finest, self._in_use = resolution, finest, in_use
        self._independent = max(1.0, CORRELATED_S * rate_hz)
        self._means = Means(columns, resolution)
        self._all, self._recent, self._calm = (Sums.none(columns, size) for size in (len(nodes.at), len(nodes.at), 1))
        self._settled: Mask = np.ones(columns, dtype=bool)
        self._kept: Array = np.ones(columns)

    def learn(self, differences: Array, counted: Mask) -> None:
        """Take a batch of simulations minus telemetry, (B, C, K), where `counted` (B, C), and fit the lags again."""
        difference = np.where(counted, np.abs(differences[..., 0] - differences[..., -1]), 0.0)
        excited = difference.max(axis=0, initial=0.0) > np.sqrt(self._noise())
        shows = excited & counted.any(axis=0)
        fits = shows | ~self._settled
        self._all.keep(np.where(shows, self._kept, 1.0))
        self._all.add(differences, counted & excited)
        weights, slopes = self.nodes.weights(self.log_ratio)
        spread, count = self._all.spread(), np.maximum(self._all.count, 1.0)
        nearer = self._nearest(spread, weights, slopes)
        used = self.log_ratio if self._in_use else np.zeros_like(self.log_ratio)
        nearest = weights + np.einsum("cp,cpk->ck", nearer, slopes)
        taken = np.where(fits[:, None], nearest, self.nodes.weights(used)[0])
        left = np.where(counted, np.einsum("ck,bck->bc", taken, differences), 0.0)
        alike = self._means.take(left.sum(axis=0) / np.maximum(counted.sum(axis=0), 1), counted)
        for sums in (self._recent, self._calm):
            sums.keep(math.exp(-BATCH_S / RECENT_S))
        self._recent.add(differences, counted & shows)
        self._calm.add(left[..., None], counted & ~shows)
        variance = alike * np.einsum("ck,ckl,cl->c", nearest, spread, nearest) / count + self._noise()
        self._fit(Fit.of(spread, weights, slopes, 1.0 / (variance * self._independent)), fits)
        self._judge(alike)

    def _noise(self) -> Array:
        """Return (C,) variances of residuals that aren't the lags'."""
        return within(self._means.variance, self._finest**2, self._resolution**2)

    def _nearest(self, spread: Array, weights: Array, slopes: Array) -> Array:
        """Return (C, P), the change of the ratios towards the best fit; the prior holds ratios that hardly matter."""
        fit = Fit.of(spread, weights, slopes, 1.0 / (self._noise() * self._independent))
        held = fit.information + np.eye(slopes.shape[1]) / PRIOR_SPREAD**2
        return np.linalg.solve(held, fit.pull[..., None])[..., 0].astype(np.float64)

    def _fit(self, fit: Fit, fits: Mask) -> None:
        """Make a Gauss-Newton step towards the most likely lags of the vehicles (C,) in `fits`."""
        assumed = np.eye(self.log_ratio.shape[1]) / PRIOR_SPREAD**2
        covariance = np.linalg.inv(fit.information + assumed)
        wanted = (covariance @ (fit.pull - self.log_ratio / PRIOR_SPREAD**2)[..., None])[..., 0]
        stepped = within(self.log_ratio + within(wanted, -STEP_MAX, STEP_MAX), -BOUND, BOUND)
        most = np.maximum(np.diagonal(fit.information, axis1=1, axis2=2).max(axis=1), 1.0)
        self._kept = np.where(fits, np.minimum(1.0, 1.0 / (MIN_SPREAD**2 * most)), self._kept)
        self._settled = np.where(fits, np.abs(stepped - self.log_ratio).max(axis=1) < SETTLED, self._settled)
        self.log_ratio = np.where(fits[:, None], stepped, self.log_ratio)

    def _judge(self, alike: Array) -> None:
        """Find the common share by which the lags in use differ from those of the latest flight.

        `alike`: the number of batches whose residuals tell as much as those of one independent batch, (C,).
        """
        recent, calm, alike = self._recent, self._calm, np.minimum(alike, PRIOR_BATCHES)
        weights, slopes = self.nodes.weights(self.log_ratio if self._in_use else np.zeros_like(self.log_ratio))
        slope, count = slopes.sum(axis=1), np.maximum(recent.count + calm.count, 1.0)
        total = (weights * recent.first).sum(axis=1) + calm.first[:, 0]
        by_slope = (recent.second @ slope[..., None])[..., 0]
        slope_mean = (slope * recent.first).sum(axis=1) / count
        excitation = np.maximum((slope * by_slope).sum(axis=1) - slope_mean**2 * count, 1e-12)
        shown = (weights * by_slope).sum(axis=1) - slope_mean * total
        mismatch = np.einsum("ck,ckl,cl->c", weights, recent.second, weights) + calm.second[:, 0, 0] - total**2 / count
        free = np.maximum(recent.count / (self._independent * alike) - 2.0, 0.0)
        left = np.maximum(mismatch - shown**2 / excitation, 0.0) / np.maximum(free * self._independent, 1e-12)
        chance = np.sqrt((left + self._resolution**2) * self._independent / excitation)
        found = within(np.abs(shown) / excitation - SIGNIFICANT * chance, 0.0, RATIO_MAX - 1.0)
        self.mismatch = np.where(free > 0.0, found, 0.0)


class LagsOnArrays:
    """Updates the lags of the models of all vehicles, (C,), in place as they fly.

    Everything that predicts or steers by those models reads them at each tick.
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
        """Start with the lags of `models`; `history` holds the setpoints.

        If not `in_use`, the models stay unchanged, and only their mismatch is monitored.
        """
        self.models = models
        self.lagging: Mask = np.ones(len(models), dtype=bool)
        """(C,) which vehicles fly by (7). No lags are estimated of others, which (7) only approximates."""
        self._in_use = in_use
        self._believed = AutopilotModels.from_each(models)
        self._history = history
        columns = len(models)
        air, height = Nodes.of(5, 1), Nodes.of(4, 2)
        each = zip((air, air, height), RESOLUTION, FINEST, strict=True)
        self.channels = tuple(
            Channel(nodes, columns, first, finest, telemetry_hz, in_use=in_use) for nodes, first, finest in each
        )
        """Airspeed, heading, height."""
        self._bank = ModelSet(self._believed, air.at[:, 0], height.at)
        self._ticks = max(2, round(BATCH_S * law_hz))
        self._seen: list[Seen] = [(math.nan, math.nan, math.nan, math.nan)] * columns
        self._stamps = [0] * columns
        self._samples: list[tuple[list[int], list[Seen]]] = []
        self._learning = [True] * columns

    @property
    def mismatch(self) -> Array:
        """(3, C) share by which the lags of airspeed, heading and height seem to differ from those in use."""
        return np.array([channel.mismatch for channel in self.channels])

    @property
    def ratios(self) -> Array:
        """(4, C) ratios of the lags of airspeed, heading and height (two) to the assumed ones."""
        return np.exp(np.concatenate([channel.log_ratio.T for channel in self.channels]))

    def add_sample(self, column: int, stamp: int, motion: Seen) -> None:
        """Take a vehicle's measured airspeed, heading, height and climb at `stamp`, m/s, rad, m."""
        self._stamps[column], self._seen[column] = max(stamp, self._stamps[column]), motion

    def update(self, learning: list[bool]) -> None:
        """Take the newest samples at a tick; `learning` (C,): vehicles that fly by their setpoints.

        The models' lags are fitted once in `BATCH_S`.
        """
        for column, flies in enumerate(learning):
            self._learning[column] = self._learning[column] and flies and not math.isnan(self._seen[column][0])
        self._samples.append((self._stamps.copy(), self._seen.copy()))
        if len(self._samples) <= self._ticks:
            return
        stamps = np.array([each for each, _ in self._samples], dtype=np.int64)
        self._take(stamps, np.array([each for _, each in self._samples]).transpose(0, 2, 1))
        self._samples, self._learning = self._samples[-1:], [True] * len(learning)

    def _take(self, stamps: Instants, seen: Array) -> None:
        """Fit the lags to a batch of samples (B + 1, 4, C) at `stamps` (B + 1, C); the first ended the last batch."""
        sent = [self._history.of(column) for column in range(len(self.models))]
        places = range(sent[0].acting(int(stamps[0, 0])), sent[0].end)
        acts = np.array([[each.acts[place] for each in sent] for place in places], dtype=np.int64)
        commands = np.array([[each.at(place) for each in sent] for place in places]).transpose(0, 2, 1)
        gaps = (stamps[-1] - stamps[0]) / NANOSECONDS > GAP_S + BATCH_S
        learning: Mask = self._learning & self.lagging & self._bank.flying
        learning &= np.isfinite(commands).all(axis=(0, 1)) & ~gaps
        if (learning & (stamps[-1] > stamps[0])).any():
            flown, free = self._bank.fly(stamps, acts, np.where(learning, commands, 0.0))
            simulated, learning = [*flown], learning & free
        else:
            simulated = [np.zeros((*stamps[1:].shape, len(channel.nodes.at))) for channel in self.channels]
            learning = np.tile(learning, (len(simulated), 1))
        newer = stamps[1:] > stamps[:-1]
        for row, (channel, motion) in enumerate(zip(self.channels, simulated, strict=True)):
            differences = motion - seen[1:, row, :, None]
            channel.learn(wrap(differences) if row == 1 else differences, newer & learning[row])
        if self._in_use:
            self._apply((self._believed.table[:4] * self.ratios).T.tolist())
        self._bank.begin(~np.broadcast_to(learning, (len(self.channels), gaps.size)), seen[-1])

    def _apply(self, taus_s: list[list[float]]) -> None:
        for model, (tau_v_s, tau_psi_s, tau_ha_s, tau_hb_s) in zip(self.models, taus_s, strict=True):
            model.tau_v_s, model.tau_psi_s, model.tau_ha_s, model.tau_hb_s = tau_v_s, tau_psi_s, tau_ha_s, tau_hb_s

# Compiled by mypyc: it runs every tick.

"""Fits a vehicle's time constants to its telemetry, from simulations by several models (7)."""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec

from flight_model.autopilot_model import squared, within
from gcs_formation.features.time_constants.interpolation import BOUND, RATIO_MAX, Nodes
from gcs_formation.features.time_constants.model_set import ResidualBatch
from gcs_formation.features.time_constants.persistence import BATCH_S, PRIOR_BATCHES, Persistence
from gcs_formation.features.time_constants.sums_of_products import (
    add_products,
    centred,
    count_of,
    dot,
    information_of,
    inverse_with,
    projected,
    residual_square,
    scale,
    weights_near,
    zeros,
)

PRIOR_SPREAD: Final = 0.35
"""Prior standard deviation of the logarithm of a time constant's ratio to the declared one: 40 %. Tuned: a number; 0.2
to 0.7; shown by `python -m benchmarks.model_draws`."""
PRIOR_INFORMATION: Final = 1.0 / PRIOR_SPREAD**2
CORRELATED_S: Final = 1.0
"""Residuals this far apart count as independent, unless they are found to be correlated for longer. Tuned: s; 0.5 to 3;
shown by `pytest tests/gcs_formation/features/time_constants`."""
STEP_MAX: Final = 0.1
"""Largest change of a ratio's logarithm at a fit. Tuned: a number; 0.05 to 0.2; shown by `pytest
tests/gcs_formation/features/time_constants`."""
SETTLED: Final = 1e-3
"""After a fit that changes a ratio's logarithm by less, the next one waits for a batch with excitation. Tuned: a
number; 1e-4 to 1e-2; by judgement."""
MIN_SPREAD: Final = 0.02
"""Old samples are forgotten once a ratio's logarithm has a smaller standard deviation, since time constants may change.
Without excitation nothing is estimated and nothing forgotten. Tuned: a number; 0.01 to 0.05; shown by `pytest
tests/gcs_formation/features/time_constants`."""
RECENT_S: Final = 20.0
"""Time constant of the mismatch's memory. Tuned: s; 10 to 60; shown by `pytest
tests/gcs_formation/features/time_constants`."""
STILL_RECENT: Final = math.exp(-BATCH_S / RECENT_S)
FITTED: Final = 2.0
"""Degrees of freedom of the residuals that the mismatch's own fit uses, for a mean and a share."""
SIGNIFICANT: Final = 2.0
"""Standard deviations by which the mismatch is reduced, so that chance doesn't count. Tuned: standard deviations; 1.5
to 3; shown by `pytest tests/gcs_formation/features/time_constants`."""


class TimeConstantFit:
    """The fit of the P time constants of a vehicle's airspeed, heading or height."""

    def __init__(self, nodes: Nodes, resolution: float, finest: float, rate_hz: float, *, in_use: bool) -> None:
        """Start with the declared time constants.

        Args:
            nodes: the simulations' interpolation.
            resolution: standard deviation assumed of residuals before any were seen.
            finest: the smallest that they may turn out to have.
            rate_hz: of the telemetry.
            in_use: whether the model has the fitted time constants, not the declared ones.
        """
        self.log_ratio = [0.0] * nodes.parameters
        """(P) logarithms of the fitted time constants' ratios to the declared ones."""
        self.mismatch = 0.0
        """Relative difference of recently flown time constants from those in use, beyond chance."""
        self._nodes, self._in_use = nodes, in_use
        self._min_variance, self._finest_variance = resolution**2, finest**2
        self._alike = max(1.0, CORRELATED_S * rate_hz)
        self._kept = 1.0
        """Factor by which the sums are scaled before the next batch is added: forgetting."""
        self._settled = True
        """Whether the last fit changed less than `SETTLED`."""
        self._weights = nodes.weights(self.log_ratio)
        """Weights of the simulations at the time constants in use, and their derivatives."""
        self._persistence = Persistence(resolution)
        self._all, self._recent = zeros(len(nodes.at) + 1), zeros(len(nodes.at) + 1)
        """(K + 1, K + 1) sums of products over all samples, and over recent ones, of batches with excitation, up to the
        diagonal: products of the K simulations minus telemetry, and of 1."""
        self._still_recent = 1.0
        """Factor by which the recent sums are yet to be scaled."""
        self._shown = zeros(nodes.parameters + 2)
        """(P + 2, P + 2) likewise over recent samples: of residuals of the time constants in use, their derivatives,
        and 1."""
        self._calm_square = self._calm_total = self._calm_count = 0.0
        """Sums over recent samples of batches without excitation: of residuals squared, of residuals, and of 1."""

    def update(self, tracks: ResidualBatch) -> bool:
        """Take a batch of samples; refit if it has excitation or time constants still change, and return whether.

        Without excitation all simulations agree; the samples then only show how large and how correlated residuals are.
        """
        excited = tracks.excited(math.sqrt(self._noise_variance()))
        fits = excited or not self._settled
        self._age()
        if excited:
            self._add(tracks)
        if fits:
            weights = self._nodes.weights(self.log_ratio)
            seen = centred(projected(self._all, weights))
            step = self._least_squares_step(seen)
            self._take(tracks, weights_near(weights, step), calm=not excited)
            self._fit(seen, self._persistence.batches * residual_square(seen, step) / count_of(self._all))
            self._shown = projected(self._recent, self._weights)
            scale(self._shown, self._still_recent)
        else:
            self._take(tracks, self._weights[0], calm=True)
        self._judge()
        return fits

    def _age(self) -> None:
        """Apply one batch's forgetting to the recent sums."""
        self._still_recent *= STILL_RECENT
        scale(self._shown, STILL_RECENT)
        self._calm_square *= STILL_RECENT
        self._calm_total *= STILL_RECENT
        self._calm_count *= STILL_RECENT

    def _add(self, tracks: ResidualBatch) -> None:
        """Add a batch with excitation to the sums."""
        scale(self._all, self._kept)
        scale(self._recent, self._still_recent)
        self._still_recent = 1.0
        for sample in range(tracks.count):
            add_products(tracks.rows[sample], self._all, self._recent)

    def _take(self, tracks: ResidualBatch, weights: vec[float], *, calm: bool) -> None:
        """Take a batch's residuals, given the weights of the simulations; `calm`: without excitation."""
        square = total = 0.0
        for sample in range(tracks.count):
            residual = dot(weights, tracks.rows[sample])
            square += residual * residual
            total += residual
        count = float(tracks.count)
        self._persistence.add_batch(total / count if count > 0.0 else math.nan)
        if calm:
            self._calm_square += square
            self._calm_total += total
            self._calm_count += count

    def _noise_variance(self) -> float:
        """Return the residuals' variance that isn't the time constants': less than at first once batches show less."""
        return within(self._persistence.variance, self._finest_variance, self._min_variance)

    def _least_squares_step(self, seen: vec[vec[float]]) -> list[float]:
        """Return the step of the log ratios that minimises the residuals `seen`, regularised by the prior."""
        found = [0.0 for _ in self.log_ratio]
        held = PRIOR_INFORMATION * self._noise_variance() * self._alike
        for index, row in enumerate(inverse_with(information_of(seen, 1.0), held)):
            for other, each in enumerate(row):
                found[index] -= each * seen[1 + other][0]
        return found

    def _fit(self, seen: vec[vec[float]], variance: float) -> None:
        """Make a Gauss-Newton step towards the most likely time constants, and set how much is forgotten.

        Args:
            seen: products of the residuals at the present ratios, and of their derivatives, about their means.
            variance: of the residuals that no time constants explain, times the number of correlated batches.
        """
        log_ratio, maximum, change = self.log_ratio, 1.0, 0.0
        worth = 1.0 / ((variance + self._noise_variance()) * self._alike)
        information = information_of(seen, worth)
        pull = [-seen[1 + index][0] * worth - each * PRIOR_INFORMATION for index, each in enumerate(log_ratio)]
        for index, row in enumerate(inverse_with(information, PRIOR_INFORMATION)):
            wanted, before = 0.0, log_ratio[index]
            for other, each in enumerate(row):
                wanted += each * pull[other]
            log_ratio[index] = within(before + within(wanted, -STEP_MAX, STEP_MAX), -BOUND, BOUND)
            change = max(change, abs(log_ratio[index] - before))
            maximum = max(maximum, information[index][index])
        self._kept = min(1.0, 1.0 / (MIN_SPREAD**2 * maximum))
        self._settled = change < SETTLED
        if self._in_use:
            self._weights = self._nodes.weights(log_ratio)

    def _judge(self) -> None:
        """Estimate the model mismatch: the common relative difference of time constants in use and flown recently.

        The number of independent residuals is that of samples with excitation, divided by the correlation time, less
        `FITTED`. Calm flight doesn't add to it: a gust and the law's response to it are one event, however long the
        flight. With none left the mismatch is 0. It is limited to the range of the simulations.
        """
        sums, last = self._shown, len(self._shown) - 1
        samples = max(sums[last][last] + self._calm_count, 1.0)
        total, slopes = sums[last][0] + self._calm_total, 0.0
        shown = by_all = 0.0
        for one in range(1, last):
            slopes += sums[last][one]
            shown += sums[one][0]
            for other in range(1, last):
                by_all += sums[max(one, other)][min(one, other)]
        shown -= slopes * total / samples
        excitation = max(by_all - squared(slopes) / samples, 1e-12)
        size = sums[0][0] + self._calm_square - squared(total) / samples
        free = sums[last][last] / (self._alike * min(self._persistence.batches, PRIOR_BATCHES)) - FITTED
        if free <= 0.0:
            self.mismatch = 0.0
            return
        left = max(size - squared(shown) / excitation, 0.0) / (self._alike * free)
        chance = math.sqrt((left + self._min_variance) * self._alike / excitation)
        self.mismatch = within(abs(shown) / excitation - SIGNIFICANT * chance, 0.0, RATIO_MAX - 1.0)

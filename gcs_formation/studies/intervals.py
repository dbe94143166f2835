"""Intervals of shares of flights that come in clusters, such as all seeds of one sample.

Flights of a cluster resemble one another, so that ten of them say less than ten independent ones; how much less isn't
known, and few clusters say little about it. The number kept in each cluster is therefore taken to be beta-binomial
(Williams, Biometrics 31, 1975, 949-952): a cluster's own share has the mean p and the correlation rho within clusters,
from 0 (independent flights) to 1 (all of a cluster alike). The interval's ends are quantiles of p, with rho integrated
out. It needs no estimate of a design effect, which is worth little near 0 and 1, where few clusters differ.

Of independent flights, and of clusters of one, it becomes one between Clopper's and Pearson's (`SIDE` 0, which always
covers more than is asked for) and Jeffreys' (1/2, which covers as much on average and less at some shares), both in
Brown, Cai and DasGupta, Statistical Science 16 (2001), 101-133. Its coverage is that of
tests/gcs_formation/studies/test_intervals.py.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Self

import numpy as np
from scipy.special import betaln

from flight_model.arrays import Array, Mask
from gcs_formation.studies import DRAWN, Study
from gcs_formation.studies.plan import Row, seed_changes_nothing

SIDE = 0.3
"""Each end's prior of p is beta(SIDE, 1 - SIDE), for the upper end mirrored. The largest at which 8 to 100 clusters of
one flight cover 92 % at every share; 0.4 leaves 90 % at some."""
SHARES, CORRELATIONS = 256, 13
"""Points of p and of rho, evenly spaced in arcsin(sqrt(·)): Jeffreys' prior of p is uniform there."""
NEARLY = 1e-6
"""Distance of the smallest and the largest rho from 0 and 1."""
KEPT_UP_TO = 512
"""Outcomes of clusters whose likelihoods are remembered, 27 kB each."""
_EDGES = np.linspace(0.0, np.pi / 2.0, SHARES + 1)
_ANGLES = (_EDGES[1:] + _EDGES[:-1]) / 2.0
_P = np.sin(_ANGLES)[:, None] ** 2
_RHO = np.clip(np.sin(np.linspace(0.0, np.pi / 2.0, CORRELATIONS))[None, :] ** 2, NEARLY, 1.0 - NEARLY)


class Unit(StrEnum):
    """What is random in a study, and so what its flights are clustered by."""

    SAMPLE = "sample"
    SEED = "seed"
    FLIGHT = "flight"
    NONE = "none"


AGREE = "; flights of one may agree to any degree (beta-binomial, their correlation integrated out)"
WORDS = {
    Unit.SAMPLE: f"by sample: samples are drawn, and each is flown with the same seeds, for which it holds{AGREE}",
    Unit.SEED: f"by seed: samples are chosen, and each seed is flown with all of them{AGREE}",
    Unit.FLIGHT: "by flight: every flight draws values of its own, with one seed, for which it holds",
    Unit.NONE: "none: one seed, and nothing is drawn",
}
SEED_CHANGES_NOTHING = "the seed changes nothing in these flights"
ONE_SEED = "one seed, and nothing is drawn"


@dataclass(frozen=True)
class Chance:
    """What is random in some flights of a study."""

    unit: Unit
    exact: str = ""
    """Why shares of these flights are exact and have no interval; "" where they are a random sample."""

    @classmethod
    def of(cls, study: Study, rows: Sequence[Row]) -> Self:
        """Return what is random in flights of a study.

        In a drawn design it is the samples, whether or not seeds change anything. Otherwise samples are chosen: it is
        the seeds or, with one seed, the values that each flight draws by itself.
        """
        if study.design in DRAWN:
            return cls(Unit.SAMPLE)
        if study.seeds.count > 1:
            return cls(Unit.SEED, SEED_CHANGES_NOTHING if seed_changes_nothing(study, rows) else "")
        return cls(Unit.FLIGHT) if study.draws else cls(Unit.NONE, ONE_SEED)

    @property
    def words(self) -> str:
        """What the intervals are, in words."""
        return f"none: {self.exact}" if self.exact else WORDS[self.unit]


def clusters_of(study: Study, rows: Sequence[Row]) -> Array:
    """Return the number of the cluster that each flight is in, (N,): equal for flights that may resemble each other."""
    unit = Chance.of(study, ()).unit
    if unit == Unit.SEED:
        return np.array([row["seed"] for row in rows], dtype=np.float64)
    of_sample = study.flights_of_a_sample if unit == Unit.SAMPLE else 1
    return np.array([row["flight"] // of_sample for row in rows], dtype=np.float64)


def by_cluster(kept: Mask, clusters: Array) -> list[tuple[int, int]]:
    """Return how many flights of each cluster are kept, and how many it has, from both for each flight, (N,)."""
    _, inverse = np.unique(clusters, return_inverse=True)
    flights = np.bincount(inverse)
    return list(zip(np.bincount(inverse, weights=kept).astype(int).tolist(), flights.tolist(), strict=True))


def share_interval(clusters: Iterable[tuple[int, int]], confidence: float) -> tuple[float, float]:
    """Return the interval of a share of flights.

    Args:
        clusters: how many flights of each cluster are kept, and how many flights it has, 1 or more.
        confidence: how often intervals cover the true share, 0 to 1.

    A cluster may have any number of flights. All kept: the upper end is 1; none: the lower is 0.
    """
    outcomes = Counter(clusters)
    logarithm = sum((many * _log_likelihood(*each) for each, many in outcomes.items()), np.zeros(_P.shape))
    likelihood = np.exp(logarithm - logarithm.max()).sum(axis=1)
    tilt = np.tan(_ANGLES) ** (2.0 * SIDE - 1.0)
    outside = (1.0 - confidence) / 2.0
    low, high = _quantile(likelihood * tilt, outside), _quantile(likelihood / tilt, 1.0 - outside)
    any_kept = any(kept for kept, _ in outcomes)
    any_missed = any(kept < flights for kept, flights in outcomes)
    return low if any_kept else 0.0, high if any_missed else 1.0


def _quantile(weights: Array, share: float) -> float:
    below = np.concatenate(([0.0], np.cumsum(weights)))
    return float(np.sin(np.interp(share * below[-1], below, _EDGES)) ** 2)


@lru_cache(maxsize=KEPT_UP_TO)
def _log_likelihood(kept: int, flights: int) -> Array:
    """Return the logarithm of the likelihood of a cluster's outcome, (SHARES, CORRELATIONS), less a constant."""
    alpha, beta = _P * (1.0 / _RHO - 1.0), (1.0 - _P) * (1.0 / _RHO - 1.0)
    return np.asarray(betaln(alpha + kept, beta + flights - kept) - betaln(alpha, beta), dtype=np.float64)

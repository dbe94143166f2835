"""Which vehicles could come too near to each other at all: a bound that needs no ways."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from gcs_formation.arrays import Array, Mask, all_of, wrap
from gcs_formation.estimation.flight_state import Indices
from gcs_formation.estimation.predictor import AirLags
from gcs_formation.separation.manoeuvre import COARSE_S
from gcs_formation.separation.scene import Scene

FEW = 32
"""Vehicles of whom a look at every pair costs less than a search for those that are near."""


class Reach(NamedTuple):
    """How far vehicles get, seen from a frame that moves on as the reference does, (N,)."""

    place_m: Array
    """(2, N) north and east in that frame, at the instant that all are looked at from."""
    far_m: Array
    fast_mps: Array


def possible_pairs(scene: Scene) -> tuple[Indices, Indices]:
    """Return the pairs (one < other) that could come too near as told, one of them commanded at least.

    Exact: no pair is left out whose ways as told come nearer than they are to keep.
    """
    reach, count = bound(scene), scene.commanded.size
    one, other = _all_pairs(count) if count <= FEW else _pairs_within(_farthest_m(scene, reach), reach.place_m)
    apart_m = _length(*(reach.place_m[:, other] - reach.place_m[:, one]))
    kept = scene.kept(one, other)
    needed_m = kept.distance_m + kept.off_s * (reach.fast_mps[one] + reach.fast_mps[other])
    possible: Mask = apart_m < needed_m + reach.far_m[one] + reach.far_m[other]
    possible &= scene.commanded[one] | scene.commanded[other]
    return one[possible], other[possible]


def bound(scene: Scene) -> Reach:
    """Return how far and how fast the ways as told lead at most in the frame of the reference, level.

    An error of speed or heading e that decays with a lag tau at a rate of r at most leads e tau + e^2 / (2 r) off; the
    trapezium rule, half a step more.
    """
    traffic, state, told = scene.traffic, scene.traffic.state, scene.told
    lags, value = AirLags.of(traffic.model), state.air_motion
    along = np.array(scene.along)
    errors = np.abs(np.array((along, told.air_motion)) - value)
    errors[:, 1] = np.abs(wrap(errors[:, 1]))
    error, to_told = errors
    first_s, horizon_s = traffic.lead_s + scene.times_s[1], traffic.lead_s + scene.times_s[-1]
    error += np.minimum(to_told / lags.tau_s, lags.rate_max) * first_s
    off = error * (first_s + lags.tau_s + COARSE_S / 2) + error**2 / (2 * lags.rate_max)
    reference = scene.reference
    drift_mps = _length(*(state.wind_mps - state.wind_mps[:, [reference]])) + np.abs(
        along[0] - state.airspeed_mps[reference]
    )
    far_m = off[0] + along[0] * off[1] + drift_mps * horizon_s
    fast_mps = error[0] + along[0] * error[1] + drift_mps
    frame_mps = scene.velocity_mps[:, [reference]]
    place_m = state.level_m + frame_mps * traffic.lead_s
    if not all_of(scene.commanded):
        _free(scene, frame_mps, far_m, fast_mps, horizon_s)
    return Reach(place_m, far_m, fast_mps)


def _free(scene: Scene, frame_mps: Array, far_m: Array, fast_mps: Array, horizon_s: Array) -> None:
    """Fill in those that aren't commanded: they go on, straight or in a turn."""
    state, free = scene.traffic.state, ~scene.commanded
    circling_mps = state.airspeed_mps + _length(state.wind_north_mps, state.wind_east_mps) + _length(*frame_mps)
    straight_mps = _length(*(scene.velocity_mps - frame_mps))
    mps: Array = np.where(scene.traffic.turn_rps == 0, straight_mps, circling_mps)
    fast_mps[free], far_m[free] = mps[free], (mps * horizon_s)[free]


def _farthest_m(scene: Scene, reach: Reach) -> float:
    """Return a distance beyond which no two come too near."""
    most_m = 2 * (reach.far_m.max() + 2 * scene.timing_s.max() * reach.fast_mps.max())
    return float(most_m) + max(scene.kept_m, scene.kept_from_others_m)


def _pairs_within(most_m: float, place_m: Array) -> tuple[Indices, Indices]:
    """Return the pairs (one < other), in order, of places (2, N) no farther apart."""
    near = cKDTree(place_m.T).query_pairs(most_m, output_type="ndarray")
    one, other = near.min(axis=1), near.max(axis=1)
    order = np.lexsort((other, one))
    return one[order], other[order]


@cache
def _all_pairs(count: int) -> tuple[Indices, Indices]:
    one, other = np.triu_indices(count, 1)
    return one, other


def _length(north: Array, east: Array) -> Array:
    return np.hypot(north, east)

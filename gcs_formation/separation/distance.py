"""How near vehicles come to each other on ways that are known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gcs_formation.arrays import Array, Mask, within


class Approach(NamedTuple):
    """How near pairs come, (P,)."""

    nearest_m: Array
    in_s: Array
    """When."""
    deficit_ms: Array
    """Integral over time of what their distance lacks of the one that is to be kept; 0 where it's kept."""


class Kept(NamedTuple):
    """What pairs are to keep, (P,)."""

    distance_m: Array
    off_s: Array
    """How much earlier or later than reckoned the one may be where it's reckoned to be, as seen from the other."""

    def times(self, share: float) -> Kept:
        """Return a share of both."""
        return Kept(share * self.distance_m, share * self.off_s)


def approach(one: Array, other: Array, kept: Kept, times_s: Array) -> Approach:
    """Return how near pairs come; between the samples they move straight.

    The faster they move past each other, the farther may they be from where they're reckoned to be: the distance that
    they keep grows with `off_s`. It depends on the way alone: what is safe on a way stays safe while it is flown.

    Args:
        one: (3, S, P) places of the one vehicle of each pair.
        other: (3, S, P), those of the other.
        kept: what they are to keep.
        times_s: (S,) of the samples.
    """
    apart = other - one
    begin, way = apart[:, :-1], np.diff(apart, axis=1)
    squared = np.maximum((way**2).sum(axis=0), 1e-12)
    share = within(-(begin * way).sum(axis=0) / squared, 0.0, 1.0)
    distance = np.sqrt(((begin + share * way) ** 2).sum(axis=0))
    steps_s = np.diff(times_s)[:, None]
    needed_m = kept.distance_m + kept.off_s * np.sqrt(squared) / steps_s
    when = np.argmin(distance, axis=0)
    pairs = np.arange(kept.distance_m.size, dtype=np.intp)
    return Approach(
        distance[when, pairs],
        (times_s[:-1, None] + share * steps_s)[when, pairs],
        (np.maximum(needed_m - distance, 0.0) * steps_s).sum(axis=0),
    )


def may_come_near(ours: Array, theirs: Array, kept: Kept, times_s: Array) -> Mask:
    """Return whom (O,) any of one vehicle's ways may bring nearer than it's to keep, seen from above.

    From the boxes around ways between one sample and the next: nobody is left out that comes too near.

    Args:
        ours: (2, S, M) north and east of the one vehicle's ways.
        theirs: (2, S, O), the way of each of the others.
        kept: what each of them and the one are to keep, (O,).
        times_s: (S,) of the samples.
    """
    steps_s = np.diff(times_s)
    fast_mps = np.linalg.norm(np.diff(ours, axis=1), axis=0).max(axis=1) / steps_s
    fast_mps = fast_mps[:, None] + np.linalg.norm(np.diff(theirs, axis=1), axis=0) / steps_s[:, None]
    low, high = np.minimum(ours[:, 1:], ours[:, :-1]).min(axis=2), np.maximum(ours[:, 1:], ours[:, :-1]).max(axis=2)
    above = np.minimum(theirs[:, 1:], theirs[:, :-1]) - high[:, :, None]
    below = low[:, :, None] - np.maximum(theirs[:, 1:], theirs[:, :-1])
    apart_m = np.linalg.norm(np.maximum(np.maximum(above, below), 0.0), axis=0)
    return (apart_m < kept.distance_m + kept.off_s * fast_mps).any(axis=0)

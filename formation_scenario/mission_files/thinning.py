"""Thins the points of a line to those that it needs to stay within a tolerance: in files read and in files written.

Source: D. H. Douglas, T. K. Peucker, Cartographica 10, 1973.
"""

from __future__ import annotations

import numpy as np

from flight_model.arrays import Array, Mask


def thinned(points_m: Array, tolerance_m: float) -> Array:
    """Return the points (K, 3) of a line (N, 3) without which it would leave the line by more than the tolerance."""
    return points_m[kept(points_m, tolerance_m)]


def kept(points_m: Array, tolerance_m: float) -> Mask:
    """Return the mask (N,) of points (N, D) without which their line leaves the others by more than a tolerance."""
    keep = np.zeros(len(points_m), dtype=np.bool_)
    keep[[0, -1]] = True
    spans = [(0, len(points_m) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        away_m = _distances_m(points_m[first + 1 : last], points_m[first], points_m[last])
        worst = int(np.argmax(away_m))
        if away_m[worst] > tolerance_m:
            middle = first + 1 + worst
            keep[middle] = True
            spans += [(first, middle), (middle, last)]
    return keep


def smoothed(points_m: Array, tolerance_m: float) -> Array:
    """Return points (K, 3) whose line passes points (N, 3) within a tolerance over the ground, and in height.

    Both are thinned by themselves, so that a point kept for a bend takes the height of a climb around it, and one kept
    for a climb lies on the line of the bends around.
    """
    along_m = np.concatenate((np.zeros(1), np.cumsum(np.linalg.norm(np.diff(points_m[:, :2], axis=0), axis=1))))
    bends = kept(points_m[:, :2], tolerance_m)
    climbs = kept(np.column_stack((along_m, points_m[:, 2])), tolerance_m)
    at_m = np.unique(along_m[bends | climbs])
    both = ((bends, 0), (bends, 1), (climbs, 2))
    return np.stack([np.interp(at_m, along_m[which], points_m[which, axis]) for which, axis in both], axis=1)


def _distances_m(points_m: Array, begin_m: Array, end_m: Array) -> Array:
    """Return the distances (N,) of points (N, D) from the line between two points."""
    along = end_m - begin_m
    squared = float(along @ along)
    from_begin = points_m - begin_m
    share = np.clip(from_begin @ along / squared, 0.0, 1.0) if squared > 0.0 else np.zeros(len(points_m))
    distances: Array = np.linalg.norm(from_begin - share[:, None] * along, axis=1)
    return distances

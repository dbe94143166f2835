"""The minimum distance of any two of many moving vehicles."""

from __future__ import annotations

import numpy as np

from flight_model.arrays import Array, Indices
from gcs_formation.record.timeseries import ROWS_AT_ONCE

STRAIGHT_ON_S = 1.0
"""Longest time between two instants over which flight is interpolated by straight lines."""


def min_separation_m(time_s: Array, positions: Array) -> Array:
    """Return the minimum distance of any two vehicles between each instant and the next, (T,) m.

    Positions are interpolated linearly over up to `STRAIGHT_ON_S`. The distance is infinite with fewer than two.

    Args:
        time_s: (T,) instants.
        positions: (3, V, T) positions at these; NaN where a vehicle is absent.
    """
    _, vehicles, ticks = positions.shape
    steps, at_once = np.zeros(positions.shape), max(1, ROWS_AT_ONCE // vehicles)
    if ticks > 1:
        steps[..., :-1] = np.where(np.diff(time_s) <= STRAIGHT_ON_S, np.diff(positions), 0.0)
    begins = range(0, max(1, ticks), at_once)
    return np.concatenate([_nearest_m(*(each[..., at : at + at_once] for each in (positions, steps))) for at in begins])


def _nearest_m(positions: Array, steps: Array) -> Array:
    """Return (T,) the minimum distance, m, of any two vehicles until the next tick; infinite with fewer than two.

    Not every pair is compared. Vehicles are sorted along the axis on which they are spread farthest: first each is
    compared with the next, then with the one after that, and so on. It ends once even the smallest gap along this axis,
    less what any two close in by until the next tick, is wider than the minimum distance found.

    Args:
        positions: (3, V, T) positions at the ticks; NaN where a vehicle is absent.
        steps: (3, V, T) displacements until the next tick.
    """
    spread = np.fmax.reduce(positions, axis=1, initial=-np.inf) - np.fmin.reduce(positions, axis=1, initial=np.inf)
    axis = int(np.where(np.isfinite(spread), spread, 0.0).sum(axis=1).argmax())
    _, vehicles, ticks = positions.shape
    order: Indices = positions[axis].argsort(axis=0)
    order = order * ticks + np.arange(ticks, dtype=np.intp)
    ordered, moved = [each.take(order) for each in positions], [each.take(order) for each in steps]
    max_m, min_m = (pick.reduce(steps[axis], axis=0) for pick in (np.fmax, np.fmin))
    closing_m = np.nan_to_num(max_m - min_m)
    squared = np.full(ticks, np.inf)
    for step in range(1, vehicles):
        gaps, changes = ([each[step:] - each[:-step] for each in of] for of in (ordered, moved))
        min_m = np.maximum(np.fmin.reduce(gaps[axis], axis=0, initial=np.inf) - closing_m, 0.0)
        if not (min_m**2 < squared).any():
            break
        minimum = _min_squared(gaps, [np.nan_to_num(each) for each in changes])
        squared = np.fmin(squared, np.fmin.reduce(minimum, axis=0, initial=np.inf))
    return np.sqrt(squared)


def _min_squared(gaps: list[Array], changes: list[Array]) -> Array:
    """Return the minimum square of the distance over gaps (3 arrays, one for each axis) that change by `changes`.

    Between two straight lines it is least at the share -gap.change/change.change of the way, or at one of its ends.
    """
    along = sum(gap * change for gap, change in zip(gaps, changes, strict=True))
    length = sum(change * change for change in changes)
    share = np.clip(-along / np.maximum(length, np.finfo(float).tiny), 0.0, 1.0)
    return np.sum([(gap + share * change) ** 2 for gap, change in zip(gaps, changes, strict=True)], axis=0)

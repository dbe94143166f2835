"""The least lift that keeps a path clear of the ground: a linear program over a spline's control points.

Whoever has no ground to clear doesn't import it: scipy takes longer than reading a scenario.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import scipy

from flight_model.arrays import Array, Indices
from flight_model.displacement import SAMPLES, STEP_M, Bounds, Lift, blend

TRIFLE_M = 0.01
"""Lifts below this are left out."""
SHORT_COST = 10.0
"""Cost of a missing metre, in metres of lift over the whole length: high, so that it is the last resort."""


def least_lift(start_m: float, needed_m: Array, slope: Array, bounds: Bounds, begun_m: Array) -> Lift:
    """Return the lift of the least area. It is nowhere negative, but for one that begins below 0 and rises to it.

    Args:
        start_m: distance at which it starts.
        needed_m: required lift at `sample_places`; negative or NaN where none is required.
        slope: the path's own slope there. With the lift it stays within the bounds; where it exceeds them by itself,
            the lift makes it no steeper.
        bounds: of the slope of path and lift together, and of the lift's curvature.
        begun_m: the first control points of a lift that is continued; it returns inside the bounds as soon as possible.
    """
    count = (needed_m.size - 1) // SAMPLES + 3
    needed = np.flatnonzero(needed_m > TRIFLE_M)
    if not needed.size and not begun_m.any():
        return Lift(start_m, np.zeros(count))
    rows, limits = _programme(needed, needed_m, slope[SAMPLES // 2 :: SAMPLES], bounds, begun_m)
    below = count if begun_m.min(initial=0.0) < 0.0 else 0
    if below:  # how far the lift is below 0 counts as how far it's above
        rows, limits = _with_depth(rows, count), np.concatenate((limits, np.zeros(count)))
    free = count - begun_m.size
    least = np.concatenate((begun_m, np.full(free, -np.inf if below else 0.0), np.zeros(needed.size + below)))
    most = np.concatenate((begun_m, np.full(free + needed.size + below, np.inf)))
    cost = np.concatenate((np.ones(count), np.full(needed.size, SHORT_COST * count), np.full(below, 2.0)))
    within = list(zip(least.tolist(), most.tolist(), strict=True))
    found: Any = scipy.optimize.linprog(cost, rows, limits, bounds=within, method="highs-ds")
    if found.x is None:
        # No continuation is within the bounds: hold the last value, and report all that is missing.
        held = np.concatenate((begun_m, np.full(free, begun_m[-1])))
        return Lift(start_m, held, float(np.nanmax(needed_m)))
    control_m, short_m, _ = np.split(np.asarray(found.x, dtype=np.float64), [count, count + needed.size])
    return Lift(start_m, control_m, float(short_m.max(initial=0.0)))


def _programme(needed: Indices, needed_m: Array, slope: Array, bounds: Bounds, begun_m: Array) -> tuple[Any, Array]:
    """Return rows and limits of `rows @ (control points, shortfalls) <= limits`; `slope` is that mid-step."""
    count = slope.size + 3
    lifted = _values_at(needed, count)
    rise: Any = scipy.sparse.diags_array([-1.0, 1.0], offsets=[0, 1], shape=(count - 1, count))
    bend: Any = scipy.sparse.diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(count - 2, count))
    own = np.pad(slope, 1, mode="edge")
    up, down = np.maximum(bounds.slope - own, 0.0) * STEP_M, np.maximum(bounds.slope + own, 0.0) * STEP_M
    curved = np.full(count - 2, bounds.curvature_1pm * STEP_M**2)
    limits = np.concatenate((-needed_m[needed], *_begun(begun_m, up, down, curved)))
    rows: Any = scipy.sparse.vstack((-lifted, rise, -rise, bend, -bend))
    short: Any = scipy.sparse.eye_array(limits.size, needed.size)
    return scipy.sparse.hstack((rows, -short)), limits


def _begun(begun_m: Array, up: Array, down: Array, curved: Array) -> tuple[Array, Array, Array, Array]:
    """Return limits that admit the lift as begun; a slope beyond them decreases as fast as the curvature allows."""
    widened: list[Array] = []
    for sign, limit in ((1.0, up), (-1.0, down)):
        rises, wide = sign * np.diff(begun_m), limit.copy()
        if rises.size:
            eased = rises[-1] - curved[0] * np.arange(1, limit.size - rises.size + 1)
            wide = np.maximum(wide, np.concatenate((rises, eased)))
        widened.append(wide)
    for sign in (1.0, -1.0):
        bends, wide = sign * np.diff(begun_m, n=2), curved.copy()
        wide[: bends.size] = np.maximum(wide[: bends.size], bends)
        widened.append(wide)
    return widened[0], widened[1], widened[2], widened[3]


def _with_depth(rows: Any, count: int) -> Any:  # noqa: ANN401 - scipy's sparse arrays are typed in part only
    """Return the rows with variables added for how far each control point is below 0, and the rows that bind them."""
    points: Any = scipy.sparse.hstack(
        (-scipy.sparse.eye_array(count), scipy.sparse.csr_array((count, rows.shape[1] - count)))
    )
    return scipy.sparse.vstack(
        (
            scipy.sparse.hstack((rows, scipy.sparse.csr_array((rows.shape[0], count)))),
            scipy.sparse.hstack((points, -scipy.sparse.eye_array(count))),
        )
    )


def _values_at(samples: Indices, count: int) -> Any:  # noqa: ANN401 - scipy's sparse arrays are typed in part only
    """Return the matrix (samples, control points) of the spline's values at samples."""
    first = np.minimum(samples // SAMPLES, count - 4)
    share: Array = (samples - first * SAMPLES) / SAMPLES
    one, zero = np.ones_like(share), np.zeros_like(share)
    units = [[one if i == j else zero for j in range(4)] for i in range(4)]
    weights = np.stack([blend(unit, share)[0] for unit in units], axis=1)
    rows = np.repeat(np.arange(samples.size), 4)
    columns: Any = (first[:, None] + np.arange(4)).ravel()
    return cast("Any", scipy.sparse.csr_array((weights.ravel(), (rows, columns)), (samples.size, count)))

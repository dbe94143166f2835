"""The least changes of waypoints' heights after which no leg is too steep, and none too low or too high.

A linear programme: the sum of all changes is least, which changes as few heights as possible, too (as least absolute
deviations do).
"""

from __future__ import annotations

import numpy as np

from flight_model.arrays import Array

MISSED = 100.0
"""How much worse a metre of rise beyond what is allowed is than a metre by which a height is changed."""


def min_changes(wanted_m: Array, within_m: tuple[Array, Array], rises_m: Array) -> Array | None:
    """Return the heights (n,) nearest to wanted ones by the sum of all changes; None if they have no room.

    Args:
        wanted_m: (n,) heights.
        within_m: (n,) lowest and (n,) highest heights.
        rises_m: (n - 1,) the most by which two successive heights may differ, kept as far as the others allow.
    """
    from scipy.optimize import LinearConstraint, milp  # noqa: PLC0415 - importing it takes as long as a scenario's keys
    from scipy.sparse import csr_array  # noqa: PLC0415

    count, legs = wanted_m.size, np.flatnonzero(np.isfinite(rises_m))
    lowest, highest = (each - wanted_m for each in within_m)
    if (lowest > highest).any():
        return None
    # Unknowns: a rise u and a fall d of each height, which becomes wanted + u - d, and what a leg rises too much.
    row, one, every, unit = np.arange(legs.size), np.ones(legs.size), np.arange(count), np.ones(count)
    size = 2 * count + legs.size
    columns = np.concatenate((legs, legs + 1, legs + count, legs + count + 1, row + 2 * count))
    rows = np.concatenate((row, row, row, row, row))
    falls, climbs = (
        csr_array((np.concatenate((-one, one, one, -one, sign * one)), (rows, columns)), shape=(legs.size, size))
        for sign in (1.0, -1.0)
    )
    indices = np.concatenate((every, every)), np.concatenate((every, every + count))
    each = csr_array((np.concatenate((unit, -unit)), indices), shape=(count, size))
    rise_m, max_m = np.diff(wanted_m)[legs], rises_m[legs]
    bounds = [
        LinearConstraint(falls, -max_m - rise_m, np.inf),
        LinearConstraint(climbs, -np.inf, max_m - rise_m),
        LinearConstraint(each, lowest, highest),
    ]
    cost = np.concatenate((np.ones(2 * count), np.full(legs.size, MISSED)))
    found = milp(cost, constraints=bounds)
    return np.asarray(wanted_m + found.x[:count] - found.x[count : 2 * count]) if found.success else None

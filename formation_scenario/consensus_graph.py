"""Communication graphs of the consensus law by name."""

from __future__ import annotations

import numpy as np

from flight_model.arrays import Array


def graph_adjacency(name: str, count: int) -> Array:
    """Return the unit-weight undirected graph (count, count) of a name: star, path, ring or complete.

    Vehicle 0 is the centre of the star and an end of the path.
    """
    p, q = np.indices((count, count))
    distance = np.abs(p - q)
    edges = {
        "star": np.minimum(p, q) == 0,
        "path": distance == 1,
        "ring": (distance == 1) | (distance == count - 1),
        "complete": np.full((count, count), True),
    }
    return (edges[name] & (distance > 0)).astype(np.float64)

"""Communication graphs as weighted adjacency matrices: entry (p, q) is positive when p hears q."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flight_model.arrays import Array, Indices


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


def as_adjacency(graph: npt.ArrayLike) -> Array:
    """Adjacency matrix (n, n) of a graph given by its weights, entry (p, q) > 0 when p hears q.

    Raises:
        ValueError: not square, a weight negative or not finite.
    """
    weights = np.asarray(graph, dtype=np.float64)
    if weights.size == 0 or weights.shape != (len(weights), len(weights)):
        raise ValueError(f"adjacency of shape {weights.shape}: a square matrix is needed")
    if not np.all(np.isfinite(weights) & (weights >= 0.0)):
        raise ValueError("adjacency weights must be finite and not negative")
    return weights


class Component(NamedTuple):
    """A strongly connected part of a graph."""

    members: Indices
    hears_nobody_outside: bool


def laplacian(adjacency: Array) -> Array:
    """Graph Laplacian: row sums on the diagonal less the adjacency (own loops cancel)."""
    return np.diag(adjacency.sum(axis=1)) - adjacency


def components(adjacency: Array) -> list[Component]:
    """Strongly connected components: the Laplacian is block triangular over them.

    Its spectrum, and that of the consensus protocol, is the union over the components, also where the
    whole matrix is defective (a leader-follower chain) and its computed eigenvalues would be far off.
    """
    import scipy  # noqa: PLC0415 - only mutual laws have such a graph

    linked = adjacency > 0
    count, labels = scipy.sparse.csgraph.connected_components(adjacency, directed=True, connection="strong")
    parts: list[Component] = []
    for label in range(int(count)):
        inside = labels == label
        parts.append(Component(np.flatnonzero(inside), not bool(linked[np.ix_(inside, ~inside)].any())))
    return parts


def spanning_components(adjacency: Array) -> list[Component]:
    """`components` of a graph with a spanning tree: exactly one of them hears nobody outside.

    Raises:
        ValueError: no spanning tree; the message names a vehicle of each group that hears nobody outside.
    """
    parts = components(adjacency)
    roots = [int(part.members[0]) for part in parts if part.hears_nobody_outside]
    if len(roots) > 1:
        raise ValueError(
            "the graph has no spanning tree: one vehicle must be heard, directly or through others, by all, "
            f"but the vehicles at rows {', '.join(map(str, roots))} hear nobody outside their own groups"
        )
    return parts

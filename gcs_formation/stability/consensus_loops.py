"""Delay margin of the consensus protocol (3) on a directed or undirected communication graph.

Graphs are weighted adjacency matrices: entry (p, q) is positive when p receives from q.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flight_model.arrays import Array, Complex, Indices
from gcs_formation.control.fuzzy_pid import PidGains
from gcs_formation.stability.pid_margins import Loop, Plant

_GRID = 400
_MARGINAL = 1e-10
_TIED = 1e-6


class _Gains(NamedTuple):
    k1: float
    k2: float
    damping: Array  # c_p = k3 h_p of each vehicle, 1/s


class Component(NamedTuple):
    """A strongly connected part of a graph."""

    members: Indices
    matrix: Array
    """Rows and columns of the graph's Laplacian that belong to its members."""
    is_closed: bool


def consensus_delay_margin(
    adjacency: npt.ArrayLike, k1: float, k2: float, k3: float = 0.0, h: npt.ArrayLike = 1.0
) -> float:
    """Smallest delay at which the consensus protocol (3) loses stability of the disagreement.

    With c = k3 h the same for all: [atan(k2 w/k1) + atan(c/w) - |arg lambda|]/w, least over the nonzero
    eigenvalues lambda of the Laplacian, w the crossover of s^2 + c s + lambda (k1 + k2 s) exp(-s tau);
    (34) of the paper is its case c = 0 on an undirected graph. Every crossing is towards instability, so the
    first one is the margin. With c_p of each vehicle: the first crossing of the generalised Nyquist loci.

    Args:
        adjacency: (n, n) weights; entry (p, q) > 0 when p receives from q.
        k1: position gain, 1/s^2; with 0, position differences persist and the margin is 0.
        k2: velocity gain, 1/s.
        k3: gain of the undelayed velocity term, 1/s.
        h: weight of that term, one number or (n,).

    Returns:
        Seconds; negative or 0 when unstable without delay; infinite for a single vehicle.

    Raises:
        ValueError: matrix not square, a weight or gain negative or not finite, no spanning tree.
    """
    weights = as_adjacency(adjacency)
    gains = _checked_gains(len(weights), k1, k2, k3, h)
    return min(
        _component_margin(part, gains._replace(damping=gains.damping[part.members]))
        for part in spanning_components(weights)
    )


def ground_consensus_loops(
    adjacency: npt.ArrayLike, k1: float, k2: float, onboard_damping: float, delayed_damping: float
) -> list[Loop]:
    """Loops of the protocol closed through a ground station: its modes, and the group's common speed.

    A mode of eigenvalue lambda: x'' = u - c x' and u = -lambda (k1 x + k2 x') - d x'. Scaling
    the loops' gains scales the protocol's weights and its damping beyond the autopilot's.

    Args:
        adjacency: (n, n) weights; entry (p, q) > 0 when p receives from q.
        k1: position gain, 1/s^2.
        k2: velocity gain, 1/s.
        onboard_damping: c, 1/s.
        delayed_damping: d, 1/s: gain of the velocity term computed on the ground.

    Raises:
        ValueError: as `consensus_delay_margin`.
    """
    weights, c, d = as_adjacency(adjacency), onboard_damping, delayed_damping
    _checked_gains(len(weights), k1, k2, c, 1.0)
    found = {complex(value) for part in spanning_components(weights) for value in _nonzero_eigenvalues(part).tolist()}
    eigenvalues = sorted(found, key=lambda value: (value.real, value.imag))
    modes = [Plant(((0.0, 1.0), (0.0, -c)), (0.0, 1.0), (value * k1, value * k2 + d)) for value in eigenvalues]
    group = [Plant(((-c, 0.0), (0.0, -1.0)), (1.0, 0.0), (d, 0.0))] if d and d > -c else []
    return [Loop(PidGains(1.0, 0.0, 0.0, filter_s=0.0), plant) for plant in modes + group]


def as_adjacency(graph: npt.ArrayLike) -> Array:
    """Adjacency matrix (n, n) of a graph given by its weights, entry (p, q) > 0 when p receives from q.

    Raises:
        ValueError: not square, a weight negative or not finite.
    """
    weights = np.asarray(graph, dtype=np.float64)
    if weights.size == 0 or weights.shape != (len(weights), len(weights)):
        raise ValueError(f"adjacency of shape {weights.shape}: a square matrix is needed")
    if not np.all(np.isfinite(weights) & (weights >= 0.0)):
        raise ValueError("adjacency weights must be finite and not negative")
    return weights


def laplacian(adjacency: Array) -> Array:
    """Graph Laplacian: row sums on the diagonal less the adjacency (own loops cancel)."""
    return np.diag(adjacency.sum(axis=1)) - adjacency


def components(adjacency: Array) -> list[Component]:
    """Strongly connected components: the Laplacian is block triangular over them.

    Its spectrum, and that of the consensus protocol, is the union over the components. This holds also if the whole
    matrix is defective (a leader-follower chain), where eigenvalues computed from it would be inaccurate.
    """
    import scipy  # noqa: PLC0415 - only mutual laws have such a graph

    linked, matrix = adjacency > 0, laplacian(adjacency)
    count, labels = scipy.sparse.csgraph.connected_components(adjacency, directed=True, connection="strong")
    parts: list[Component] = []
    for label in range(int(count)):
        inside = labels == label
        outside = linked[np.ix_(inside, ~inside)]
        parts.append(Component(np.flatnonzero(inside), matrix[np.ix_(inside, inside)], not bool(outside.any())))
    return parts


def spanning_components(adjacency: Array) -> list[Component]:
    """`components` of a graph with a spanning tree: exactly one of them receives from none outside.

    Raises:
        ValueError: no spanning tree; the message names a vehicle of each group that receives from none outside.
    """
    parts = components(adjacency)
    roots = [int(part.members[0]) for part in parts if part.is_closed]
    if len(roots) > 1:
        raise ValueError(
            "the graph has no spanning tree: all must receive from one vehicle, directly or through others, "
            f"but the vehicles at rows {', '.join(map(str, roots))} receive from none outside their own groups"
        )
    return parts


def _checked_gains(count: int, k1: float, k2: float, k3: float, h: npt.ArrayLike) -> _Gains:
    for name, gain in (("k1", k1), ("k2", k2), ("k3", k3)):
        if not (np.isfinite(gain) and gain >= 0.0):
            raise ValueError(f"{name} = {gain}: a finite number, not negative, is needed")
    weights = np.asarray(h, dtype=np.float64)
    if weights.shape not in {(), (count,)}:
        raise ValueError(f"h of shape {weights.shape}: one number, or one for each of {count} vehicles")
    if not np.all(np.isfinite(weights) & (weights >= 0.0)):
        raise ValueError("h must be finite and not negative")
    return _Gains(float(k1), float(k2), k3 * np.broadcast_to(weights, (count,)))


def _component_margin(part: Component, gains: _Gains) -> float:
    if part.members.size == 1 and part.is_closed:
        return float("inf")
    if gains.k1 == 0.0:
        return 0.0
    if np.ptp(gains.damping) == 0.0:
        return float(_mode_margins(_nonzero_eigenvalues(part), gains, gains.damping[0]).min())
    return _unlike_margin(part, gains)


def _nonzero_eigenvalues(part: Component) -> Complex:
    matrix = part.matrix
    symmetric = np.array_equal(matrix, matrix.T)
    values = np.asarray(np.linalg.eigvalsh(matrix) if symmetric else np.linalg.eigvals(matrix), np.complex128)
    return values[np.argsort(np.abs(values))][int(part.is_closed) :]


def _crossover(gain: Array | float, k1: float, k2: float, damping: float) -> Array:
    """Frequency where |gain (k1 + i k2 w)| = |w^2 - i c w|: (26) with the damping."""
    half = (np.square(gain * k2) - damping**2) / 2.0
    root = np.hypot(half, gain * k1)
    return np.sqrt(np.where(half > 0.0, half + root, np.square(gain * k1) / (root - np.minimum(half, 0.0))))


def _mode_margins(eigenvalues: Complex, gains: _Gains, damping: float) -> Array:
    w = _crossover(np.abs(eigenvalues), gains.k1, gains.k2, damping)
    lead = np.arctan(gains.k2 * w / gains.k1) + np.arctan(damping / w)
    return (lead - np.abs(np.angle(eigenvalues))) / w


def _unlike_margin(part: Component, gains: _Gains) -> float:
    crossings = _locus_crossings(part, gains)
    w, phase = crossings[:, 0], crossings[:, 1]
    if np.linalg.eigvals(_undelayed(part, gains)).real.max() > -_MARGINAL * float(w.max()):
        return min(float(np.min(phase / w)), 0.0)
    return float(np.min(np.where(phase < 0.0, phase + 2.0 * np.pi, phase) / w))


def _loci(w: Array | float, matrix: Array, gains: _Gains) -> Complex:
    """Eigenvalues of G(iw) L, G = diag((k1 + k2 s)/(s (s + c_p))), by magnitude; (..., n)."""
    s = 1j * np.asarray(w)[..., None]
    channel = (gains.k1 + gains.k2 * s) / (s * (s + gains.damping))
    values = np.linalg.eigvals(channel[..., None] * matrix)
    order = np.argsort(np.abs(values), axis=-1)
    return np.take_along_axis(values, order, axis=-1).astype(np.complex128)


def _crossover_grid(part: Component, gains: _Gains) -> Array:
    """Frequencies between one at which every locus is outside the unit circle and one at which none is."""
    norm = float(np.linalg.norm(part.matrix, 2))
    highest = 1.01 * float(_crossover(norm, gains.k1, gains.k2, float(gains.damping.min())))
    lowest = highest / 10.0
    while np.abs(_loci(lowest, part.matrix, gains)[int(part.is_closed)]) < 1.0:
        lowest /= 2.0
    return np.geomspace(lowest, highest, _GRID)


def _locus_crossings(part: Component, gains: _Gains) -> Array:
    """Rows (w, w tau) at which an eigenvalue of G L exp(-iw tau) is -1.

    The graph rotates a locus by less than a quarter turn from the channels' phase lead, which is in (0, pi)
    (Gershgorin). So w tau is taken in (-pi/2, 3 pi/2), negative where the graph rotates it by more than the lead.
    """
    import scipy  # noqa: PLC0415 - only for the consensus law with vehicles whose time constants differ

    matrix = part.matrix

    def excess(w: float, locus: int) -> float:
        return float(np.abs(_loci(w, matrix, gains)[locus])) - 1.0

    grid = _crossover_grid(part, gains)
    above = np.abs(_loci(grid, matrix, gains)) > 1.0
    found: list[tuple[float, float]] = []
    for index, locus in np.argwhere(above[1:] != above[:-1]).tolist():
        w = float(scipy.optimize.brentq(excess, float(grid[index]), float(grid[index + 1]), args=(locus,), xtol=1e-15))
        values = _loci(w, matrix, gains)
        crossing = values[np.abs(np.abs(values) - 1.0) < _TIED]
        found += [(w, float(turn)) for turn in np.mod(np.angle(-crossing) + np.pi / 2, 2 * np.pi) - np.pi / 2]
    return np.array(found)


def _undelayed(part: Component, gains: _Gains) -> Array:
    """System matrix of position and velocity deviations without delay, without the group's neutral common motion."""
    whole = np.eye(len(gains.damping))
    positions = whole[:, int(part.is_closed) :]
    relative = positions.T.copy()
    if part.is_closed:
        relative[:, 0] = -1.0  # deviations from the first vehicle
    damped = -gains.k2 * part.matrix - np.diag(gains.damping)
    return np.block([[np.zeros((len(relative),) * 2), relative], [-gains.k1 * part.matrix @ positions, damped]])

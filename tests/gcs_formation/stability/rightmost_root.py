"""The rightmost root of the consensus protocol with delays: a second way to its margins."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from flight_model.arrays import Array
from gcs_formation.stability.consensus_loops import Component, as_adjacency, laplacian, spanning_components

COINCIDENT = 1e-14


def consensus_rightmost_root(
    adjacency: npt.ArrayLike,
    k1: float,
    k2: float,
    k3: float = 0.0,
    h: npt.ArrayLike = 1.0,
    delays: npt.ArrayLike = 0.0,
    nodes: int = 24,
) -> complex:
    """Return the rightmost root of the protocol's disagreement, rad/s: negative real part if the formation converges.

    The translation of the whole formation is left out, because no term opposes it. So is the common speed if `h` is the
    same for all vehicles.

    Args:
        adjacency: (n, n) weights; entry (p, q) > 0 when p receives q.
        k1: position gain, 1/s^2.
        k2: velocity gain, 1/s.
        k3: gain of the undelayed velocity term, 1/s.
        h: weight of that term, one number or (n,).
        delays: seconds, one number or (n, n): entry (p, q) delays both states in p's term of q.
        nodes: collocation intervals over the longest delay.
    """
    weights = as_adjacency(adjacency)
    damping = k3 * np.broadcast_to(np.asarray(h, dtype=np.float64), (len(weights),))
    stamps = np.broadcast_to(np.asarray(delays, dtype=np.float64), weights.shape)
    by_delay = {float(tau): laplacian(np.where(stamps == tau, weights, 0.0)) for tau in np.unique(stamps)}
    roots = [complex(-np.inf)]
    for part in spanning_components(weights):
        parts = {tau: matrix[np.ix_(part.members, part.members)] for tau, matrix in by_delay.items()}
        terms = _state_terms(parts, part, k1, k2, damping[part.members])
        if terms[0.0].size:
            roots.append(rightmost_root(terms, nodes))
    return max(roots, key=lambda root: root.real)


def _state_terms(
    by_delay: dict[float, Array], part: Component, k1: float, k2: float, damping: Array
) -> dict[float, Array]:
    """Matrix of each delay over position and velocity deviations, without the neutral motion of the group."""
    count = len(damping)
    whole = np.eye(count)
    positions = whole[:, int(part.is_closed) :]
    velocities = positions if np.ptp(damping) == 0.0 else whole
    relative, speeds = _left_inverse(positions), _left_inverse(velocities)
    sizes = positions.shape[1], velocities.shape[1]
    terms = {
        tau: np.block(
            [
                [np.zeros((sizes[0], sum(sizes)))],
                [-k1 * speeds @ matrix @ positions, -k2 * speeds @ matrix @ velocities],
            ]
        )
        for tau, matrix in by_delay.items()
    }
    undelayed = np.block(
        [
            [np.zeros((sizes[0], sizes[0])), relative @ velocities],
            [np.zeros((sizes[1], sizes[0])), -speeds @ np.diag(damping) @ velocities],
        ]
    )
    return {**terms, 0.0: terms.get(0.0, 0.0) + undelayed}


def _left_inverse(embedding: Array) -> Array:
    """Left inverse of an embedding; one that leaves out the common motion gives deviations from the first vehicle."""
    count, kept = embedding.shape
    deviations = embedding.T.copy()
    if kept < count:
        deviations[:, 0] = -1.0
    return deviations


def rightmost_root(terms: Mapping[float, Array], nodes: int = 24) -> complex:
    """Rightmost root of det(sI - sum_k A_k exp(-s tau_k)), by pseudospectral discretisation.

    The infinitesimal generator of the solution operator is collocated at Chebyshev points of [-max tau, 0]
    (Breda, Maset and Vermiglio 2005): spectrally accurate while `nodes` well exceeds |s| max tau.

    Args:
        terms: matrix A_k, (n, n), of each delay in seconds; delay 0 is the undelayed term.
        nodes: collocation intervals; the eigenproblem is of size n (nodes + 1).

    Returns:
        The root in rad/s, the one above the real axis of a pair.
    """
    longest = max(terms)
    roots = np.linalg.eigvals(sum(terms.values()) if longest == 0.0 else _generator(terms, longest, nodes))
    rightmost = roots[np.argmax(roots.real)]
    return complex(rightmost.real, abs(rightmost.imag))


def _generator(terms: Mapping[float, Array], longest: float, nodes: int) -> Array:
    size = next(iter(terms.values())).shape[0]
    points = np.cos(np.pi * np.arange(nodes + 1) / nodes)
    generator = np.kron(_differentiation(points) * (2.0 / longest), np.eye(size)).astype(np.float64)
    at_delays = {delay: _interpolation(points, 1.0 - 2.0 * delay / longest) for delay in terms}
    generator[:size] = sum(np.kron(at_delays[delay], matrix) for delay, matrix in terms.items())
    return generator


def _weights(points: Array) -> Array:
    """Barycentric weights of Chebyshev points."""
    weights = np.where(np.arange(len(points)) % 2 == 0, 1.0, -1.0)
    weights[[0, -1]] /= 2.0
    return weights


def _differentiation(points: Array) -> Array:
    weights = _weights(points)
    gaps = points[:, None] - points + np.eye(len(points))
    matrix = weights / weights[:, None] / gaps
    np.fill_diagonal(matrix, 0.0)
    return matrix - np.diag(matrix.sum(axis=1))


def _interpolation(points: Array, at: float) -> Array:
    """Row that takes values at the points to the value of their interpolant."""
    gaps = at - points
    hit = np.abs(gaps) < COINCIDENT
    if hit.any():
        return hit.astype(np.float64)
    terms = _weights(points) / gaps
    return terms / terms.sum()

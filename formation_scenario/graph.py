"""The condition on a communication graph for vehicles to reach consensus."""

from __future__ import annotations

from collections.abc import Sequence


def has_spanning_tree(weights: Sequence[Sequence[float]]) -> bool:
    """Return whether all hear one vehicle, directly or through others; weights[p][q] > 0 when p hears q."""
    reached: set[int] = set()
    root = 0
    for vehicle in range(len(weights)):
        if vehicle not in reached:
            root = vehicle
            reached |= _audience(weights, vehicle)
    return len(_audience(weights, root)) == len(weights)


def _audience(weights: Sequence[Sequence[float]], source: int) -> set[int]:
    """Return who hears `source`, directly or through others, itself among them."""
    reached, waiting = {source}, [source]
    while waiting:
        heard = waiting.pop()
        new = {p for p, row in enumerate(weights) if row[heard] > 0} - reached
        reached |= new
        waiting.extend(new)
    return reached

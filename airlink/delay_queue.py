"""Items in transit, in the order of their arrival."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Generic, TypeVar

from airlink.clock import Instant

T = TypeVar("T")


class DelayQueue(Generic[T]):
    """Items, each with the instant at which it comes out; items of one instant come out first in, first out."""

    def __init__(self) -> None:
        """Start empty."""
        self._items: list[tuple[Instant, int, T]] = []
        self._count = 0

    def push(self, instant: Instant, item: T) -> None:
        """Add an item that comes out at `instant`."""
        heappush(self._items, (instant, self._count, item))
        self._count += 1

    def pop_due(self, now: Instant) -> list[T]:
        """Remove and return the items that have come out by `now`."""
        due: list[T] = []
        while self._items and self._items[0][0] <= now:
            due.append(heappop(self._items)[2])
        return due

    def next(self) -> Instant | None:
        """Return when the next item comes out, None if the queue is empty."""
        return self._items[0][0] if self._items else None

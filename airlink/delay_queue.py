"""What is on its way, in the order of arrival."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Generic, TypeVar

from airlink.clock import Instant

T = TypeVar("T")


class DelayQueue(Generic[T]):
    """Items with the instants at which they come out; of equal instants, first in is first out."""

    def __init__(self) -> None:
        """Start with nothing under way."""
        self._items: list[tuple[Instant, int, T]] = []
        self._count = 0

    def push(self, instant: Instant, item: T) -> None:
        """Let `item` come out at `instant`."""
        heappush(self._items, (instant, self._count, item))
        self._count += 1

    def pop_due(self, now: Instant) -> list[T]:
        """Return what comes out until `now`, and forget it."""
        due: list[T] = []
        while self._items and self._items[0][0] <= now:
            due.append(heappop(self._items)[2])
        return due

    def next(self) -> Instant | None:
        """Return when the next item comes out, None when nothing is under way."""
        return self._items[0][0] if self._items else None

"""Results in the order of what is wanted, by several processes or in this one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

Wanted = TypeVar("Wanted")
Found = TypeVar("Found")


def in_order(function: Callable[[Wanted], Found], wanted: Sequence[Wanted], workers: int) -> Iterator[Found]:
    """Yield what a function returns of each; one worker is this process, so that ending it leaves none behind."""
    if workers == 1:
        yield from map(function, wanted)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(function, wanted)

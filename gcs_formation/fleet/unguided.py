"""Which vehicles of the formation have had no setpoints for so long that their own failsafe shall act.

`fleet.heartbeats` withholds heartbeats from them, and `fleet.dispatch` sends them no substitute setpoints any more.
"""

from __future__ import annotations

from typing import Final

from airlink.clock import Instant, seconds_between

UNGUIDED_S: Final = 2.0
"""Longest lack of setpoints before heartbeats are withheld, so that the vehicle's failsafe acts."""


class Unguided:
    """Since when vehicles that should get setpoints have had none."""

    def __init__(self, count: int) -> None:
        """Watch `count` vehicles."""
        self._since: list[Instant | None] = [None] * count

    def update(self, index: int, *, guided: bool, now: Instant) -> None:
        """Record whether a vehicle got a setpoint, or needs none."""
        if guided:
            self._since[index] = None
        elif self._since[index] is None:
            self._since[index] = now

    def is_so(self, index: int, now: Instant) -> bool:
        """Return whether a vehicle has had no setpoints for longer than `UNGUIDED_S`."""
        since = self._since[index]
        return since is not None and seconds_between(since, now) > UNGUIDED_S

    def clear(self) -> None:
        """Forget all: none should get setpoints any more."""
        self._since = [None] * len(self._since)

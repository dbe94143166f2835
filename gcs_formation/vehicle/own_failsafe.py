"""What a vehicle does by itself when the ground station is silent, by its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

Parameters = Mapping[str, float]
"""Values by their names."""


class OwnFailsafe(NamedTuple):
    """An autopilot's failsafe for a silent ground station."""

    after_s: float
    """Time without heartbeats, or without setpoints, from which on it acts, s."""
    modes: frozenset[int]
    """The modes to which it may lead."""

    def led_to(self, mode: int | None, silent_s: float) -> bool:
        """Return whether it may have led to a mode by a silence of `silent_s`."""
        return mode in self.modes and silent_s >= self.after_s

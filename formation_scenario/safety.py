"""Limits that fail a run, to which features bring theirs."""

from __future__ import annotations

from formation_scenario.brought_keys import OpenGroup
from formation_scenario.fields import (
    Distance,
    NonNegative,
    Positive,
    key,
)
from formation_scenario.kept_distance import BUFFER_M, SEPARATION_M, KeepsDistance


class Safety(OpenGroup, group="safety"):
    """Limits that fail a run if they are violated, and the rule that prevents it."""

    separation_m: Distance = key(SEPARATION_M, "least distance of two vehicles, m", 20)
    clearance_m: NonNegative = key(5.0, "least height above ground, m", 50)
    path_distance_m: Positive = key(
        50.0, "largest distance of the leader from its path, across and in height, for longer than 10 s, m", 30
    )

    @property
    def kept_m(self) -> float:
        """Distance that vehicles are planned to keep, m: the separation limit, or what is kept in flight if more."""
        kept_m = [each.kept_m for each in self.each(KeepsDistance)]
        return max(self.separation_m, *(kept_m or [self.separation_m + BUFFER_M]))

# Compiled by mypyc: it runs every tick.

"""Stages that separate the formation vertically at its end."""

from __future__ import annotations

from gcs_formation.core.cycle import IN_COMMAND, LED, Cycle, Stage
from gcs_formation.features.ending.ending import SeparatedEnding


class EndHeights(Stage):
    """Says at which heights vehicles separate at the end of the flight, by where those are that don't respond."""

    name = "end_heights"
    when = IN_COMMAND
    after = ("delays",)

    def __init__(self) -> None:
        """Begin before the end."""
        self.heights_m: list[float] | None = None
        """(C,) heights commanded instead of the law's; NaN where there is none."""

    def run(self, cycle: Cycle) -> None:
        """Ask the ending that is under way; without one there are no heights."""
        ending = cycle.opening
        self.heights_m = None
        if ending is not None and isinstance(ending, SeparatedEnding):
            self.heights_m = ending.steer(cycle.links, cycle.now)


class AtEndHeights(Stage):
    """Replaces the law's heights by those of the end, before limits and other vehicles bound them."""

    name = "at_end_heights"
    when = LED
    after = ("law",)

    def __init__(self, chosen: EndHeights) -> None:
        """Take what chooses them."""
        self._chosen = chosen

    def run(self, cycle: Cycle) -> None:
        """Replace them if there are any."""
        heights_m = self._chosen.heights_m
        if heights_m is not None:
            cycle.controller.fly_at(cycle.tick, heights_m)

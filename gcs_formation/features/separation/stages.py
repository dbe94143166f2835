# Compiled by mypyc: it runs every tick.

"""Its stage."""

from __future__ import annotations

from airlink.clock import NANOSECONDS
from gcs_formation.core.cycle import LED, Cycle, Stage
from gcs_formation.features.separation.resolver import ConflictResolver


class Separation(Stage):
    """Replaces setpoints that don't keep vehicles apart, those that the fence has changed among them.

    It needs the states and links that setpoints were computed for.
    """

    name = "separation"
    when = LED
    after = ("filters", "height_bound", "fence")

    def __init__(self, cycle: Cycle) -> None:
        """Predict by the models in use, through the setpoints in flight."""
        controller = cycle.controller
        self.resolver = ConflictResolver(cycle.scenario, controller.history, controller.models)

    def run(self, cycle: Cycle) -> None:
        """Resolve conflicts; with a single vehicle there are none."""
        if cycle.controller.count > 1:
            separation_m = cycle.controller.plan.separation_m(cycle.now / NANOSECONDS)
            self.resolver.keep(cycle.tick, cycle.measured, separation_m)

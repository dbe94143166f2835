# Compiled by mypyc: it runs every tick.

"""Its stages."""

from __future__ import annotations

from gcs_formation.core.cycle import LED, Cycle, Stage
from gcs_formation.features.airspace.airspace import FenceLimits, HeightFloor


class FenceStage(Stage):
    """Keeps setpoints inside the fence, before the separation rule: vehicles that turn away may meet."""

    name = "fence"
    when = LED
    after = ("filters", "height_bound")

    def __init__(self, cycle: Cycle) -> None:
        """Bound by the fence of the scenario, with turns by the models in use."""
        self.limits = FenceLimits(cycle.scenario, cycle.controller.models)

    def run(self, cycle: Cycle) -> None:
        """Replace setpoints that lead out."""
        self.limits.keep(cycle.tick)


class GroundStage(Stage):
    """Keeps heights above the ground, last of all that changes setpoints: no rule may send a vehicle into it."""

    name = "ground"
    when = LED
    after = ("filters", "fence", "separation")

    def __init__(self, cycle: Cycle) -> None:
        """Bound by the terrain of the scenario, with climbs by the models in use."""
        self.floor = HeightFloor(cycle.scenario, cycle.controller.models)

    def run(self, cycle: Cycle) -> None:
        """Replace heights below it."""
        self.floor.keep(cycle.tick)

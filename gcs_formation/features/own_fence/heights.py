# Compiled by mypyc: it runs every tick.

"""Keeps commanded heights within the geofences that vehicles have themselves, by their parameters.

Beyond its fence a vehicle goes home by itself, out of the formation and through it. A path or slots that need more are
refused before take-off (`features/preflight`); this bounds what changes, orders, the law and the end command.
"""

from __future__ import annotations

from flight_model.autopilot_model import within
from gcs_formation.core.cycle import LED, Cycle, Stage


class OwnFences(Stage):
    """Bounds heights by the vehicles' fences, before the separation rule and the ground, which may need others."""

    name = "own_fence"
    when = LED
    after = ("filters", "height_bound", "fence")

    def __init__(self, cycle: Cycle) -> None:
        """Take the vehicles."""
        self._vehicles = cycle.each

    def run(self, cycle: Cycle) -> None:
        """Replace heights beyond them."""
        tick = cycle.tick
        for vehicle in self._vehicles:
            heights_m = vehicle.autopilot.heights_m
            if heights_m is None or not tick.active[vehicle.index]:
                continue
            speed_mps, heading_rad, height_m = tick.setpoints[vehicle.index]
            tick.replace(vehicle.index, (speed_mps, heading_rad, within(height_m, heights_m[0], heights_m[1])))

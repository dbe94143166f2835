# Compiled by mypyc: it runs every tick.

"""Its stages: what isn't true of a sample is taken out of it."""

from __future__ import annotations

import math

from gcs_formation.core.cycle import IN_COMMAND, Cycle, Stage
from gcs_formation.features.telemetry_health.monitor import TelemetryHealth


class Examined(Stage):
    """Takes out of the newest samples what can't be true, before the filters take them."""

    name = "telemetry_health"
    when = IN_COMMAND
    after = ("samples",)

    def __init__(self, health: TelemetryHealth) -> None:
        """Take what examines."""
        self._health = health

    def run(self, cycle: Cycle) -> None:
        """Examine each."""
        leader, commanded, samples = cycle.controller.plan.leader, cycle.last_tick, cycle.samples
        if commanded is not None and not commanded.slots_left:
            self._health.slots_m = commanded.slots_m
        for vehicle in cycle.each:
            index = vehicle.index
            height_m = math.nan if commanded is None or not commanded.active[index] else commanded.setpoints[index][2]
            leads = index == leader
            samples[index] = self._health.examine(index, samples[index], height_m, cycle.now, leads=leads)


class RestartForgotten(Stage):
    """Forgets what was known of vehicles that have just restarted."""

    name = "telemetry_health_forgotten"
    after = ("restarts",)

    def __init__(self, health: TelemetryHealth) -> None:
        """Take what examines."""
        self._health = health

    def run(self, cycle: Cycle) -> None:
        """Forget it."""
        for index in cycle.restarted:
            self._health.forget(index)

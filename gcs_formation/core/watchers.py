# ruff: noqa: D101, D102, D103
"""Stages that watch."""

from __future__ import annotations

import math

from gcs_formation.core.cycle import IN_COMMAND, Cycle, Stage
from gcs_formation.telemetry_health.monitor import TelemetryHealth


class Health(Stage):
    name = "telemetry_health"
    when = IN_COMMAND
    after = ("samples",)

    def __init__(self, health: TelemetryHealth) -> None:
        self.health = health

    def run(self, cycle: Cycle) -> None:
        leader, commanded, samples = cycle.controller.plan.leader, cycle.last_tick, cycle.samples
        for vehicle in cycle.each:
            column = vehicle.column
            height_m = math.nan if commanded is None or not commanded.active[column] else commanded.setpoints[column][2]
            leads = column == leader
            samples[column] = self.health.examine(column, samples[column], height_m, cycle.now, leads=leads)


class ForgetHealth(Stage):
    name = "telemetry_health_forgets"
    after = ("restarts",)

    def __init__(self, health: TelemetryHealth) -> None:
        self._health = health

    def run(self, cycle: Cycle) -> None:
        for column in cycle.restarted:
            self._health.forget(column)


def watchers(cycle: Cycle) -> list[Stage]:
    controller = cycle.controller
    health = TelemetryHealth(cycle.vehicles, controller.estimator.filters, controller.models, cycle.note)
    return [Health(health), ForgetHealth(health)]

# ruff: noqa: D101, D102, D103
"""Stages that watch."""

from __future__ import annotations

import math

from airlink.clock import NANOSECONDS
from gcs_formation.core.cycle import EACH_SECOND, IN_COMMAND, LED, Cycle, Stage
from gcs_formation.estimation.estimator import heading_shown
from gcs_formation.from_scenario import lag_estimator
from gcs_formation.separation.airspace import FenceLimits, HeightFloor
from gcs_formation.separation.resolver import ConflictResolver
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


class Seen(Stage):
    name = "motion_seen"
    when = IN_COMMAND
    after = ("estimates",)

    def __init__(self, cycle: Cycle) -> None:
        self.lags = lag_estimator(cycle.scenario, cycle.controller.history, cycle.controller.models)

    def run(self, cycle: Cycle) -> None:
        filters = cycle.controller.estimator.filters
        for column, sample in enumerate(cycle.samples):
            if sample is not None:
                state, heading_rad = filters[column].state, sample.heading_rad
                if sample.by_course and state is not None:
                    heading_rad = heading_shown(state, sample.north_mps, sample.east_mps)
                motion = sample.airspeed_mps, heading_rad, sample.height_m, sample.climb_mps
                self.lags.hear(column, sample.stamp, motion)


class Learn(Stage):
    name = "time_constants"
    when = IN_COMMAND
    after = ("tick",)

    def __init__(self, seen: Seen) -> None:
        self._lags = seen.lags

    def run(self, cycle: Cycle) -> None:
        active, links = cycle.tick.active, cycle.links
        self._lags.learn([active[column] and not links[column].disobeying for column in range(len(active))])


class Misfit(Stage):
    name = "time_constants_off"
    when = EACH_SECOND
    after = ("own_parts",)

    def __init__(self, seen: Seen) -> None:
        self._lags = seen.lags

    def run(self, cycle: Cycle) -> None:
        cycle.findings.lags_off = self._lags.misfit


class Fence(Stage):
    name = "fence"
    when = LED
    after = ("filters", "height_bound")

    def __init__(self, cycle: Cycle) -> None:
        self.limits = FenceLimits(cycle.scenario, cycle.controller.models)

    def run(self, cycle: Cycle) -> None:
        self.limits.keep(cycle.tick)


class Separation(Stage):
    name = "separation"
    when = LED
    after = ("filters", "fence")

    def __init__(self, cycle: Cycle) -> None:
        controller = cycle.controller
        self.resolver = ConflictResolver(cycle.scenario, controller.history, controller.models)

    def run(self, cycle: Cycle) -> None:
        if cycle.controller.columns > 1:
            apart_m = cycle.controller.plan.apart_m(cycle.now / NANOSECONDS)
            self.resolver.keep(cycle.tick, cycle.measured, apart_m)


class Ground(Stage):
    name = "ground"
    when = LED
    after = ("filters", "separation")

    def __init__(self, cycle: Cycle) -> None:
        self.floor = HeightFloor(cycle.scenario, cycle.controller.models)

    def run(self, cycle: Cycle) -> None:
        self.floor.keep(cycle.tick)


def watchers(cycle: Cycle) -> list[Stage]:
    controller = cycle.controller
    health = TelemetryHealth(cycle.vehicles, controller.estimator.filters, controller.models, cycle.note)
    seen = Seen(cycle)
    return [
        Misfit(seen),
        Health(health),
        ForgetHealth(health),
        seen,
        Learn(seen),
        Fence(cycle),
        Separation(cycle),
        Ground(cycle),
    ]

# Compiled by mypyc: it runs every tick.

"""Bounds commanded heights by those of path and slot, whatever a vehicle says of its own height.

Setpoints stay within what a vehicle reaches soon of where it says that it is. One that says 14 m too much, more than
that reach, would be commanded to climb, say so, and be commanded higher still.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from flight_model.autopilot_model import within
from flight_model.slot import Vector3
from gcs_formation.core.cycle import LED, Cycle, Stage
from gcs_formation.recorder import Tick

BOUND_M: Final = 15.0
"""How far above or below its path and slot a vehicle may be commanded, m: more than the 12 m that a small fixed wing
reaches in its time constants, so that no flight by true heights is changed. Tuned: m; 12 to 30; shown by `pytest
tests/gcs_formation/features/height_bound`."""


class HeightBound(Stage):
    """Keeps heights near those that the plan has for each vehicle, or between these and where it joined.

    After filters from outside, before fence, separation and ground: these may need other heights than the plan's.
    """

    name = "height_bound"
    when = LED
    after = ("filters",)

    def __init__(self, cycle: Cycle) -> None:
        """Take the models' climb limits, and the time from tick to tick."""
        self._models, self._dt_s = cycle.controller.models, 1.0 / cycle.scenario.law.rate_hz
        self._joined_m = [math.nan] * len(self._models)
        """From where each may still be on its way to its slot; NaN of those that aren't commanded."""

    def run(self, cycle: Cycle) -> None:
        """Bound heights on the path: before, vehicles join up at heights of their own."""
        controller = cycle.controller
        if controller.fault is None and cycle.tick.mission_time_s >= 0.0:
            self.keep(cycle.tick, controller.leader_m, controller.slots_m)

    def keep(self, tick: Tick, leader_m: float, slots_m: Sequence[Vector3]) -> None:
        """Bound a tick's heights.

        Args:
            tick: with the law's setpoints.
            leader_m: height of the leader's path, ahead by what a climb's time constants take.
            slots_m: (C,) forward, right and up; empty before there are any, the leader's isn't used.
        """
        for index, setpoint in enumerate(tick.setpoints):
            if not tick.active[index] or tick.slots_left or not slots_m:
                self._joined_m[index] = math.nan
                continue
            planned_m = leader_m if index == tick.leader else leader_m + slots_m[index][2]
            if math.isnan(planned_m) or math.isnan(setpoint[2]):
                continue
            from_m = self._from_m(index, planned_m, tick.state[index].height_m)
            height_m = within(setpoint[2], min(from_m, planned_m) - BOUND_M, max(from_m, planned_m) + BOUND_M)
            if height_m != setpoint[2]:
                tick.replace(index, (setpoint[0], setpoint[1], height_m))

    def _from_m(self, index: int, planned_m: float, height_m: float) -> float:
        """Return where a vehicle comes from: where it was when it joined, moved to its plan at its climb limit."""
        from_m, step_m = self._joined_m[index], self._models[index].climb_max_mps * self._dt_s
        from_m = height_m if math.isnan(from_m) else from_m + within(planned_m - from_m, -step_m, step_m)
        self._joined_m[index] = from_m
        return from_m

# Compiled by mypyc: it runs every tick.

"""Watches every follower's lateral error, and says what a limit cycle is likely to come from."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS
from gcs_formation.core.cycle import LED, Cycle, Stage
from gcs_formation.features.limit_cycle.answer import Answer
from gcs_formation.features.limit_cycle.swings import Swings
from gcs_formation.recorder import Detail, Tick
from gcs_formation.vehicle.vehicle import Vehicle

RIGHT: Final = 1
LATE_S: Final = 0.1
"""An answer that is so much later than the model's is named as the cause. Tuned: s; 0.05 to 0.3; shown by `pytest
tests/gcs_formation/features/limit_cycle`."""
NEAR: Final = 0.8
"""Share of its delay margin from which a loop's delay is named. Tuned: share; 0.7 to 1; shown by `pytest
tests/gcs_formation/features/limit_cycle`."""


class LimitCycles(Stage):
    """Watches the errors of the tick, which filters and other vehicles may have had replaced: those don't count."""

    name = "limit_cycles"
    when = LED
    after = ("final",)

    def __init__(self, cycle: Cycle) -> None:
        """Begin without swings."""
        count = cycle.controller.count
        self._swings = [Swings() for _ in range(count)]
        self._answers = [Answer() for _ in range(count)]
        self._named = [False] * count

    def run(self, cycle: Cycle) -> None:
        """Take the errors of this tick, and say who begins or ends to swing."""
        tick = cycle.tick
        for vehicle in cycle.each:
            index = vehicle.index
            error_m = tick.error_of(index)[RIGHT]
            if math.isnan(error_m) or tick.yielding[index] or tick.replaced[index][RIGHT]:
                self._swings[index].clear()
                self._answers[index].clear()
                continue
            self._swings[index].add(tick.now / NANOSECONDS, error_m)
            self._take_answer(cycle, tick, index)
            self._judge(cycle, vehicle)

    def _take_answer(self, cycle: Cycle, tick: Tick, index: int) -> None:
        seen, link = cycle.controller.estimator.filters[index], tick.links[index]
        state, uplink_s = seen.state, link.uplink_delay_s
        if state is not None and not math.isnan(uplink_s):
            acts_s = tick.now / NANOSECONDS + uplink_s + link.further_delay_s
            self._answers[index].add(acts_s, tick.setpoints[index][1], seen.stamp / NANOSECONDS, state.heading_rad)

    def _judge(self, cycle: Cycle, vehicle: Vehicle) -> None:
        index = vehicle.index
        swings, now_s = self._swings[index], cycle.now / NANOSECONDS
        steady = swings.steady(now_s, still=self._named[index])
        if steady == self._named[index]:
            return
        self._named[index] = steady
        if not steady:
            cycle.log_event(cycle.now, "limit_cycle", "no longer swings about its slot", vehicle, {"begins": False})
            return
        amplitude_m, period_s = swings.amplitude_m, swings.period_s
        late_s = self._answers[index].late_s(period_s, cycle.controller.models[index].tau_psi_s)
        text = f"swings about its slot by {amplitude_m:.1f} m to either side, every {period_s:.1f} s: "
        details: dict[str, Detail] = {"begins": True, "amplitude_m": amplitude_m, "period_s": period_s}
        details["late_s"] = None if math.isnan(late_s) else late_s
        text += _cause(late_s, cycle.findings.margin_used[index])
        cycle.log_event(cycle.now, "limit_cycle", text, vehicle, details)


def _cause(late_s: float, margin_used: float) -> str:
    """Return what it is likely to come from; either figure may be NaN, unknown."""
    if margin_used >= NEAR:
        return f"its loops use {margin_used:.0%} of their delay margin, so its link is too slow for the gains"
    if late_s >= LATE_S:
        return (
            f"it answers headings {late_s:.2f} s later than its model says, by a dead time that the model hasn't "
            "(dead_time_s; `identify` finds it), or by a machine that is held up; lower gains bear more"
        )
    return "its model seems right, so gains are too high for it (`law.gains: auto` designs them)"

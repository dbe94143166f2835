# Compiled by mypyc: it runs every tick.

"""Bounds the leader's speed, and lets slots wait, so that every multirotor has some speed left to correct with."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import Instant, seconds_between
from gcs_formation.core.cycle import LED, Cycle, Stage
from gcs_formation.features.saturation.reached_speed import CHECK_S, ReachedSpeed
from gcs_formation.recorder import Detail
from gcs_formation.vehicle.vehicle import Vehicle

RESERVE_MPS: Final = 0.5
"""Speed that each is left, below its limit. Tuned: m/s; 0.3 to 1; shown by `pytest
tests/gcs_formation/features/saturation`."""
SLOWS_MPS2: Final = 2.0
"""How fast the leader's bound falls. Tuned: m/s²; 0.5 to 2.5; shown by `pytest
tests/gcs_formation/features/saturation`."""
RESUMES_MPS2: Final = 0.3
"""How fast it rises. Tuned: m/s²; 0.1 to 0.5; shown by `pytest tests/gcs_formation/features/saturation`."""
MIN_MPS: Final = 1.0
"""The leader isn't bounded to less: a formation that is to hover has no slots to fly to. Tuned: m/s; 0.5 to 2; by
judgement."""
OVER_MPS: Final = 2.0
"""Once it may be so much faster than it wants to be, the leader isn't bounded any more. Tuned: m/s; 1 to 4; by
judgement."""
WAITS_M: Final = 0.5
"""Error from which on slots wait for a follower as long as any has a limit. Tuned: m; 0.3 to 2; shown by `pytest
tests/gcs_formation/features/saturation`."""
BEYOND_MPS: Final = 1.0
"""By how much more than its limit each may be commanded: enough to see that it still can't. Tuned: m/s; 0.6 to 2; shown
by `pytest tests/gcs_formation/features/saturation`."""
QUIET_S: Final = 20.0
"""Time without saturation after which an event says so. Tuned: s; 10 to 60; shown by `pytest
tests/gcs_formation/features/saturation`."""


class SpeedReserve(Stage):
    """Compares the law's setpoints with what each vehicle reaches, and bounds the leader's speed of the next tick.

    Behind the law: what a filter, the fence or the separation rule asks of a vehicle isn't for the leader to wait for.
    """

    name = "speed_reserve"
    when = LED
    after = ("law",)

    def __init__(self, cycle: Cycle) -> None:
        """Begin without limits."""
        self._reached = [ReachedSpeed(each.speed_max_mps) for each in cycle.controller.models]
        self._named: list[Instant | None] = [None] * cycle.controller.count
        """When each was saturated last, of those that an event has named."""
        self._stamps = [0] * cycle.controller.count
        """When each was as it was checked last: a sample counts once."""
        self._checked: Instant | None = None
        self._dt_s, self._max_mps = 1.0 / cycle.scenario.law.rate_hz, math.inf

    def run(self, cycle: Cycle) -> None:
        """Check each vehicle now and then, and bound the leader."""
        if self._checked is None or seconds_between(self._checked, cycle.now) >= CHECK_S:
            self._checked = cycle.now
            for vehicle in cycle.each:
                self._check(cycle, vehicle)
        leader_mps = cycle.tick.setpoints[cycle.tick.leader][0]
        excess_mps = self._excess_mps(cycle)
        if excess_mps > 0.0:
            due_mps = max(min(self._max_mps, leader_mps) - excess_mps, MIN_MPS)
            self._max_mps = max(due_mps, min(self._max_mps, leader_mps) - SLOWS_MPS2 * self._dt_s)
        elif self._max_mps < math.inf:
            self._max_mps += RESUMES_MPS2 * self._dt_s
            if self._max_mps > leader_mps + OVER_MPS:
                self._max_mps = math.inf
        cycle.controller.bound_leader(self._max_mps)
        limited = any([each.max_mps < math.inf for each in self._reached])  # noqa: C419 - compiled, a list costs less
        cycle.controller.wait_from(WAITS_M if limited else math.inf)

    def _check(self, cycle: Cycle, vehicle: Vehicle) -> None:
        """Compare what a vehicle flies with what it was commanded then."""
        controller, index = cycle.controller, vehicle.index
        reached, seen = self._reached[index], controller.estimator.filters[index]
        if seen.state is None or not cycle.tick.active[index]:
            reached.pause()
        elif seen.stamp != self._stamps[index]:
            self._stamps[index] = seen.stamp
            speed_mps, heading_rad, _ = controller.history.commanded(seen.stamp, index)
            commanded = speed_mps * math.cos(heading_rad), speed_mps * math.sin(heading_rad)
            reached.check(commanded, seen.state.ground_mps())
            self._name(cycle, vehicle, speed_mps)
        cycle.findings.saturated[index] = reached.saturated
        controller.bound_speed(index, reached.max_mps + BEYOND_MPS)

    def _excess_mps(self, cycle: Cycle) -> float:
        """Return by how much the law's setpoint of any vehicle is faster than it should be, m/s."""
        excess_mps, tick = -math.inf, cycle.tick
        for index, reached in enumerate(self._reached):
            if tick.active[index]:
                excess_mps = max(excess_mps, tick.setpoints[index][0] - (reached.max_mps - RESERVE_MPS))
        return excess_mps

    def _name(self, cycle: Cycle, vehicle: Vehicle, commanded_mps: float) -> None:
        """Say when a vehicle begins to be saturated, and when it hasn't been for a while."""
        index, now = vehicle.index, cycle.now
        reached, since = self._reached[index], self._named[index]
        if reached.saturated:
            self._named[index] = now
            if since is None:
                mps = reached.max_mps
                text = f"flies {mps:.1f} m/s over ground, commanded {commanded_mps:.1f}: all that it reaches at present"
                details: dict[str, Detail] = {"begins": True, "speed_mps": mps, "commanded_mps": commanded_mps}
                cycle.log_event(now, "saturated", f"{text}; the leader leaves it {RESERVE_MPS:g} m/s", vehicle, details)
        elif since is not None and seconds_between(since, now) > QUIET_S:
            self._named[index] = None
            cycle.log_event(now, "saturated", "reaches its commanded speed again", vehicle, {"begins": False})

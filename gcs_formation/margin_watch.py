"""The measured delays held against the delay margin, in flight."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from airlink.identity import VehicleId
from formation_scenario import Scenario
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.stability import loop_delay_s, predicted_mismatch_margin, scenario_delay_margin, scenario_loops

NEAR = 0.8
"""Share of the margin from which it's said."""
CLEAR = 0.7
"""Share below which that's over."""
STEP_S = 0.05
"""Mismatch margins are computed for whole multiples of this delay."""
DEVIATIONS = 2.0
"""How many standard deviations of the round trip a mismatch is taken to be."""


@dataclass
class MarginWatch:
    """How much of the margin each follower's loop uses.

    Without prediction: the loop's whole delay (round trip, sampling and hold) against the delay margin. With
    prediction: how far the delay scatters about the value that the prediction bridges, against the mismatch that the
    predicted loop stands there.
    """

    scenario: Scenario
    near: set[VehicleId] = field(default_factory=set[VehicleId])
    """Followers that use more than `NEAR` of it."""
    most_used: float = 0.0
    _mismatch: dict[int, float] = field(default_factory=dict[int, float])
    _margin_s: float = math.nan

    def used(self, clock: ClockSync) -> float:
        """Return the share of the margin that a follower's loop uses, NaN before its delay is known."""
        delay_s, law = clock.one_way_s, self.scenario.law
        loop_s = loop_delay_s(delay_s, delay_s, 0.0, self.scenario.telemetry.rate_hz, law.rate_hz)
        if math.isnan(loop_s):
            return math.nan
        if law.delay_compensation and law.type != "consensus":
            return DEVIATIONS * clock.scatter_s / self._mismatch_s(loop_s)
        if math.isnan(self._margin_s):
            self._margin_s = scenario_delay_margin(self.scenario)
        return loop_s / self._margin_s if self._margin_s > 0 else math.inf

    def look(self, vehicle: VehicleId, clock: ClockSync) -> tuple[float, bool]:
        """Return the share that a follower uses, and whether it has just come near the margin or away from it."""
        used = self.used(clock)
        self.most_used = max(self.most_used, used if math.isfinite(used) else 0.0)
        if used >= NEAR and vehicle not in self.near:
            self.near.add(vehicle)
            return used, True
        if used < CLEAR and vehicle in self.near:
            self.near.remove(vehicle)
            return used, True
        return used, False

    def _mismatch_s(self, loop_s: float) -> float:
        step = round(loop_s / STEP_S)
        if step not in self._mismatch:
            loops = scenario_loops(self.scenario)
            self._mismatch[step] = min(predicted_mismatch_margin(loop, step * STEP_S).least() for loop in loops)
        return self._mismatch[step]

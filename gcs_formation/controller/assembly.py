"""When the formation is assembled, so that its path may begin."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import Instant, seconds_between
from formation_scenario import Scenario
from formation_scenario.slot_assignment import ids_by_index
from gcs_formation.guidance.leader_guidance import LeaderGuidance
from gcs_formation.recorder import Event, Tick

ASSEMBLED_S: Final = 2.0
"""How long followers must stay in their slots to count as assembled."""
HYSTERESIS: Final = 2.0
"""Multiple of the tolerance within which an assembled formation stays so on the straight before the path.

Positions of two real vehicles drift against each other by a metre or more within half a minute.
"""


class Assembly:
    """Watches the followers of a formation until its path begins."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin with a formation that isn't assembled; `start.tolerance_m` says how near is in a slot."""
        self._tolerance_m, self._dt_s = scenario.start.tolerance_m, 1.0 / scenario.law.rate_hz
        self._identities = ids_by_index(scenario)
        self._in_slots_s = 0.0
        self._patterns = 0
        self._below_m = 0.0
        """How far the leader was below its path."""
        self._missed: int | None = None
        self._missed_m = math.nan
        self._missed_at = Instant(0)
        """The last follower that wasn't in its slot, its largest error, NaN if it isn't a member, and when."""

    @property
    def complete(self) -> bool:
        """Whether every follower has been in its slot for a while."""
        return self._in_slots_s >= ASSEMBLED_S

    def begin_again(self) -> None:
        """Forget what was seen: there is no leader to follow."""
        self._in_slots_s = 0.0

    def assess(self, tick: Tick, guidance: LeaderGuidance, *, slots_rest: bool) -> None:
        """Judge a tick, and report a holding pattern that has just begun; `slots_rest`: slots keep their places."""
        if guidance.rounds > self._patterns:
            self._patterns = guidance.rounds
            self._report_pattern(tick)
        max_m = self._tolerance_m * (HYSTERESIS if guidance.on_path and self.complete else 1.0)
        within = self._at_height(max_m, tick, guidance) and slots_rest and self._all_within(max_m, tick)
        self._in_slots_s = self._in_slots_s + self._dt_s if within else 0.0

    def _report_pattern(self, tick: Tick) -> None:
        vehicle, ago_s = None, seconds_between(self._missed_at, tick.now)
        why = f"its followers have not kept their slots for {ASSEMBLED_S:g} s yet"
        if self._below_m > self._tolerance_m:
            why = f"it is {self._below_m:.0f} m below the start of its path"
        elif self._missed is not None and ago_s <= ASSEMBLED_S:
            vehicle = self._identities[self._missed]
            off = "was no member" if math.isnan(self._missed_m) else f"was {self._missed_m:.1f} m from its slot"
            why = f"vehicle {vehicle} {off} {ago_s:.1f} s ago; allowed: {self._tolerance_m:g} m (start.tolerance_m)"
        text = f"the leader flies a holding pattern: {why}"
        tick.events.append(Event(tick.now, "lap", text, vehicle, {"laps": self._patterns}))

    def _at_height(self, max_m: float, tick: Tick, guidance: LeaderGuidance) -> bool:
        """Return whether the leader isn't below its path still, as after a take-off that led it there too soon."""
        leader, route = tick.virtual_leader or tick.state[tick.leader], guidance.route
        height_m = leader.height_m if route is None else route.at(guidance.distance_m).height_m
        self._below_m = height_m - leader.height_m
        return self._below_m < max_m

    def _all_within(self, max_m: float, tick: Tick) -> bool:
        for index in range(len(self._identities)):
            x_m, y_m, z_m = tick.error_of(index)
            if index != tick.leader and not (abs(x_m) < max_m and abs(y_m) < max_m and abs(z_m) < max_m):
                self._missed, self._missed_m, self._missed_at = index, max(abs(x_m), abs(y_m), abs(z_m)), tick.now
                return False
        return True

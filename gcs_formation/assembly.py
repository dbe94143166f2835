"""Whether the formation is assembled, so that the leader may begin the path."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import Instant, seconds_between
from formation_scenario import Scenario
from formation_scenario.slot_assignment import column_ids
from gcs_formation.guidance.leader_guidance import LeaderGuidance
from gcs_formation.recorder import Event, Tick

ASSEMBLED_S: Final = 2.0
"""How long followers must stay in their slots to count as assembled."""
KEEPS: Final = 2.0
"""Multiple of the tolerance within which an assembled formation stays so on the straight before the path.

Positions of two real vehicles drift against each other by a metre or more within half a minute.
"""


class Assembly:
    """Watches the followers of a formation until its path begins."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin with a formation that isn't assembled; `start.tolerance_m` says how near is in a slot."""
        self._tolerance_m, self._dt_s = scenario.start.tolerance_m, 1.0 / scenario.law.rate_hz
        self._identities = column_ids(scenario)
        self._in_slots_s = 0.0
        self._laps = 0
        self._missed: int | None = None
        self._missed_m = math.nan
        self._missed_at = Instant(0)
        """The last follower that wasn't in its slot, its largest error, NaN if it isn't a member, and when."""

    @property
    def complete(self) -> bool:
        """Whether every follower has been in its slot for a while."""
        return self._in_slots_s >= ASSEMBLED_S

    def begin_anew(self) -> None:
        """Forget what was seen: there is no leader to follow."""
        self._in_slots_s = 0.0

    def judge(self, tick: Tick, guidance: LeaderGuidance, *, slots_rest: bool) -> None:
        """Judge a tick, and report a lap that its leader has just begun; `slots_rest`: the slots keep their places."""
        if guidance.rounds > self._laps:
            self._laps = guidance.rounds
            self._report_lap(tick)
        most_m = self._tolerance_m * (KEEPS if guidance.on_path and self.complete else 1.0)
        self._in_slots_s = self._in_slots_s + self._dt_s if slots_rest and self._all_within(most_m, tick) else 0.0

    def _report_lap(self, tick: Tick) -> None:
        vehicle, ago_s = None, seconds_between(self._missed_at, tick.now)
        why = f"its followers have not kept their slots for {ASSEMBLED_S:g} s yet"
        if self._missed is not None and ago_s <= ASSEMBLED_S:
            vehicle = self._identities[self._missed]
            off = "was no member" if math.isnan(self._missed_m) else f"was {self._missed_m:.1f} m from its slot"
            why = f"vehicle {vehicle} {off} {ago_s:.1f} s ago; allowed: {self._tolerance_m:g} m (start.tolerance_m)"
        text = f"the leader flies a lap: {why}"
        tick.events.append(Event(tick.now, "lap", text, vehicle, {"laps": self._laps}))

    def _all_within(self, most_m: float, tick: Tick) -> bool:
        for column in range(len(self._identities)):
            x_m, y_m, z_m = tick.error_of(column)
            if column != tick.leader and not (abs(x_m) < most_m and abs(y_m) < most_m and abs(z_m) < most_m):
                self._missed, self._missed_m, self._missed_at = column, max(abs(x_m), abs(y_m), abs(z_m)), tick.now
                return False
        return True

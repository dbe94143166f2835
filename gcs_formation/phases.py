"""The phases of a run: a table of all transitions, and when the formation is assembled, so that the path may begin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

from airlink.clock import Instant, seconds_between
from formation_scenario import Scenario
from formation_scenario.orders import End
from formation_scenario.slot_assignment import ids_by_index
from gcs_formation.guidance.leader_guidance import LeaderGuidance
from gcs_formation.recorder import Event, Tick


class Phase(Enum):
    """Phase of a run."""

    CONNECTING = "connecting"
    ASSEMBLING = "assembling"
    FLYING = "flying"
    ENDING = "ending"
    LOITERING = "loitering"
    DONE = "done"
    FAILED = "failed"


class Cause(Enum):
    """Causes of a transition."""

    REHEARSED = "everything but commands has been done"
    CALLED_OFF = "ended before any vehicle was commanded"
    NOT_BEGUN = "the run can't go on, and no vehicle was commanded"
    LEADER_READY = "the leader follows setpoints"
    PATH_BEGUN = "the leader has passed the start of its path"
    PATH_ENDED = "the path or the time is at its end"
    STOP = "ordered to stop"
    IMMEDIATE_RETURN = "ordered to go home at once"
    ORDERED = "ordered to end"
    OPENED = "every vehicle that receives has a height of its own or hovers, or time is up"
    LOITERED = "every vehicle that is heard loiters"
    HOMEWARD = "every vehicle that is heard flies home or circles there"
    LANDED = "every vehicle that is heard has landed"
    FAILURE = "the run can't go on"
    NOT_ALL_LOITERED = "not every vehicle loiters, or has acknowledged that it does, and the time for that is over"
    NOT_ALL_HOMEWARD = "not every vehicle goes home, or has acknowledged that it does, and the time for that is over"
    NOT_ALL_LANDED = (
        "not every vehicle has landed, or has acknowledged what it was commanded, and the time for that is over"
    )
    GIVEN_UP = "the run can't go on, and vehicles were commanded to loiter"


TRANSITIONS: dict[tuple[Phase, Cause], Phase] = {
    (Phase.CONNECTING, Cause.LEADER_READY): Phase.ASSEMBLING,
    (Phase.CONNECTING, Cause.REHEARSED): Phase.DONE,
    (Phase.CONNECTING, Cause.CALLED_OFF): Phase.DONE,
    (Phase.CONNECTING, Cause.NOT_BEGUN): Phase.FAILED,
    (Phase.CONNECTING, Cause.STOP): Phase.LOITERING,
    (Phase.CONNECTING, Cause.ORDERED): Phase.LOITERING,
    (Phase.CONNECTING, Cause.FAILURE): Phase.LOITERING,
    (Phase.ASSEMBLING, Cause.PATH_BEGUN): Phase.FLYING,
    (Phase.ASSEMBLING, Cause.PATH_ENDED): Phase.ENDING,
    (Phase.ASSEMBLING, Cause.STOP): Phase.ENDING,
    (Phase.ASSEMBLING, Cause.ORDERED): Phase.ENDING,
    (Phase.ASSEMBLING, Cause.FAILURE): Phase.ENDING,
    (Phase.FLYING, Cause.PATH_ENDED): Phase.ENDING,
    (Phase.FLYING, Cause.STOP): Phase.ENDING,
    (Phase.FLYING, Cause.ORDERED): Phase.ENDING,
    (Phase.FLYING, Cause.FAILURE): Phase.ENDING,
    (Phase.ENDING, Cause.ORDERED): Phase.ENDING,
    (Phase.ENDING, Cause.OPENED): Phase.LOITERING,
    (Phase.ENDING, Cause.IMMEDIATE_RETURN): Phase.LOITERING,
    (Phase.LOITERING, Cause.IMMEDIATE_RETURN): Phase.LOITERING,
    (Phase.LOITERING, Cause.ORDERED): Phase.LOITERING,
    (Phase.LOITERING, Cause.LOITERED): Phase.DONE,
    (Phase.LOITERING, Cause.HOMEWARD): Phase.DONE,
    (Phase.LOITERING, Cause.LANDED): Phase.DONE,
    (Phase.LOITERING, Cause.NOT_ALL_LOITERED): Phase.DONE,
    (Phase.LOITERING, Cause.NOT_ALL_HOMEWARD): Phase.DONE,
    (Phase.LOITERING, Cause.NOT_ALL_LANDED): Phase.DONE,
    (Phase.LOITERING, Cause.GIVEN_UP): Phase.FAILED,
}
"""All other combinations change nothing."""

ALL_ENDED: Final[dict[End, Cause]] = {"loiter": Cause.LOITERED, "rtl": Cause.HOMEWARD, "land": Cause.LANDED}
NOT_ALL_ENDED: Final[dict[End, Cause]] = {
    "loiter": Cause.NOT_ALL_LOITERED,
    "rtl": Cause.NOT_ALL_HOMEWARD,
    "land": Cause.NOT_ALL_LANDED,
}
"""Cause of a run's end by the way it was to end: all vehicles do so, or the time for that is over."""
BEFORE_COMMANDS: Final = {Cause.STOP: Cause.CALLED_OFF, Cause.ORDERED: Cause.CALLED_OFF, Cause.FAILURE: Cause.NOT_BEGUN}
"""Replacement of a cause before vehicles may be commanded: they are left as found."""
NONE_COMMANDED: Final = (Cause.REHEARSED, *BEFORE_COMMANDS.values())
"""Causes of an end before any vehicle was commanded."""
COMMANDED: Final = (Phase.ASSEMBLING, Phase.FLYING, Phase.ENDING)
"""Phases in which the law and the separation rule command the formation."""
OVER: Final = (Phase.ENDING, Phase.LOITERING)
"""Phases in which no vehicle is started any more."""
ASSEMBLED_S: Final = 2.0
"""How long followers must stay in their slots to count as assembled."""
HYSTERESIS: Final = 2.0
"""Multiple of the tolerance within which an assembled formation stays so on the straight before the path.

Positions of two real vehicles drift against each other by a metre or more within half a minute.
"""


@dataclass
class Flight:
    """The phase of a run, its beginning, the instant of t = 0, and when the flight along the path ended."""

    phase: Phase = Phase.CONNECTING
    since: Instant = Instant(0)
    path_began: Instant | None = None
    path_ended: Instant | None = None

    def move(self, cause: Cause, now: Instant) -> bool:
        """Apply the table; return whether there is such a transition."""
        following = TRANSITIONS.get((self.phase, cause))
        if following is None:
            return False
        if self.phase is Phase.FLYING:
            self.path_ended = now
        self.phase, self.since = following, now
        if cause is Cause.PATH_BEGUN and self.path_began is None:
            self.path_began = now
        return True

    def resume(self, at: Instant, path_began: Instant | None) -> None:
        """Resume an interrupted flight."""
        self.since, self.path_began = at, path_began

    def mission_time_s(self, now: Instant) -> float:
        """Return seconds since the leader started along its path, NaN before."""
        return float("nan") if self.path_began is None else seconds_between(self.path_began, now)

    @property
    def ended(self) -> bool:
        """Whether the run is over."""
        return self.phase in (Phase.DONE, Phase.FAILED)


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

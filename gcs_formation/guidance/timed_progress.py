"""The leader's progress along a path with stops, by its timetable.

Between two stops it is led to where it is due: a speed as a function of the distance would never leave a standstill,
and would end in one only after infinite time. A leader that is too far from where it is due, as after an outage or when
it takes the lead, is due where it is.

Only the part of the path up to the next stop is its route, and straight on from there: at a stop the course jumps, and
the nearest point of the whole could lie on either leg.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

from airlink.clock import Instant, after, seconds_between
from flight_model.path import Route
from flight_model.stops.timetable import SETTLE_S, Passage, Pause, Timetable
from flight_model.stops.turning import MIN_S
from gcs_formation.guidance.parts import BEFORE_M, Part
from gcs_formation.guidance.turn_on_spot import TurnOnSpot

BACK_RADPS: Final = 0.3
"""Gain from the distance to where the leader is due, m, to a speed, m/s: half of the bandwidth that time constants of
0.6 s, and of 0.2 s that setpoints are held, leave well damped. Tuned: rad/s; 0.1 to 0.5; shown by `pytest
tests/gcs_formation/guidance`."""
OFF_M: Final = 5.0
"""Distance beyond which it is due where it is. Tuned: m; 2 to 10; shown by `pytest tests/gcs_formation/guidance`."""
MAX_TICK_S: Final = 1.0
"""A longer interval between two ticks counts as this long. Tuned: s; 0.5 to 2; shown by `pytest
tests/gcs_formation/guidance`."""
ALMOST_S: Final = 1e-6


class Due(NamedTuple):
    """What the timetable asks of the leader at one tick."""

    speed_mps: float
    accel_mps2: float
    """Mean over the tick, for which the setpoint is held."""
    ahead_m: float
    """How far ahead of the leader the position is where it is due."""
    hovers: bool
    turn: TurnOnSpot | None

    def setpoint_mps(self, tau_s: float) -> float:
        """Return the speed setpoint, by (7), with the time constant of the `held` model."""
        if self.hovers:
            return 0.0
        return max(self.speed_mps + tau_s * self.accel_mps2 + BACK_RADPS * self.ahead_m, 0.0)


@dataclass
class TimedProgress:
    """Where the leader is due, and what it does at stops."""

    timetable: Timetable
    ordered: bool = False
    """Whether its speed was ordered; stops and corners stay."""
    _hovering: bool = False
    """Whether it was ordered to hover."""
    _time_s: float = math.nan
    """Time on the timetable; NaN: by the leader's position, at the next tick."""
    _passed: int = 0
    """Number of stops that are behind it."""
    _last: Instant | None = None

    _turn: TurnOnSpot | None = None
    """The turn in place that it makes at present."""

    @property
    def pauses(self) -> bool:
        """Whether it is at a stop, and wasn't ordered to hover."""
        return not self._hovering and self._pause() is not None

    def _pause(self) -> Pause | None:
        return self.timetable.pause_at(self._time_s)

    def take_over(self) -> None:
        """Another vehicle leads: it is due where it is; at a stop it stays as long, but has turned already."""
        pause = self._pause()
        if pause is None:
            self._time_s = math.nan
        elif self._turn is not None:
            self._time_s = pause.end_s - ALMOST_S
        self._turn = None

    def order(self, speed_mps: float) -> None:
        """Fly at another speed from now on, at most; 0: hover."""
        self._hovering = speed_mps == 0.0
        if not self._hovering:
            self.timetable, self.ordered = self.timetable.at_speed(speed_mps), True
        self._time_s, self._turn = math.nan, None

    def part(self, route: Route, *, ahead: bool = False) -> Part:
        """Return the part of a route from the last stop to the next one; `ahead`: at a stop the part after it."""
        stops, passed = self.timetable.stops, self._passed + (ahead and self.pauses)
        begin_m = stops[passed - 1].begin_m if passed else -math.inf
        end_m = stops[passed].begin_m if passed < len(stops) else math.inf
        return Part(route, begin_m, end_m)

    def advance(self, distance_m: float, at: Instant | None, dt_s: float, turn: TurnOnSpot | None) -> Due | None:
        """Return what is due a tick later, for a leader at a distance; None if it was ordered to hover.

        Args:
            distance_m: along the path.
            at: when the setpoint acts; None: `dt_s` after the last one.
            dt_s: time between ticks.
            turn: that the leader makes; one that isn't a stop's, such as a new leader's, is ended first.
        """
        elapsed_s = dt_s if at is None or self._last is None else seconds_between(self._last, at)
        self._last = at
        if self._hovering:
            return None
        if turn is not None and turn is not self._turn and at is not None and not turn.over(at):
            return Due(0.0, 0.0, 0.0, hovers=True, turn=turn)
        table = self.timetable
        self._time_s += min(max(elapsed_s, 0.0), MAX_TICK_S)
        if not math.isnan(self._time_s):
            self._passed = table.passed(self._time_s)
        due_m, speed_mps, _ = table.after(self._time_s)
        behind, paused = abs(due_m - distance_m) > OFF_M, self._pause() is not None
        if math.isnan(self._time_s) or distance_m < 0.0 or (behind and not paused):
            self._time_s = table.when_s(self._within(distance_m))
            self._passed = table.passed(self._time_s)
            due_m, speed_mps, _ = table.after(self._time_s)
        pause = self._pause()
        if pause is None:
            accel_mps2, self._turn = (table.after(self._time_s + dt_s)[1] - speed_mps) / dt_s, None
            return Due(speed_mps, accel_mps2, due_m - distance_m, hovers=False, turn=None)
        since_s = self._time_s - pause.begin_s
        self._turn = self._turn or self._turn_of(pause.passage, since_s, at)
        far = abs(due_m - distance_m) > OFF_M  # a new leader stays where it is
        return Due(0.0, 0.0, due_m - distance_m, hovers=since_s >= SETTLE_S or far, turn=self._turn)

    def _within(self, distance_m: float) -> float:
        """Return a distance within the part that is flown; a new leader may be anywhere."""
        stops = self.timetable.stops
        low_m = stops[self._passed - 1].begin_m + BEFORE_M if self._passed else -math.inf
        return max(distance_m, low_m)

    @staticmethod
    def _turn_of(stop: Passage, since_s: float, at: Instant | None) -> TurnOnSpot | None:
        """Return the turn in place, once the leader has stood for as long as it is to."""
        turning_s = since_s - SETTLE_S - stop.hold_s
        if stop.turn_s == 0.0 or turning_s < 0.0 or at is None:
            return None
        return TurnOnSpot(stop.from_rad, stop.by_rad, after(at, -turning_s), stop.turn_s - MIN_S)

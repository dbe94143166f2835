"""The leader: the wind that its guidance goes by, its turns on the spot, what it is commanded and when that acts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from mypy_extensions import mypyc_attr

from airlink.clock import Instant, seconds_between
from flight_model.autopilot_model import FlightState, signed
from flight_model.displacement import PEAK_CHANGE, PEAK_RATE, minimum_jerk
from flight_model.slot import Slot
from gcs_formation.estimation.setpoint_history import HISTORY_S
from gcs_formation.guidance.tracking import MotionRates

SHARE: Final = 0.5
"""Of speed and acceleration, that slots use in a turn; the rest is left to the law."""
NOSE_RADPS: Final = 0.5
"""Fastest turn: noses come round at 1 rad/s."""
LEAST_S: Final = 2.0
ASSEMBLED_S: Final = 2.0
"""How long followers must stay in their slots to count as assembled."""
QUICK_RADPS, SLOW_RADPS = 1.0, 0.5
"""Bandwidths of the wind estimate for the leader's guidance: followers' slots can't keep up with quicker turns."""
AHEAD_M: Final = 165.0
"""Distance of the places along the leader's way around which the ground is looked at."""


def points_ahead(way_m: float) -> list[float]:
    """Return how far along a way the ground is looked at, m: of a longer way the same places, and more."""
    return [AHEAD_M * each for each in range(1 + math.ceil(way_m / AHEAD_M))]


@dataclass(frozen=True)
class TurnOnSpot:
    """A direction that comes round from one to another, at rest at both ends, with the least jerk."""

    begin_rad: float
    by_rad: float
    """Clockwise positive."""
    begun: Instant
    duration_s: float

    @classmethod
    def to(
        cls, heading_rad: float, from_rad: float, now: Instant, reach_m: float, speed_mps: float, accel_mps2: float
    ) -> TurnOnSpot:
        """Return the shorter way round, no faster than slots up to `reach_m` away can follow within these limits."""
        by_rad = math.remainder(heading_rad - from_rad, math.tau)
        size_rad, reach_m = abs(by_rad), max(reach_m, 1.0)
        most_radps = min(NOSE_RADPS, SHARE * speed_mps / reach_m, math.sqrt(SHARE * accel_mps2 / reach_m))
        duration_s = max(
            LEAST_S, PEAK_RATE * size_rad / most_radps, math.sqrt(PEAK_CHANGE * size_rad * reach_m / SHARE / accel_mps2)
        )
        return cls(from_rad, by_rad, now, duration_s)

    @property
    def goal_rad(self) -> float:
        """Where it ends."""
        return self.begin_rad + self.by_rad

    def over(self, at: Instant) -> bool:
        """Whether it has come round, and whoever follows it too: they turn their noses to where they swing."""
        return seconds_between(self.begun, at) >= self.duration_s + LEAST_S

    def setpoint(self, at: int, lag_s: float) -> tuple[float, float]:
        """Return the heading to tell at an instant (ns) to what follows with a lag, and how fast that turns, rad/s."""
        elapsed_s = seconds_between(self.begun, Instant(at))
        share, rate, change = minimum_jerk(min(max(elapsed_s / self.duration_s, 0.0), 1.0))
        rate, change = rate * self.by_rad / self.duration_s, change * self.by_rad / self.duration_s**2
        return self.begin_rad + share * self.by_rad + lag_s * rate, rate + lag_s * change


def amid(followers: list[FlightState], slots: list[Slot], speed_mps: float) -> FlightState:
    """Return the leader relative to which the followers are, on average, in their slots."""
    count = len(followers)
    sine = sum(math.sin(each.heading_rad) for each in followers)
    heading_rad = math.atan2(sine, sum(math.cos(each.heading_rad) for each in followers))
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    leader = FlightState(0.0, 0.0, 0.0, 0.0, speed_mps, heading_rad, 0.0, 0.0)
    for each, slot in zip(followers, slots, strict=True):
        leader.north_m += (each.north_m - (slot.forward_m * cos - slot.right_m * sin)) / count
        leader.east_m += (each.east_m - (slot.forward_m * sin + slot.right_m * cos)) / count
        leader.height_m += (each.height_m - slot.up_m) / count
        leader.wind_north_mps += each.wind_north_mps / count
        leader.wind_east_mps += each.wind_east_mps / count
    return leader


class LeaderWind:
    """The wind by which the leader is guided: that seen behind two lags."""

    def __init__(self, dt_s: float) -> None:
        """Begin with the first wind that is seen; `dt_s` is the time from tick to tick."""
        self._quick_kept, self._slow_kept = math.exp(-QUICK_RADPS * dt_s), math.exp(-SLOW_RADPS * dt_s)
        self._quick_mps: tuple[float, float] | None = None
        self._slow_mps = (0.0, 0.0)

    def guided(self, state: FlightState, ahead_s: float) -> tuple[FlightState, MotionRates]:
        """Return the leader's state for its guidance, and how it changes; the turn isn't known yet.

        Its place, predicted `ahead_s` with the wind seen, doesn't jump with that wind: followers can't follow a leader
        whose turn rate changes at once.
        """
        seen_mps = state.wind_north_mps, state.wind_east_mps
        if self._quick_mps is None:
            self._quick_mps = self._slow_mps = seen_mps
        self._quick_mps = _lagged(self._quick_kept, self._quick_mps, seen_mps)
        self._slow_mps = _lagged(self._slow_kept, self._slow_mps, self._quick_mps)
        quick_mps2 = _rate(QUICK_RADPS, self._quick_mps, seen_mps)
        north_mps, east_mps = state.ground_mps()
        place_mps = north_mps + ahead_s * quick_mps2[0], east_mps + ahead_s * quick_mps2[1]
        guided = state.copy()
        guided.north_m -= ahead_s * (seen_mps[0] - self._quick_mps[0])
        guided.east_m -= ahead_s * (seen_mps[1] - self._quick_mps[1])
        guided.wind_north_mps, guided.wind_east_mps = self._slow_mps
        return guided, MotionRates(place_mps, 0.0, _rate(SLOW_RADPS, self._slow_mps, self._quick_mps))


def _lagged(kept: float, before: tuple[float, float], seen: tuple[float, float]) -> tuple[float, float]:
    return kept * before[0] + (1.0 - kept) * seen[0], kept * before[1] + (1.0 - kept) * seen[1]


def _rate(radps: float, lagged: tuple[float, float], seen: tuple[float, float]) -> tuple[float, float]:
    return radps * (seen[0] - lagged[0]), radps * (seen[1] - lagged[1])


@mypyc_attr(acyclic=True)
class LeaderCommand:
    """What the leader flies by at some instant."""

    __slots__ = ("heading_rad", "height_m", "speed_mps", "turn_rps")

    def __init__(self, speed_mps: float, heading_rad: float, height_m: float, turn_rps: float) -> None:
        """Take its setpoints, and how fast the commanded heading turns."""
        self.speed_mps = speed_mps
        self.heading_rad = heading_rad
        self.height_m = height_m
        self.turn_rps = turn_rps


class LeaderCommands:
    """The leader's setpoints of the last seconds, tick by tick."""

    def __init__(self, dt_s: float) -> None:
        """Begin with none; `dt_s` is the time between ticks."""
        self._length = max(2, int(HISTORY_S / dt_s))
        self._acts: list[int] = []
        self._commands: list[LeaderCommand] = []

    def forget(self) -> None:
        """Forget everything: another vehicle leads."""
        self._acts.clear()
        self._commands.clear()

    def add(self, acts: Instant, command: LeaderCommand) -> None:
        """Add a tick's command, and when it acts; its heading goes on from the one before without a jump."""
        if self._commands:
            before_rad = self._commands[-1].heading_rad
            command.heading_rad = before_rad + signed(command.heading_rad - before_rad)
        self._acts.append(max(acts, self._acts[-1]) if self._acts else acts)
        self._commands.append(command)
        if len(self._commands) > self._length:
            del self._acts[0], self._commands[0]

    def at(self, instant: int) -> LeaderCommand:
        """Return the mean of what the leader flies by in the tick that begins at an instant, in ns.

        Its setpoints are held from tick to tick, so these means lie on straight lines between them. Before the oldest
        it is taken to fly by that one, after the newest by the newest.
        """
        index = len(self._acts) - 1
        while index > 0 and self._acts[index] > instant:
            index -= 1
        if index == len(self._acts) - 1 or self._acts[index] > instant:
            return self._commands[index]
        share = (instant - self._acts[index]) / (self._acts[index + 1] - self._acts[index])
        now, then = self._commands[index], self._commands[index + 1]
        return LeaderCommand(
            now.speed_mps + share * (then.speed_mps - now.speed_mps),
            now.heading_rad + share * (then.heading_rad - now.heading_rad),
            now.height_m + share * (then.height_m - now.height_m),
            now.turn_rps + share * (then.turn_rps - now.turn_rps),
        )

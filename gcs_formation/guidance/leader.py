"""The leader's guidance: to the start of the path, around again until the formation is assembled, along the path."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from airlink.clock import Instant, seconds_between
from flight_model.arrays import Array, Instants
from flight_model.displacement import DisplacedPath
from flight_model.path import SplinePath
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates, Setpoint, Setpoints
from gcs_formation.estimation.predictor import advance
from gcs_formation.estimation.setpoint_history import HISTORY_S
from gcs_formation.guidance.tracking import (
    JoinRoute,
    Lags,
    Motion,
    MotionRates,
    Pose,
    Route,
    RouteHeading,
    join,
    nearest,
    project,
    route_heading,
    track,
    track_turn,
)

DECISION_S = 2.0
"""How long before the path's start to decide whether to begin it or to go around again."""
ASSEMBLED_S = 2.0
"""How long followers must stay in their slots to count as assembled."""
SETTLE_S = 30.0
"""Shortest straight flight between a turn and the path: followers are back in their slots 10 s after a turn's end."""
ON_EXTENSION_M = 60.0
ON_EXTENSION_RAD = math.radians(30.0)
ON_PATH_M, ON_PATH_RAD = 10.0, math.radians(10.0)
"""Within these the leader is on the path, and needs no way back."""
WIND_RADPS = 1.0, 0.5
"""Bandwidths of the wind estimate for the leader's guidance: followers' slots can't keep up with quicker turns."""
RETURNS = 8
"""How many places are tried to return to, each a turn's radius farther along the path than the one before."""
CLIMB_SHARE = 0.7
"""Share of the climb limit that the route to the start uses; followers need the rest."""


def amid(followers: FlightStates, slots_m: Array, speed_mps: float) -> FlightStates:
    """Return the leader (1 column) relative to which the followers are, on average, in their slots (F, 3)."""
    heading = np.arctan2(np.sin(followers.heading_rad).mean(), np.cos(followers.heading_rad).mean())
    cos, sin = np.cos(heading), np.sin(heading)
    forward_m, right_m, up_m = slots_m.T
    places = (
        followers.north_m - (forward_m * cos - right_m * sin),
        followers.east_m - (forward_m * sin + right_m * cos),
        followers.height_m - up_m,
    )
    wind = (followers.wind_north_mps.mean(), followers.wind_east_mps.mean())
    means = (*(place.mean() for place in places), 0.0, speed_mps, heading, *wind)
    return FlightStates(*(np.array([float(value)]) for value in means))


def fly_on(leader: FlightStates, told: Setpoints, since: Instant, now: Instant, model: AutopilotModels) -> FlightStates:
    """Return the leader's state at `now`, from the one at `since`, under setpoints `told` (1 column)."""
    return advance(leader, told.table[None], np.array([[seconds_between(since, now)]]), model)


class LeaderWind:
    """The wind by which the leader is guided: that seen behind two lags."""

    def __init__(self, dt_s: float) -> None:
        """Begin with the first wind that is seen; `dt_s` is the time from tick to tick."""
        self._kept = tuple(math.exp(-radps * dt_s) for radps in WIND_RADPS)
        self._stages_mps = list[list[float]]()

    def motion(self, state: FlightStates, ahead_s: float) -> tuple[Motion, MotionRates]:
        """Return the leader's motion (of 1 column) for its guidance, and how it changes; the turn isn't known yet.

        Its place, predicted `ahead_s` with the wind seen, doesn't jump with that wind: followers can't follow a leader
        whose turn rate changes at once.
        """
        north_m, east_m, _, _, airspeed_mps, heading_rad, *seen_mps = state.table[:, 0].tolist()
        stages: list[list[float]] = []
        for kept, before_mps in zip(self._kept, self._stages_mps or [seen_mps, seen_mps], strict=True):
            each = zip(before_mps, stages[-1] if stages else seen_mps, strict=True)
            stages.append([kept * before + (1 - kept) * seen for before, seen in each])
        self._stages_mps = stages
        quick, slow = WIND_RADPS
        quick_mps2 = [quick * (seen - lag) for seen, lag in zip(seen_mps, stages[0], strict=True)]
        slow_mps2 = [slow * (seen - lag) for seen, lag in zip(*stages, strict=True)]
        north_m -= ahead_s * quick_mps2[0] / quick
        east_m -= ahead_s * quick_mps2[1] / quick
        north_mps, east_mps = state.ground_mps[:, 0].tolist()
        place_mps = north_mps + ahead_s * quick_mps2[0], east_mps + ahead_s * quick_mps2[1]
        motion = Motion(north_m, east_m, airspeed_mps, heading_rad, *stages[1])
        return motion, MotionRates(place_mps, 0.0, (slow_mps2[0], slow_mps2[1]))


class Told(NamedTuple):
    """The leader's setpoints at some instants."""

    setpoints: Setpoints
    """(C,) columns."""
    turn_rps: Array
    """(C,) how fast the told heading turns, rad/s."""


class ToldLeader:
    """The leader's setpoints of the last seconds, tick by tick."""

    def __init__(self, dt_s: float) -> None:
        """Begin with none; `dt_s` is the time between ticks."""
        self._acts = deque[int](maxlen=max(2, int(HISTORY_S / dt_s)))
        self._rows = deque[tuple[float, float, float, float]](maxlen=self._acts.maxlen)

    def begin(self) -> None:
        """Forget everything: another vehicle leads."""
        self._acts.clear()
        self._rows.clear()

    def tell(self, acts: Instant, told: Setpoints, turn_rps: float) -> None:
        """Add a tick's setpoints (1,), when they act, and how fast their heading turns."""
        speed_mps, heading_rad, height_m = told.table[:, 0].tolist()
        if self._rows:
            before_rad = self._rows[-1][1]
            heading_rad = before_rad + math.remainder(heading_rad - before_rad, math.tau)
        self._acts.append(acts)
        self._rows.append((speed_mps, heading_rad, height_m, turn_rps))

    def at(self, instants: Instants) -> Told:
        """Return the means of what the leader flies by in the tick that begins at each instant, (C,).

        Its setpoints are held from tick to tick, so these means lie on straight lines between them. Before the oldest
        it is taken to fly by that one, after the newest by the newest.
        """
        acts = np.maximum.accumulate(np.array(self._acts))
        instants, acts = instants - acts[-1], acts - acts[-1]
        speed, heading, height, turn = (np.interp(instants, acts, row) for row in zip(*self._rows, strict=True))
        return Told(Setpoints(speed, heading, height), turn)


@dataclass
class LeaderGuidance:
    """The leader's route and its position on it; gives its setpoints."""

    path: SplinePath
    speed_mps: float
    run_in_m: float
    hold_radius_m: float
    climb_max_mps: float
    route: Route | None = None
    distance_m: float = 0.0
    rounds: int = 0
    amid_m: tuple[float, float] | None = None
    """Where along the path the leader is when it is first steered: between these distances; None: before its start."""
    joins_m: float | None = None
    """Where along the path the way ends that returns to it."""

    @property
    def on_path(self) -> bool:
        """Whether the route is the path, its straight run-in, or a new leader's way onto it."""
        return self.route is self.path or isinstance(self.route, DisplacedPath)

    @property
    def started(self) -> bool:
        """Whether the leader has passed the path's start."""
        return self.on_path and self.distance_m >= 0.0

    @property
    def at_end(self) -> bool:
        """Whether the leader has reached the path's end."""
        return self.on_path and self.distance_m >= self.path.length_m

    def steer(self, motion: Motion, height_m: float, lags: Lags, *, assembled: bool) -> Setpoint:
        """Return the setpoint for the leader at `motion` and `height_m`; `assembled`: the path may be begun."""
        if self.route is None:
            self._set_out(motion, height_m)
        assert self.route is not None
        self.distance_m = project(self.route, motion, self.distance_m)
        if not self.on_path and self.distance_m >= self.route.length_m:
            self._follow_path(motion)
        elif self.on_path and not self.started and not assembled and self._must_decide():
            self.rounds += 1
            self._join(motion, height_m)
        return track(self.route, self.distance_m, motion, lags, self.speed_mps)

    def take_over(self, route: DisplacedPath | None, distance_m: float) -> None:
        """Guide another vehicle from now on, along `route` from `distance_m`; without one, to the path's start."""
        self.route, self.distance_m = route, distance_m

    def heading(self, motion: Motion) -> RouteHeading:
        """Return the route's own heading, turn and climb at the leader, without corrections towards the route."""
        assert self.route is not None
        return route_heading(self.route, self.distance_m, motion)

    def told_turn(self, motion: Motion, lags: Lags, rates: MotionRates) -> float:
        """Return how fast the setpoint of `steer` turns, rad/s, while the leader's motion changes at `rates`."""
        assert self.route is not None
        return track_turn(self.route, self.distance_m, motion, lags, self.speed_mps, rates)

    def _must_decide(self) -> bool:
        return self.distance_m > -DECISION_S * self.speed_mps

    def _set_out(self, motion: Motion, height_m: float) -> None:
        if self.amid_m is not None:
            self._return(motion, height_m, nearest(self.path, motion, *self.amid_m))
            return
        start = self.path.at(0.0)
        north, east = motion.north_m - start.north_m, motion.east_m - start.east_m
        cos, sin = math.cos(start.course_rad), math.sin(start.course_rad)
        behind_m, right_m = -(north * cos + east * sin), east * cos - north * sin
        aside = math.remainder(motion.heading_rad - start.course_rad, math.tau)
        climb_m = abs(start.height_m - height_m) / CLIMB_SHARE / self.climb_max_mps * self.speed_mps
        near_enough = abs(right_m) < ON_EXTENSION_M and abs(aside) < ON_EXTENSION_RAD
        if near_enough and behind_m > max(climb_m, DECISION_S * self.speed_mps):
            self._follow_path(motion)
        else:
            self._join(motion, height_m)

    def _return(self, motion: Motion, height_m: float, abreast_m: float) -> None:
        """Return to the path, abreast of which the leader is, in turns in which its followers can stay."""
        point = self.path.at(abreast_m)
        right_m, _ = point.aside_m(motion.north_m, motion.east_m, height_m)
        north_mps, east_mps = motion.ground_velocity()
        course = math.atan2(east_mps, north_mps)
        off_rad = math.remainder(course - point.course_rad, math.tau)
        if abs(right_m) < ON_PATH_M and abs(off_rad) < ON_PATH_RAD:
            self.route, self.distance_m = self.path, abreast_m
            return
        begin = Pose(motion.north_m, motion.east_m, height_m, course)
        slope = CLIMB_SHARE * self.climb_max_mps / self.speed_mps
        ways: list[tuple[float, JoinRoute, float]] = []
        for ahead in range(1, RETURNS + 1):
            to_m = abreast_m + ahead * self.hold_radius_m
            end = self.path.at(to_m)
            goal = Pose(end.north_m, end.east_m, end.height_m, end.course_rad)
            way = join(begin, goal, self.hold_radius_m, slope)
            ways.append((way.length_m - (to_m - abreast_m), way, to_m))
        direct = [way for way in ways if way[0] < self.hold_radius_m]
        _, self.route, self.joins_m = direct[0] if direct else min(ways, key=lambda way: way[0])
        self.distance_m = 0.0

    def _follow_path(self, motion: Motion) -> None:
        self.route = self.path
        if self.joins_m is not None:
            self.distance_m, self.joins_m = project(self.path, motion, self.joins_m), None
            return
        start = self.path.at(0.0)
        north, east = motion.north_m - start.north_m, motion.east_m - start.east_m
        self.distance_m = north * math.cos(start.course_rad) + east * math.sin(start.course_rad)

    def _join(self, motion: Motion, height_m: float) -> None:
        """Take the route to the start of the run-in."""
        entry = self.path.at(-max(self.run_in_m, SETTLE_S * self.speed_mps))
        course = math.atan2(*reversed(motion.ground_velocity()))
        begin = Pose(motion.north_m, motion.east_m, height_m, course)
        end = Pose(entry.north_m, entry.east_m, entry.height_m, entry.course_rad)
        slope = CLIMB_SHARE * self.climb_max_mps / self.speed_mps
        self.route, self.distance_m = join(begin, end, self.hold_radius_m, slope), 0.0

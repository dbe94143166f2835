"""The leader's route: to the start of the path, around again until the formation is assembled, along the path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from airlink.clock import Instant
from flight_model.autopilot_model import AutopilotModel, FlightState, Setpoint, rotated
from flight_model.curve import PathPoint
from flight_model.displacement import DisplacedPath
from flight_model.path import Route, SplinePath
from flight_model.slot import LEADS_FROM_MPS
from gcs_formation.guidance.leader import LEAST_S, TurnOnSpot
from gcs_formation.guidance.tracking import (
    LEAST_MPS,
    JoinRoute,
    MotionRates,
    RouteHeading,
    join,
    nearest,
    project,
    route_heading,
    track,
    track_turn,
)

DECISION_S: Final = 2.0
"""How long before the path's start to decide whether to begin it or to go around again."""
SETTLE_S: Final = 30.0
"""Shortest straight flight between a turn and the path: followers are back in their slots 10 s after a turn's end."""
ON_EXTENSION_M: Final = 60.0
ON_EXTENSION_RAD: Final = math.radians(30.0)
ON_PATH_M, ON_PATH_RAD = 10.0, math.radians(10.0)
"""Within these the leader is on the path, and needs no way back."""
RETURNS: Final = 8
"""How many places are tried to return to, each a turn's radius farther along the path than the one before."""
CLIMB_SHARE: Final = 0.7
"""Share of the climb limit that the route to the start uses; followers need the rest."""


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
    turn: TurnOnSpot | None = None
    """What a leader that stands turns its nose by, and then holds; None: it faces along its route."""
    _point: PathPoint | None = None
    """Of the route, where the leader was steered last."""

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

    def steer(self, state: FlightState, model: AutopilotModel, *, assembled: bool) -> Setpoint:
        """Return the setpoint for the leader in `state`; `assembled`: the path may be begun."""
        if self.route is None:
            self._set_out(state)
        assert self.route is not None
        self.distance_m = project(self.route, state.north_m, state.east_m, self.distance_m)
        if not self.on_path and self.distance_m >= self.route.length_m:
            self._follow_path(state)
        elif self.on_path and not self.started and not assembled and self._must_decide():
            self.rounds += 1
            self._join(state)
        self._point = self.route.at(self.distance_m)
        return track(self._point, state, model, self.speed_mps)

    def take_over(self, route: DisplacedPath | None, distance_m: float) -> None:
        """Guide another vehicle from now on, along `route` from `distance_m`; without one, to the path's start."""
        self.route, self.distance_m = route, distance_m

    def resume(
        self, speed_mps: float, at: Instant, heading_rad: float | None, amid_m: tuple[float, float] | None
    ) -> None:
        """Go on where a flight stood: its speed, where those that stood faced, how far along the path it may be."""
        self.speed_mps, self.amid_m = speed_mps, amid_m
        self.turn = None if heading_rad is None else TurnOnSpot(heading_rad, 0.0, at, LEAST_S)

    def fly_at(self, speed_mps: float) -> None:
        """Fly at another speed from now on; one that stands goes on facing where it does."""
        self.speed_mps, self.turn = speed_mps, self.turn if speed_mps == 0.0 else None

    def heading(self, state: FlightState) -> RouteHeading:
        """Return the route's own heading, turn and climb at the leader, without corrections towards the route."""
        return route_heading(self._here(), state)

    def facing_rad(self, state: FlightState) -> float:
        """Return the direction that the leader faces or, after a turn that has begun, will face."""
        return self.heading(state).heading_rad if self.turn is None else self.turn.goal_rad

    def turn_rps(self, state: FlightState, model: AutopilotModel, rates: MotionRates) -> float:
        """Return how fast the setpoint of `steer` turns while the leader's state changes at `rates`."""
        return track_turn(self._here(), state, model, self.speed_mps, rates)

    def _here(self) -> PathPoint:
        assert self._point is not None, "nobody was steered yet"
        return self._point

    def _must_decide(self) -> bool:
        return self.distance_m > -DECISION_S * self.speed_mps

    def _set_out(self, state: FlightState) -> None:
        if self.amid_m is not None:
            self._return(state, nearest(self.path, state.north_m, state.east_m, *self.amid_m))
            return
        start = self.path.at(0.0)
        along_m, right_m = rotated(start.course_rad, state.north_m - start.north_m, state.east_m - start.east_m)
        aside = math.remainder(state.heading_rad - start.course_rad, math.tau)
        climb_m = abs(start.height_m - state.height_m) / CLIMB_SHARE / self.climb_max_mps * self.speed_mps
        near_enough = abs(right_m) < ON_EXTENSION_M and abs(aside) < ON_EXTENSION_RAD
        if near_enough and -along_m > max(climb_m, DECISION_S * self.speed_mps):
            self._follow_path(state)
        else:
            self._join(state)

    def _return(self, state: FlightState, abreast_m: float) -> None:
        """Return to the path, abreast of which the leader is, in turns in which its followers can stay."""
        point = self.path.at(abreast_m)
        right_m, _ = point.aside_m(state.north_m, state.east_m, state.height_m)
        course = _course(state)
        off_rad = math.remainder(course - point.course_rad, math.tau)
        if abs(right_m) < ON_PATH_M and abs(off_rad) < ON_PATH_RAD:
            self.route, self.distance_m = self.path, abreast_m
            return
        begin = PathPoint(state.north_m, state.east_m, state.height_m, course)
        slope = CLIMB_SHARE * self.climb_max_mps / max(self.speed_mps, LEAST_MPS)
        ways: list[tuple[float, JoinRoute, float]] = []
        for ahead in range(1, RETURNS + 1):
            to_m = abreast_m + ahead * self.hold_radius_m
            way = join(begin, self.path.at(to_m), self.hold_radius_m, slope)
            ways.append((way.length_m - (to_m - abreast_m), way, to_m))
        direct = [way for way in ways if way[0] < self.hold_radius_m]
        _, self.route, self.joins_m = direct[0] if direct else min(ways, key=lambda way: way[0])
        self.distance_m = 0.0

    def _follow_path(self, state: FlightState) -> None:
        self.route = self.path
        if self.joins_m is not None:
            self.distance_m, self.joins_m = project(self.path, state.north_m, state.east_m, self.joins_m), None
            return
        start = self.path.at(0.0)
        self.distance_m, _ = rotated(start.course_rad, state.north_m - start.north_m, state.east_m - start.east_m)

    def _join(self, state: FlightState) -> None:
        """Take the route to the start of the run-in."""
        entry = self.path.at(-max(self.run_in_m, SETTLE_S * self.speed_mps))
        begin = PathPoint(state.north_m, state.east_m, state.height_m, _course(state))
        slope = CLIMB_SHARE * self.climb_max_mps / max(self.speed_mps, LEAST_MPS)
        self.route, self.distance_m = join(begin, entry, self.hold_radius_m, slope), 0.0


def _course(state: FlightState) -> float:
    """Return the course over ground; of one that stands, whose velocity is noise, the direction of its nose."""
    north_mps, east_mps = state.ground_mps()
    if math.hypot(north_mps, east_mps) < LEADS_FROM_MPS:
        return state.heading_rad
    return math.atan2(east_mps, north_mps)

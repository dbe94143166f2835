"""The leader's guidance: its route to the path and along it, its commands."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from airlink.clock import Instant
from flight_model.autopilot_model import AutopilotModel, rotated
from flight_model.curve import PathPoint
from flight_model.fence_geometry import HoldingPatternFence
from flight_model.flight_state import FlightState, Setpoint
from flight_model.legs.speeds import SpeedProfile
from flight_model.path import FlightPath, Route
from flight_model.path_offsets import DisplacedPath
from flight_model.stops.turning import MIN_S
from gcs_formation.guidance.join_route import JoinRoute, join, joins
from gcs_formation.guidance.lateral import LateralGuidance, TurnBounds
from gcs_formation.guidance.timed_progress import Due, TimedProgress
from gcs_formation.guidance.tracking import (
    MIN_MPS,
    RouteHeading,
    course_or_heading,
    height_setpoint_m,
    nearest,
    project,
    route_heading,
)
from gcs_formation.guidance.turn_on_spot import TurnOnSpot

DECISION_S: Final = 2.0
"""How long before the path's start it is decided whether to begin the path or to fly another holding pattern."""
SETTLE_S: Final = 30.0
"""Shortest straight flight between a turn and the path: followers are back in their slots 10 s after a turn's end."""
MAX_SETTLES: Final = 4
"""Longest such straight, as a multiple; it grows with each holding pattern."""
SHORTER_SETTLES: Final[tuple[float, ...]] = (3.0, 2.0, 1.0, 0.75, 0.5)
"""Multiples that are tried where the fence leaves no room for a longer straight."""
FIRST_STRAIGHT_S: Final = 15.0
"""Shortest first straight, where vehicles join up on the way to it: followers are back in their slots 10 s after a
turn's end, where their heading loops have their whole bandwidth."""
FIRST_STRAIGHTS: Final[tuple[float, ...]] = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Multiples of it that are tried."""
JOINED_S: Final = 80.0
"""How long a formation takes to join up: planned trajectories to slots begin up to 27 s after the last is ready, and
take 53 s (four aircraft in a row, `tests/flights/test_joining_up.py`). A shorter route than that would end in a holding
pattern."""
ON_EXTENSION_M: Final = 60.0
ON_EXTENSION_RAD: Final = math.radians(30.0)
ON_PATH_M, ON_PATH_RAD = 10.0, math.radians(10.0)
"""Within these limits the leader is on the path, and needs no route back."""
RETURNS: Final = 8
"""Number of points of the path that are tried for a return, each a turn's radius farther than the one before."""
CLIMB_SHARE: Final = 0.7
"""Share of the climb limit that the route to the start uses; followers need the rest."""


@dataclass
class LeaderGuidance:
    """The leader's route and its position on it; computes its setpoints."""

    path: FlightPath
    speed_mps: float
    run_in_m: float
    hold_speed_mps: float
    hold_turn_rps: float
    """Speed and rate of turns before the path, and on the route back to it, which followers can fly."""
    climb_max_mps: float
    settle_s: float = SETTLE_S
    """Straight flight between a turn and the path; it is lengthened by as much with each holding pattern."""
    first_straight_s: float = FIRST_STRAIGHT_S
    """Shortest straight flight between the first turn and the path."""
    fence: HoldingPatternFence | None = None
    """Fence that holding patterns are to fit into."""
    speeds: SpeedProfile | None = None
    """Planned airspeed along the path, until another speed is ordered; None: `speed_mps` throughout."""
    timed: TimedProgress | None = None
    """Progress by a timetable along a path with stops, in place of `speeds`."""
    hovers: bool = False
    """Whether the formation can stop before its path, and wait there for its followers."""
    waits: bool = False
    """Whether it does."""
    route: Route | None = None
    distance_m: float = 0.0
    rounds: int = 0
    """Number of holding patterns flown because followers weren't in their slots."""
    centroid_m: tuple[float, float] | None = None
    """Range of distances along the path where the leader is when it is first steered; None: before the path's start."""
    joins_m: float | None = None
    """Distance along the path at which the route that returns to it ends."""
    turn: TurnOnSpot | None = None
    """Turn of a hovering leader, whose final heading it then holds; None: it faces along its route."""
    dt_s: float = 0.1
    """Time between ticks."""
    _point: PathPoint | None = None
    """Point of the route where the leader was steered last."""
    _resumes_mps: float = 0.0
    """Speed at which it goes on after it has waited."""
    _begun: bool = False
    """Whether it has passed the path's start."""

    def __post_init__(self) -> None:
        """Make the lateral loop."""
        self._lateral = LateralGuidance(self.dt_s)

    @property
    def on_path(self) -> bool:
        """Whether the route is the path, its straight run-in, or a new leader's route onto it."""
        return self.route is self.path or isinstance(self.route, DisplacedPath)

    @property
    def started(self) -> bool:
        """Whether the leader has passed the path's start."""
        return self.on_path and self.distance_m >= 0.0 and not self.waits

    @property
    def at_end(self) -> bool:
        """Whether the leader has reached the path's end."""
        return self.on_path and self.distance_m >= self.path.length_m

    def steer(
        self,
        state: FlightState,
        model: AutopilotModel,
        *,
        assembled: bool,
        bounds: TurnBounds | None = None,
        at: Instant | None = None,
    ) -> Setpoint:
        """Return the setpoint for the leader in `state`.

        Args:
            state: the leader's.
            model: of its autopilot.
            assembled: the path may be begun.
            bounds: of the changes of its turn rate.
            at: when the setpoint acts; None: a tick after the last one.
        """
        if self.route is None:
            self._set_out(state)
        assert self.route is not None
        self.distance_m = project(self._flown_route(), state.north_m, state.east_m, self.distance_m)
        if not self.on_path and self.distance_m >= self.route.length_m:
            self._follow_path(state)
        elif self.hovers:
            self._wait(model, assembled=assembled)
        elif self.on_path and not assembled and -DECISION_S * self.speed_mps < self.distance_m < 0.0:
            self.rounds += 1
            self._join(state)
        timed = None if self.waits or not self.on_path else self.timed
        due = None if timed is None else self._progress(timed, at)
        self._point = self._flown_route().at(self.distance_m)
        height_m = height_setpoint_m(self._point, state, model)
        heading_rad = self._lateral.setpoint_rad(self._point, state, model, self.speed_mps, bounds or TurnBounds())
        setpoint = Setpoint(self.speed_mps, heading_rad, height_m)
        if self.speeds is not None and self.on_path and not self.waits:
            self.speed_mps, per_metre = self.speeds.at(self.distance_m)
            # By (7) a speed that changes takes a setpoint that leads it by the time constant.
            setpoint.speed_mps = self.speed_mps + model.tau_v_s * per_metre * self.heading(state).along_mps
        elif due is not None:
            setpoint.speed_mps = due.setpoint_mps(model.held(self.dt_s).tau_v_s)
        return setpoint

    def _wait(self, model: AutopilotModel, *, assembled: bool) -> None:
        """Stop before the path's start as long as the formation isn't assembled; then go on."""
        if self.waits and assembled:
            self.waits, self.speed_mps = False, self._resumes_mps
        if self.waits or self._begun or not self.on_path:
            return
        # v²/2a to stop, and as much to have its speed again when the path begins.
        stops_m = max(DECISION_S, model.tau_v_s + self.speed_mps / model.accel_max_mps2) * self.speed_mps
        if assembled:
            self._begun = self.distance_m >= 0.0
        elif self.distance_m > -stops_m:
            self.waits, self._resumes_mps, self.speed_mps = True, self.speed_mps, 0.0

    @property
    def follows_plan(self) -> bool:
        """Whether its speed is the planned one, which may change along the path; else the one ordered last."""
        return self.speeds is not None or (self.timed is not None and not self.timed.ordered)

    def abreast(self, north_m: float, east_m: float) -> tuple[float, PathPoint]:
        """Return the distance and the point of the path abreast of a vehicle that is near the leader.

        At a stop of the path these are of the leg that it flies next.
        """
        ahead: Route = self.path if self.timed is None else self.timed.part(self.path, ahead=True)
        distance_m = project(ahead, north_m, east_m, self.distance_m)
        return distance_m, ahead.at(distance_m)

    @property
    def pauses(self) -> bool:
        """Whether it is at a stop of its path, which it leaves by itself."""
        return self.on_path and self.timed is not None and self.timed.pauses

    def _progress(self, timed: TimedProgress, at: Instant | None) -> Due | None:
        """Go on along a path with stops; None if the leader was ordered to stand."""
        due = timed.advance(self.distance_m, at, self.dt_s, self.turn)
        if due is not None:
            self.speed_mps, self.turn = due.speed_mps, due.turn
        return due

    def _flown_route(self) -> Route:
        """Return the route; of a path with stops the part up to the next one, and straight on."""
        assert self.route is not None
        return self.timed.part(self.route) if self.timed is not None and self.on_path else self.route

    def go_on_from(self, commanded_rad: float, decided_rad: float, state: FlightState, model: AutopilotModel) -> None:
        """Go on from a heading setpoint that replaced the last one of `steer`, `decided_rad`."""
        self._lateral.go_on_from(commanded_rad, decided_rad, state, model)

    def take_over(self, route: Route | None, distance_m: float) -> None:
        """Guide another vehicle from now on, along `route` from `distance_m`; without one, to the path's start."""
        self.route, self.distance_m = route, distance_m
        self._lateral.drop_state()
        if self.timed is not None:
            self.timed.take_over()

    def resume(
        self, speed_mps: float, at: Instant, heading_rad: float | None, centroid_m: tuple[float, float] | None
    ) -> None:
        """Continue a flight: at its speed, with the heading it held if it stood, within a range along the path."""
        if speed_mps != self.speed_mps:
            self.fly_at(speed_mps)
        self.centroid_m, self._begun = centroid_m, centroid_m is not None
        self.turn = None if heading_rad is None else TurnOnSpot(heading_rad, 0.0, at, MIN_S)

    def fly_at(self, speed_mps: float) -> None:
        """Fly at another speed from now on; a leader that keeps hovering holds its heading."""
        self.speeds = None
        if self.timed is not None:
            self.timed.order(speed_mps)
        self.speed_mps, self.turn = speed_mps, self.turn if speed_mps == 0.0 else None
        if self.waits:
            self.speed_mps, self._resumes_mps = 0.0, speed_mps

    def heading(self, state: FlightState) -> RouteHeading:
        """Return the route's own heading, turn and climb at the leader, without corrections towards the route."""
        return route_heading(self._here(), state)

    def facing_rad(self, state: FlightState) -> float:
        """Return the leader's heading along its route, or the final heading of a turn that has begun."""
        return self.heading(state).heading_rad if self.turn is None else self.turn.goal_rad

    @property
    def turn_rps(self) -> float:
        """The rate of the heading setpoint that `steer` returned."""
        return self._lateral.setpoint_rps

    def _here(self) -> PathPoint:
        assert self._point is not None, "no vehicle was steered yet"
        return self._point

    def _set_out(self, state: FlightState) -> None:
        if self.centroid_m is not None:
            self._return(state, nearest(self.path, state.north_m, state.east_m, *self.centroid_m))
            return
        start = self.path.at(0.0)
        along_m, right_m = rotated(start.course_rad, state.north_m - start.north_m, state.east_m - start.east_m)
        off_rad = math.remainder(state.heading_rad - start.course_rad, math.tau)
        climb_m = abs(start.height_m - state.height_m) / CLIMB_SHARE / self.climb_max_mps * self.speed_mps
        near_enough = abs(right_m) < ON_EXTENSION_M and abs(off_rad) < ON_EXTENSION_RAD
        room_m = 0.0 if self.hovers else max(climb_m, DECISION_S * self.speed_mps)
        if near_enough and -along_m > room_m:
            self._follow_path(state)
        else:
            self._join(state)

    def _return(self, state: FlightState, abreast_m: float) -> None:
        """Choose a route back to the path from abreast of `abreast_m`, with turns that followers can fly."""
        point = self.path.at(abreast_m)
        right_m, _ = point.lateral_and_up_m(state.north_m, state.east_m, state.height_m)
        course = course_or_heading(state)
        off_rad = math.remainder(course - point.course_rad, math.tau)
        if abs(right_m) < ON_PATH_M and abs(off_rad) < ON_PATH_RAD:
            self.route, self.distance_m = self.path, abreast_m
            return
        begin = PathPoint(state.north_m, state.east_m, state.height_m, course)
        slope = CLIMB_SHARE * self.climb_max_mps / max(self.speed_mps, MIN_MPS)
        radius_m = self.hold_radius_m(state.wind_north_mps, state.wind_east_mps)
        candidates: list[tuple[float, JoinRoute, float]] = []
        for ahead in range(1, RETURNS + 1):
            to_m = abreast_m + ahead * radius_m
            candidate = join(begin, self.path.at(to_m), radius_m, slope)
            candidates.append((candidate.length_m - (to_m - abreast_m), candidate, to_m))
        direct = [candidate for candidate in candidates if candidate[0] < radius_m]
        _, self.route, self.joins_m = direct[0] if direct else min(candidates, key=lambda candidate: candidate[0])
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
        begin = PathPoint(state.north_m, state.east_m, state.height_m, course_or_heading(state))
        routed = self.holding_pattern if self.rounds else self.first_route
        self.route, self.distance_m = routed(begin, state.wind_north_mps, state.wind_east_mps), 0.0

    def first_route(self, begin: PathPoint, wind_north_mps: float, wind_east_mps: float) -> JoinRoute:
        """Return the route from where the leader sets out: the shortest with time enough for the others to join up."""
        first_m = self.first_straight_s * self.speed_mps
        straights_m = sorted({*(each * first_m for each in FIRST_STRAIGHTS), *self._straights_m()})
        routes = sorted(self._routes(begin, straights_m, wind_north_mps, wind_east_mps), key=self._by_use)
        return self._fitting([route for route, _ in routes], wind_north_mps, wind_east_mps)

    def holding_pattern(self, begin: PathPoint, wind_north_mps: float, wind_east_mps: float) -> JoinRoute:
        """Return the route from a point to the straight before the path: the longest straight, then the shortest."""
        routes = self._routes(begin, self._straights_m(), wind_north_mps, wind_east_mps)
        return self._fitting((route for route, _ in routes), wind_north_mps, wind_east_mps)

    def _routes(
        self, begin: PathPoint, straights_m: Iterable[float], wind_north_mps: float, wind_east_mps: float
    ) -> Iterator[tuple[JoinRoute, float]]:
        """Yield the routes to straights of these lengths before the path, and the lengths."""
        slope = CLIMB_SHARE * self.climb_max_mps / max(self.speed_mps, MIN_MPS)
        radius_m = self.hold_radius_m(wind_north_mps, wind_east_mps)
        for straight_m in straights_m:
            for route in joins(begin, self.path.at(-straight_m), radius_m, slope):
                yield route, straight_m

    def _fitting(self, routes: Iterable[JoinRoute], wind_north_mps: float, wind_east_mps: float) -> JoinRoute:
        """Return the first route; with a fence, the first that fits into it, or else the one that lacks least room."""
        if self.fence is None:
            return next(iter(routes))
        return self.fence.roomiest(iter(routes), self.speed_mps, wind_north_mps, wind_east_mps)

    def _by_use(self, candidate: tuple[JoinRoute, float]) -> tuple[float, float]:
        """Return the rank of a route and the straight at its end: by what it lacks to join up in time, then its length.

        It is to lead up to the path's height before the straight, and this to be long enough to settle on.
        """
        route, straight_m = candidate
        whole_m, climb_m = route.length_m + straight_m, abs(route.end_height_m - route.begin_height_m) / route.slope
        joined_s = JOINED_S - FIRST_STRAIGHT_S + self.first_straight_s
        settles_m = self.first_straight_s * self.speed_mps - straight_m
        lacks_m = max(joined_s * self.speed_mps - whole_m, climb_m - route.length_m, settles_m, 0.0)
        return lacks_m, whole_m

    def hold_radius_m(self, wind_north_mps: float = 0.0, wind_east_mps: float = 0.0) -> float:
        """Return the radius over ground of turns before the path, allowing for the ground speed in a tailwind."""
        return (self.hold_speed_mps + math.hypot(wind_north_mps, wind_east_mps)) / self.hold_turn_rps

    def _straights_m(self) -> list[float]:
        """Return the possible lengths of the straight before the path, the longest first."""
        settle_m = self.settle_s * self.speed_mps
        longest_m = max(self.run_in_m, settle_m * min(max(self.rounds, 1), MAX_SETTLES))
        return [longest_m, *(times * settle_m for times in SHORTER_SETTLES if times * settle_m < longest_m)]

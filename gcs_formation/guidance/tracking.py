"""Route tracking, and the route from the leader's position to the start of its run-in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

from flight_model.autopilot import AutopilotModel, FlightState, rotated, within
from flight_model.path import PathPoint, Route
from gcs_formation.estimation.flight_state import Setpoint

BANDWIDTH_RADPS: Final = 0.15
"""Bandwidth of the cross-track loop, well below the heading hold's 1/tau_psi."""
INTERCEPT_MAX_RAD: Final = math.radians(60.0)
LEAST_MPS: Final = 1.0
"""What a lower speed along a route counts as, where it is divided by: what hovers may stand."""
NEWTON_STEPS: Final = 3
NEAR_ENOUGH_M: Final = 1e-9
NEAREST_STEP_M: Final = 10.0
TURN: Final = 2 * math.pi


class MotionRates(NamedTuple):
    """How a vehicle's state changes: what is known of its place and wind needn't agree at once."""

    place_mps: tuple[float, float]
    """North and east."""
    turn_rps: float
    wind_mps2: tuple[float, float]
    """North and east."""


class RouteHeading(NamedTuple):
    """Heading, turn rate and climb of a vehicle on a route, corrected for wind."""

    heading_rad: float
    turn_rps: float
    bend_rps2: float
    """Rate of change of the turn rate."""
    climb_mps: float
    along_mps: float
    """Component of its ground velocity along the route."""


def route_heading(point: PathPoint, state: FlightState) -> RouteHeading:
    """Return the heading along the route at the point where a vehicle is, for its speed over ground."""
    along_mps, _ = rotated(point.course_rad, *state.ground_mps())
    return RouteHeading(
        point.course_rad - _crab(state, point.course_rad),
        point.curvature_1pm * along_mps,
        point.curvature_rate_1pm2 * along_mps**2,
        point.slope * along_mps,
        along_mps,
    )


def project(route: Route, north_m: float, east_m: float, near_m: float) -> float:
    """Return the distance along the route of the point nearest to a place, by Newton's method from `near_m`."""
    distance_m = near_m
    for _ in range(NEWTON_STEPS):
        point = route.at(distance_m)
        along_m, right_m = rotated(point.course_rad, north_m - point.north_m, east_m - point.east_m)
        step_m = along_m / max(1.0 - point.curvature_1pm * right_m, 0.2)
        distance_m += step_m
        if abs(step_m) < NEAR_ENOUGH_M:
            break
    return distance_m


def nearest(route: Route, north_m: float, east_m: float, from_m: float, to_m: float) -> float:
    """Return the distance along the route of the point nearest to a place, of those between two distances."""
    steps = max(1, math.ceil((to_m - from_m) / NEAREST_STEP_M))
    places = [from_m + (to_m - from_m) * step / steps for step in range(steps + 1)]

    def away_m(distance_m: float) -> float:
        point = route.at(distance_m)
        return math.hypot(north_m - point.north_m, east_m - point.east_m)

    return min(max(project(route, north_m, east_m, min(places, key=away_m)), from_m), to_m)


def track(point: PathPoint, state: FlightState, model: AutopilotModel, speed_mps: float) -> Setpoint:
    """Return the setpoint that keeps a vehicle on its route, whose nearest point is `point`.

    The course closes the cross-track error with `BANDWIDTH_RADPS`; the heading is corrected for wind; the route's own
    turn and climb are fed forward through the lags of (7).
    """
    _, right_m = rotated(point.course_rad, state.north_m - point.north_m, state.east_m - point.east_m)
    along_mps, aside_mps = rotated(point.course_rad, *state.ground_mps())
    gain_1pm = BANDWIDTH_RADPS / max(speed_mps, LEAST_MPS)
    intercept = math.atan(gain_1pm * right_m)
    limited = within(intercept, -INTERCEPT_MAX_RAD, INTERCEPT_MAX_RAD)
    course = point.course_rad - limited
    turn_rps = point.curvature_1pm * along_mps
    if limited == intercept:
        turn_rps -= gain_1pm * aside_mps / (1 + (gain_1pm * right_m) ** 2)
    heading = course - _crab(state, course) + model.tau_psi_s * turn_rps
    rise_mps = point.slope * along_mps
    height_m = point.height_m + (model.tau_ha_s + model.tau_hb_s) * rise_mps
    height_m += model.tau_ha_s * model.tau_hb_s * point.slope_rate_1pm * along_mps**2
    return Setpoint(speed_mps, heading, height_m)


def track_turn(
    point: PathPoint, state: FlightState, model: AutopilotModel, speed_mps: float, rates: MotionRates
) -> float:
    """Return how fast the heading setpoint of `track` turns, rad/s: its derivative by time along the vehicle's motion.

    Differences of setpoints from tick to tick would be mostly the noise of positions.

    Args:
        point: of the route, nearest to the vehicle.
        state: the vehicle's.
        model: of its autopilot.
        speed_mps: airspeed to be flown.
        rates: how `state` changes.
    """
    _, right_m = rotated(point.course_rad, state.north_m - point.north_m, state.east_m - point.east_m)
    along_mps, _ = rotated(point.course_rad, *state.ground_mps())
    passed_mps, aside_mps = rotated(point.course_rad, *rates.place_mps)
    along_mps2, wind_mps2 = rotated(point.course_rad, *rates.wind_mps2)
    carried_mps, _ = rotated(point.course_rad, state.wind_north_mps, state.wind_east_mps)
    path_rps, gain_1pm = point.curvature_1pm * passed_mps, BANDWIDTH_RADPS / max(speed_mps, LEAST_MPS)
    bend_rps2 = point.curvature_rate_1pm2 * passed_mps * along_mps + point.curvature_1pm * along_mps2
    intercept = math.atan(gain_1pm * right_m)
    limited = within(intercept, -INTERCEPT_MAX_RAD, INTERCEPT_MAX_RAD)
    gain_1pm = gain_1pm / (1 + (gain_1pm * right_m) ** 2) if limited == intercept else 0.0
    course_rps = path_rps - gain_1pm * aside_mps
    # The axes turn under the wind, so its component across them changes even while it is constant.
    aside_mps2 = (along_mps - carried_mps) * rates.turn_rps - along_mps * path_rps + wind_mps2
    crab_rps = _crab_rate(state, point.course_rad - limited, course_rps, rates.wind_mps2)
    return course_rps - crab_rps + model.tau_psi_s * (bend_rps2 - gain_1pm * aside_mps2)


def _crab(state: FlightState, course_rad: float) -> float:
    """Return the crab angle: how far left of the course the heading must point to cancel the crosswind."""
    _, aside_mps = rotated(course_rad, state.wind_north_mps, state.wind_east_mps)
    return math.asin(within(aside_mps / max(state.airspeed_mps, 1.0), -1.0, 1.0))


def _crab_rate(state: FlightState, course_rad: float, course_rps: float, wind_mps2: tuple[float, float]) -> float:
    """Return how fast the crab angle changes, rad/s, while the course turns under a wind that changes."""
    along_mps, aside_mps = rotated(course_rad, state.wind_north_mps, state.wind_east_mps)
    _, aside_mps2 = rotated(course_rad, *wind_mps2)
    forward_mps2 = max(state.airspeed_mps**2 - aside_mps**2, 1.0)
    return (aside_mps2 - along_mps * course_rps) / math.sqrt(forward_mps2)


class Pose(NamedTuple):
    """A position and a course over ground (clockwise from north)."""

    north_m: float
    east_m: float
    height_m: float
    course_rad: float


class Leg(NamedTuple):
    """A piece of constant curvature: positive to the right."""

    start: Pose
    length_m: float
    curvature_1pm: float

    def at(self, distance_m: float) -> Pose:
        """Return the pose at a distance from the leg's start; its height is the start's."""
        north, east, height, course = self.start
        if self.curvature_1pm == 0.0:
            return Pose(north + distance_m * math.cos(course), east + distance_m * math.sin(course), height, course)
        turned = course + distance_m * self.curvature_1pm
        return Pose(
            north + (math.sin(turned) - math.sin(course)) / self.curvature_1pm,
            east - (math.cos(turned) - math.cos(course)) / self.curvature_1pm,
            height,
            turned,
        )


@dataclass(frozen=True)
class JoinRoute:
    """Three legs, and a height that changes from that of the first pose to that of the last at `slope`."""

    legs: tuple[Leg, ...]
    begin_height_m: float
    end_height_m: float
    slope: float

    @property
    def length_m(self) -> float:
        """Horizontal length, m."""
        return sum(leg.length_m for leg in self.legs)

    def at(self, distance_m: float) -> PathPoint:
        """Return the point at a distance from the start; beyond its ends the route is straight."""
        leg, along_m = self._leg(distance_m)
        pose = leg.at(along_m)
        way_m = self.end_height_m - self.begin_height_m
        climbed_m = math.copysign(min(abs(way_m), max(distance_m, 0.0) * self.slope), way_m)
        climbing = distance_m >= 0.0 and abs(climbed_m) < abs(way_m)
        return PathPoint(
            pose.north_m,
            pose.east_m,
            self.begin_height_m + climbed_m,
            pose.course_rad,
            leg.curvature_1pm if 0.0 <= distance_m <= self.length_m else 0.0,
            0.0,
            math.copysign(self.slope, way_m) if climbing else 0.0,
            0.0,
        )

    def _leg(self, distance_m: float) -> tuple[Leg, float]:
        if distance_m < 0.0:
            return Leg(self.legs[0].start, math.inf, 0.0), distance_m
        for leg in self.legs:
            if distance_m <= leg.length_m:
                return leg, distance_m
            distance_m -= leg.length_m
        last = self.legs[-1]
        return Leg(last.at(last.length_m), math.inf, 0.0), distance_m


def join(start: Pose, end: Pose, radius_m: float, slope: float) -> JoinRoute:
    """Return the shortest of the four routes turn, straight, turn; turns have `radius_m`."""
    found = (_legs(start, end, radius_m, first, last) for first in (1, -1) for last in (1, -1))
    routes = [JoinRoute(legs, start.height_m, end.height_m, slope) for legs in found if legs]
    return min(routes, key=lambda route: route.length_m)


def _legs(start: Pose, end: Pose, radius_m: float, first: int, last: int) -> tuple[Leg, ...]:
    """Return the legs for turns to the right (1) or left (-1); none if the circles are too near for opposite turns."""
    from_north, from_east = _centre(start, radius_m * first)
    to_north, to_east = _centre(end, radius_m * last)
    apart_m = math.hypot(to_north - from_north, to_east - from_east)
    bearing = math.atan2(to_east - from_east, to_north - from_north)
    if first == last:
        course, straight_m = bearing, apart_m
    elif apart_m >= 2 * radius_m:
        course = bearing + first * math.asin(2 * radius_m / apart_m)
        straight_m = math.sqrt(apart_m**2 - 4 * radius_m**2)
    else:
        return ()
    turn = Leg(start, radius_m * ((first * (course - start.course_rad)) % TURN), first / radius_m)
    straight = Leg(turn.at(turn.length_m), straight_m, 0.0)
    final_m = radius_m * ((last * (end.course_rad - course)) % TURN)
    return turn, straight, Leg(straight.at(straight_m), final_m, last / radius_m)


def _centre(pose: Pose, to_the_right_m: float) -> tuple[float, float]:
    return (
        pose.north_m - to_the_right_m * math.sin(pose.course_rad),
        pose.east_m + to_the_right_m * math.cos(pose.course_rad),
    )
